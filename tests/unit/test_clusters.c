/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/clusters.h"
#include "solver/kinematics.h"
#include "tests/unit/box_mesh.h"

/* 4 x 4 x 4 elements of 2 mm, so cells are 1 mm cubes on an 8 x 8 x 8 grid; lowest layer fat. */
static const struct box grid = {{4, 4, 4}, {8, 8, 8}, 0, 1};
enum { FAT_CELL_LAYERS = 2 };

struct fixture {
    struct mesh mesh;
    struct faces faces;
    struct strain_field field;
    int *id;
};

static struct fixture fixture_make(void)
{
    struct fixture f = {.mesh = box_mesh(&grid)};
    double *u = box_alloc((size_t)f.mesh.node_count * 3, sizeof *u);
    assert_int_equal(faces_init(&f.faces, &f.mesh, NULL), ISCHIA_OK);
    assert_int_equal(strain_field_init(&f.field, &f.mesh, u, NULL), ISCHIA_OK);
    f.id = box_alloc((size_t)f.field.cell_count, sizeof *f.id);
    free(u);
    return f;
}

static void fixture_free(struct fixture *f)
{
    free(f->id);
    strain_field_finish(&f->field);
    faces_finish(&f->faces);
    box_mesh_free(&f->mesh);
}

/* The cell at place (i, j, k) of the 8 x 8 x 8 grid. */
static int cell_index(int i, int j, int k)
{
    static const int corner[2][2][2] = {{{0, 1}, {3, 2}}, {{4, 5}, {7, 6}}};
    return box_element(&grid, i / 2, j / 2, k / 2) * HEX_CELLS + corner[k % 2][j % 2][i % 2];
}

static void load_cell(struct fixture *f, int i, int j, int k)
{
    struct strain_measures *s = &f->field.cell[cell_index(i, j, k)].strain;
    *s = (struct strain_measures){0.8, 0.46, 0.9};
}

static struct ischia_cluster_set find(struct fixture *f, enum ischia_criterion criterion)
{
    struct ischia_cluster_set set;
    assert_int_equal(clusters_find(&f->mesh, &f->faces, &f->field, criterion, &set, f->id, NULL),
                     ISCHIA_OK);
    return set;
}

static void assert_near(double value, double expected)
{
    assert_true(fabs(value - expected) <= 1e-12 * (1 + fabs(expected)));
}

static void assert_centroid(const struct ischia_cluster *c, double x, double y, double z)
{
    assert_near(c->centroid_mm[0], x);
    assert_near(c->centroid_mm[1], y);
    assert_near(c->centroid_mm[2], z);
}

/* Where the integration point of the lower or upper cell of an element lies, from its low side. */
static double point_offset(int upper) { return upper ? 1 + 1 / sqrt(3.0) : 1 - 1 / sqrt(3.0); }

static double point_at(int i)
{
    const int element = i / 2;
    return 2.0 * element + point_offset(i % 2);
}

static void unloaded_muscle_has_no_cluster(void **state)
{
    (void)state;
    struct fixture f = fixture_make();
    const struct ischia_cluster_set set = find(&f, ISCHIA_OVER_SHEAR);
    assert_int_equal(set.count, 0);
    assert_true(set.volume_mm3 == 0 && !set.has_largest);
    for (int i = 0; i < f.field.cell_count; i++) assert_int_equal(f.id[i], NO_CLUSTER);
    fixture_free(&f);
}

static void one_cell_is_one_two_or_four_bodies(void **state)
{
    (void)state;
    static const struct {
        int i, j, count;
    } cases[] = {{0, 0, 1}, {0, 3, 2}, {3, 0, 2}, {3, 3, 4}, {7, 7, 4}, {1, 1, 4}};
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        struct fixture f = fixture_make();
        const int i = cases[n].i, j = cases[n].j;
        load_cell(&f, i, j, 4);
        const struct ischia_cluster_set set = find(&f, ISCHIA_OVER_BOTH);
        assert_int_equal(set.count, cases[n].count);
        assert_near(set.volume_mm3, 4);
        assert_near(set.largest.volume_mm3, 4.0 / cases[n].count);
        assert_centroid(&set.largest, i == 0 ? 0 : point_at(i), j == 0 ? 0 : point_at(j),
                        point_at(4));
        assert_near(set.largest.eps_max, 0.9);
        assert_near(set.largest.E_shear_max, 0.8);
        assert_near(set.largest.E_comp_max, 0.46);
        fixture_free(&f);
    }
}

