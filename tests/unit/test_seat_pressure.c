/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "solver/seat_pressure.h"
#include "tests/unit/box_mesh.h"

static const struct box box = {{4, 2, 1}, {8, 6, 5}, 0, 0};
static const double pressure_MPa = 0.02;

/* Tributary area of a bottom node of the undeformed box: 2 x 3 mm inside, less at the rim. */
static double tributary_mm2(int i, int j)
{
    return 6 * (i == 0 || i == box.n[0] ? 0.5 : 1) * (j == 0 || j == box.n[1] ? 0.5 : 1);
}

/* Forces of a uniform pressure on the bottom nodes with i <= last, times the areas' stretch. */
static double *uniform_forces(const struct mesh *mesh, int last, double stretch)
{
    double *force = box_alloc((size_t)mesh->node_count, sizeof *force);
    for (int j = 0; j <= box.n[1]; j++)
        for (int i = 0; i <= last; i++)
            force[box_node(&box, i, j, 0)] = pressure_MPa * stretch * tributary_mm2(i, j);
    return force;
}

static struct ischia_seat seat_of(const struct mesh *mesh, const double *u, const double *force)
{
    const struct seat_state state = {u, force};
    struct ischia_seat seat = {.displacement_mm = 12};
    assert_int_equal(seat_pressure(mesh, &state, &seat, NULL), ISCHIA_OK);
    assert_true(seat.displacement_mm == 12);
    return seat;
}

static void assert_near(double value, double expected)
{
    assert_true(fabs(value - expected) <= 1e-12 * (1 + fabs(expected)));
}

static void uniform_pressure_on_the_whole_deformed_base(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    double A[3][3] = {{1.5, 0, 0}, {0.25, 1.25, 0}, {0, 0, 0.5}};
    const double stretch = 1.5 * 1.25;
    double *u = box_displacement(&mesh, A);
    double *force = uniform_forces(&mesh, box.n[0], stretch);
    const struct ischia_seat seat = seat_of(&mesh, u, force);
    assert_near(seat.contact_area_mm2, 4 * 48 * stretch);
    assert_near(seat.mean_pressure_kPa, 20);
    assert_near(seat.peak_pressure_kPa, 20);
    free(force);
    free(u);
    box_mesh_free(&mesh);
}

static void the_border_lies_half_way_to_the_first_open_node(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    double *u = box_alloc((size_t)mesh.node_count * 3, sizeof *u);
    double *force = uniform_forces(&mesh, 2, 1);
    /* Columns x = 0, 2, 4 press, 6 and 8 do not: the border is at x = 5, of a base 6 mm deep. */
    const struct ischia_seat seat = seat_of(&mesh, u, force);
    assert_near(seat.contact_area_mm2, 4 * 5 * 6);
    assert_near(seat.mean_pressure_kPa, 20);
    free(force);
    free(u);
    box_mesh_free(&mesh);
}

static void the_peak_is_the_highest_nodal_pressure(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    double *u = box_alloc((size_t)mesh.node_count * 3, sizeof *u);
    double *force = uniform_forces(&mesh, box.n[0], 1);
    force[box_node(&box, 0, 0, 0)] *= 3;
    const struct ischia_seat seat = seat_of(&mesh, u, force);
    assert_near(seat.peak_pressure_kPa, 60);
    /* The corner's 1.5 mm2 at 60 kPa, the other 46.5 at 20. */
    assert_near(seat.mean_pressure_kPa, (1.5 * 60 + 46.5 * 20) / 48);
    free(force);
    free(u);
    box_mesh_free(&mesh);
}

static void without_contact_everything_is_zero(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&box);
    double *u = box_alloc((size_t)mesh.node_count * 3, sizeof *u);
    double *force = box_alloc((size_t)mesh.node_count, sizeof *force);
    const struct ischia_seat seat = seat_of(&mesh, u, force);
    assert_true(seat.contact_area_mm2 == 0 && seat.mean_pressure_kPa == 0 &&
                seat.peak_pressure_kPa == 0);
    free(force);
    free(u);
    box_mesh_free(&mesh);
}

/* A box of one element whose side x = 2 may touch too; `folded` lays that side on the seat. */
static double area_with_side(double outward)
{
    const struct box cube = {{1, 1, 1}, {2, 2, 2}, 0, 0};
    struct mesh mesh = box_mesh(&cube);
    const int side[4] = {1, 3, 7, 5}; /* looks along +x */
    int(*quads)[4] = box_alloc(2, sizeof *quads);
    memcpy(quads[0], mesh.seat_quad[0], sizeof quads[0]);
    memcpy(quads[1], side, sizeof side);
    free(mesh.seat_quad);
    mesh.seat_quad = quads;
    mesh.seat_quad_count = 2;
    double *u = box_alloc((size_t)mesh.node_count * 3, sizeof *u);
    double *force = box_alloc((size_t)mesh.node_count, sizeof *force);
    for (int n = 0; n < 4; n++) force[n] = 1;
    static const int upper[2] = {5, 7};
    for (int k = 0; k < 2; k++) {
        u[3 * upper[k]] = outward;
        u[3 * upper[k] + 2] = -2;
        force[upper[k]] = 1;
    }
    const double area = seat_of(&mesh, u, force).contact_area_mm2;
    free(force);
    free(u);
    box_mesh_free(&mesh);
    return area;
}

static void a_side_folded_onto_the_seat_adds_its_area(void **state)
{
    (void)state;
    assert_near(area_with_side(2), 4 * (4 + 4));
    assert_near(area_with_side(0), 4 * 4);  /* upright: nothing */
    assert_near(area_with_side(-1), 4 * 4); /* tucked under: looks up, nothing */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(uniform_pressure_on_the_whole_deformed_base),
        cmocka_unit_test(the_border_lies_half_way_to_the_first_open_node),
        cmocka_unit_test(the_peak_is_the_highest_nodal_pressure),
        cmocka_unit_test(without_contact_everything_is_zero),
        cmocka_unit_test(a_side_folded_onto_the_seat_adds_its_area),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
