/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "solver/faces.h"
#include "tests/unit/box_mesh.h"

static const struct box box = {{3, 2, 4}, {3, 2, 4}, 0, 0};

/* The outward normals of the sides of a box in VTK corner order. */
static const int outward[HEX_SIDES][3] = {{0, 0, -1}, {0, 0, 1}, {0, -1, 0},
                                          {1, 0, 0},  {0, 1, 0}, {-1, 0, 0}};

static void sides_are_numbered_and_point_outwards(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    for (int side = 0; side < HEX_SIDES; side++) {
        int n[FACE_CORNERS];
        face_nodes(&mesh, side, n);
        for (int d = 0; d < 3; d++) {
            const int p = (d + 1) % 3, q = (d + 2) % 3;
            const double *a = mesh.X_mm[n[0]], *b = mesh.X_mm[n[1]], *c = mesh.X_mm[n[2]];
            const double normal = (b[p] - a[p]) * (c[q] - b[q]) - (b[q] - a[q]) * (c[p] - b[p]);
            assert_true(normal == (double)outward[side][d]);
        }
    }
    box_mesh_free(&mesh);
}

/* The element across a side, or -1 outside the box. */
static int expected_across(int i, int j, int k, int side)
{
    const int at[3] = {i + outward[side][0], j + outward[side][1], k + outward[side][2]};
    for (int d = 0; d < 3; d++)
        if (at[d] < 0 || at[d] >= box.n[d]) return -1;
    return box_element(&box, at[0], at[1], at[2]);
}

static void faces_know_the_element_across(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    struct faces faces;
    assert_int_equal(faces_init(&faces, &mesh, NULL), ISCHIA_OK);
    assert_int_equal(faces.count, 6 * mesh.element_count);
    for (int n = 0; n < faces.count; n++) {
        const int side = n % HEX_SIDES, place = n / HEX_SIDES;
        const int i = place % box.n[0], j = place / box.n[0] % box.n[1];
        const int k = place / (box.n[0] * box.n[1]);
        const int face = HEX_SIDES * box_element(&box, i, j, k) + side;
        const int across = faces.across[face];
        assert_int_equal(across < 0 ? -1 : across / HEX_SIDES, expected_across(i, j, k, side));
        if (across >= 0) assert_int_equal(faces.across[across], face);
    }
    faces_finish(&faces);
    box_mesh_free(&mesh);
}

static void flags_need_all_four_nodes(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    const int low = HEX_SIDES * box_element(&box, 0, 0, 0);
    assert_true(face_has_flag(&mesh, low, NODE_ON_SEAT));
    assert_false(face_has_flag(&mesh, low + 1, NODE_ON_SEAT));
    assert_false(face_has_flag(&mesh, low, NODE_ON_X0));
    assert_true(face_has_flag(&mesh, low + 5, NODE_ON_X0));
    assert_true(face_has_flag(&mesh, low + 2, NODE_ON_Y0));
    box_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sides_are_numbered_and_point_outwards),
        cmocka_unit_test(faces_know_the_element_across),
        cmocka_unit_test(flags_need_all_four_nodes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