static void every_pair_of_neighbours_connects_and_no_other(void **state)
{
    (void)state;
    /* Around one cell inside an element and one at its far corner: 6 faces connect, 20 edges
     * and corners do not. */
    for (int centre = 3; centre <= 4; centre++) {
        for (int n = 0; n < 27; n++) {
            const int d[3] = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
            const int distance = abs(d[0]) + abs(d[1]) + abs(d[2]);
            if (distance == 0) continue;
            struct fixture f = fixture_make();
            load_cell(&f, centre, centre, centre);
            load_cell(&f, centre + d[0], centre + d[1], centre + d[2]);
            const struct ischia_cluster_set set = find(&f, ISCHIA_OVER_SHEAR);
            assert_int_equal(set.count, distance == 1 ? 4 : 8);
            assert_near(set.volume_mm3, 8);
            assert_near(set.largest.volume_mm3, distance == 1 ? 2 : 1);
            fixture_free(&f);
        }
    }
}

static void bodies_on_every_combination_of_planes_are_summed_and_ranked(void **state)
{
    (void)state;
    struct fixture f = fixture_make();
    for (int k = 2; k < 8; k++) load_cell(&f, 0, 0, k);         /* both planes: one body of 24 */
    for (int i = 3; i < 6; i++) load_cell(&f, i, 0, 7);         /* y = 0: two of 6             */
    for (int j = 3; j < 8; j++) load_cell(&f, 0, j, 2);         /* x = 0: two of 10            */
    for (int i = 4; i < 8; i++) load_cell(&f, i, 4 + i % 2, 4); /* none: 4 x 4 of 1            */
    const struct ischia_cluster_set set = find(&f, ISCHIA_OVER_BOTH);
    assert_int_equal(set.count, 1 + 2 + 2 + 16);
    assert_near(set.volume_mm3, 4.0 * (6 + 3 + 5 + 4));
    assert_near(set.largest.volume_mm3, 24);
    assert_centroid(&set.largest, 0, 0, 5);
    assert_int_equal(f.id[cell_index(0, 0, 5)], 1);
    assert_int_equal(f.id[cell_index(0, 7, 2)], 2);
    assert_int_equal(f.id[cell_index(4, 0, 7)], 3);
    assert_int_equal(f.id[cell_index(1, 1, 1)], NO_CLUSTER);
    fixture_free(&f);
}

static void a_long_winding_body_is_one(void **state)
{
    (void)state;
    struct fixture f = fixture_make();
    int cells = 0;
    /* A snake through the layer k = 5: rows j even, joined at alternating ends. */
    for (int j = 0; j < 8; j++) {
        for (int i = 0; i < 8; i++) {
            const int join = j % 4 == 1 ? 7 : 0;
            if (j % 2 == 1 && i != join) continue;
            load_cell(&f, i, j, 5);
            cells++;
        }
    }
    const struct ischia_cluster_set set = find(&f, ISCHIA_OVER_COMPRESSION);
    assert_int_equal(set.count, 1);
    assert_near(set.largest.volume_mm3, 4.0 * cells);
    for (int i = 0; i < 8; i++) assert_int_equal(f.id[cell_index(i, 4, 5)], 1);
    fixture_free(&f);
}

static void a_body_with_a_plane_only_at_an_edge_does_not_touch_it(void **state)
{
    (void)state;
    /* Shear the mesh so that only an edge of the cell's element lies on x = 0. */
    struct fixture f = fixture_make();
    f.mesh.node_flags[box_node(&grid, 0, 1, 2)] &= (unsigned char)~NODE_ON_X0;
    f.mesh.node_flags[box_node(&grid, 0, 2, 2)] &= (unsigned char)~NODE_ON_X0;
    load_cell(&f, 0, 2, 4);
    assert_int_equal(find(&f, ISCHIA_OVER_SHEAR).count, 4);
    fixture_free(&f);
}

static void fat_never_counts_and_never_connects(void **state)
{
    (void)state;
    struct fixture f = fixture_make();
    for (int k = 0; k < FAT_CELL_LAYERS; k++)
        for (int i = 2; i < 6; i++) load_cell(&f, i, 3, k);
    load_cell(&f, 2, 3, FAT_CELL_LAYERS);
    load_cell(&f, 5, 3, FAT_CELL_LAYERS);
    const struct ischia_cluster_set set = find(&f, ISCHIA_OVER_BOTH);
    assert_int_equal(set.count, 8);
    assert_near(set.volume_mm3, 8);
    assert_int_equal(f.id[cell_index(3, 3, 1)], NO_CLUSTER);
    fixture_free(&f);
}

static void criteria_are_strict_and_on_their_own_measure(void **state)
{
    (void)state;
    static const struct {
        struct strain_measures s;
        bool met[ISCHIA_CRITERION_COUNT];
    } cases[] = {
        {{0.75, 0.45, 5}, {false, false, false}},
        {{0.7501, 0.45, 0}, {true, false, false}},
        {{0.75, 0.4501, 0}, {false, true, false}},
        {{0.7501, 0.4501, 0}, {true, true, true}},
    };
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++)
        for (int c = 0; c < ISCHIA_CRITERION_COUNT; c++)
            assert_int_equal(criterion_is_met((enum ischia_criterion)c, &cases[n].s),
                             cases[n].met[c]);
    for (int c = 0; c < ISCHIA_CRITERION_COUNT; c++) assert_non_null(criterion_names[c]);
}

static void all_criteria_are_found_at_once(void **state)
{
    (void)state;
    struct fixture f = fixture_make();
    struct ischia_cluster_set sets[ISCHIA_CRITERION_COUNT];
    load_cell(&f, 0, 0, 4);
    f.field.cell[cell_index(0, 0, 5)].strain.green_lagrange_shear = 0.9;
    f.field.cell[cell_index(0, 0, 3)].strain.green_lagrange_compression = 0.48;
    assert_int_equal(clusters_find_all(&f.mesh, &f.field, sets, NULL), ISCHIA_OK);
    assert_near(sets[ISCHIA_OVER_SHEAR].volume_mm3, 8);
    assert_near(sets[ISCHIA_OVER_SHEAR].largest.E_shear_max, 0.9);
    assert_near(sets[ISCHIA_OVER_COMPRESSION].volume_mm3, 8);
    assert_near(sets[ISCHIA_OVER_COMPRESSION].largest.E_comp_max, 0.48);
    assert_near(sets[ISCHIA_OVER_BOTH].volume_mm3, 4);
    fixture_free(&f);
}

static void the_whole_muscle_is_one_body_of_the_whole_volume(void **state)
{
    (void)state;
    struct fixture f = fixture_make();
    box_distort(&f.mesh, 0.005);
    double A[3][3] = {{2.2, 0, 0}, {0, 1.8, 0}, {0, 0, 0.25}};
    double *u = box_displacement(&f.mesh, A);
    strain_field_finish(&f.field);
    assert_int_equal(strain_field_init(&f.field, &f.mesh, u, NULL), ISCHIA_OK);
    const struct ischia_cluster_set set = find(&f, ISCHIA_OVER_BOTH);
    assert_int_equal(set.count, 1);
    assert_near(set.volume_mm3, 4 * strain_muscle_volume_mm3(&f.mesh, &f.field));
    assert_near(set.largest.volume_mm3, set.volume_mm3);
    free(u);
    fixture_free(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unloaded_muscle_has_no_cluster),
        cmocka_unit_test(one_cell_is_one_two_or_four_bodies),
        cmocka_unit_test(every_pair_of_neighbours_connects_and_no_other),
        cmocka_unit_test(bodies_on_every_combination_of_planes_are_summed_and_ranked),
        cmocka_unit_test(a_long_winding_body_is_one),
        cmocka_unit_test(a_body_with_a_plane_only_at_an_edge_does_not_touch_it),
        cmocka_unit_test(fat_never_counts_and_never_connects),
        cmocka_unit_test(criteria_are_strict_and_on_their_own_measure),
        cmocka_unit_test(all_criteria_are_found_at_once),
        cmocka_unit_test(the_whole_muscle_is_one_body_of_the_whole_volume),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
