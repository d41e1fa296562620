/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/seat.h"
#include "tests/unit/box_mesh.h"
#include "tests/unit/near.h"

static const struct box small = {{2, 2, 1}, {4, 6, 3}, 0, 0};
static const double friction = 0.4;

/* Four nodes in turn: sticking, slipping, without contact, at its anchor. k = 10 N/mm. */
enum { STICKS, SLIPS, FREE, RESTS, NODES };
struct toy {
    struct seat seat;
    double stiffness[NODES], anchor[NODES][2], normal[NODES], u[NODES][3];
};

static void toy_init(struct toy *t)
{
    *t = (struct toy){
        .stiffness = {10, 10, 10, 10},
        .anchor = {{0.1, -0.2}, {1, 2}, {0, 0}, {0.3, 0.3}},
        .normal = {0.5, 2, 0, 1},
        .u = {{0.107, -0.212, 9}, {1.3, 1.6, 9}, {5, 5, 9}, {0.3, 0.3, 9}},
    };
    t->seat = (struct seat){.friction = friction,
                            .stick_stiffness_N_mm = t->stiffness,
                            .anchor_mm = t->anchor,
                            .normal_N = t->normal,
                            .node_count = NODES};
}

static const double (*at(const struct toy *t))[3] { return (const double(*)[3])t->u; }

static void potential_is_that_of_the_header(void **state)
{
    (void)state;
    struct toy t;
    toy_init(&t);
    const double r = hypot(0.007, 0.012), limit = friction * 2;
    const double expected = 10 * r * r / 2 + limit * 0.5 - limit * limit / (2 * 10);
    assert_near(seat_energy(&t.seat, at(&t)), expected, 1e-14);
}

static void force_is_the_gradient_and_obeys_coulomb(void **state)
{
    (void)state;
    static const double h = 1e-7;
    struct toy t;
    toy_init(&t);
    double force[NODES][3] = {{0}};
    seat_add_force(&t.seat, t.normal, at(&t), force);
    for (int n = 0; n < NODES; n++) {
        assert_true(force[n][2] == 0);
        for (int c = 0; c < 2; c++) {
            const double was = t.u[n][c];
            t.u[n][c] = was + h;
            const double up = seat_energy(&t.seat, at(&t));
            t.u[n][c] = was - h;
            const double down = seat_energy(&t.seat, at(&t));
            t.u[n][c] = was;
            if (n != RESTS) assert_near(force[n][c], (up - down) / (2 * h), 1e-8);
        }
        assert_true(hypot(force[n][0], force[n][1]) <= friction * t.normal[n] * (1 + 1e-14));
    }
    assert_near(hypot(force[SLIPS][0], force[SLIPS][1]), friction * t.normal[SLIPS], 1e-14);
    assert_near(force[SLIPS][0] / force[SLIPS][1], -0.75, 1e-12); /* along the stretch */
    assert_true(force[FREE][0] == 0 && force[RESTS][0] == 0);
}

static void hessian_is_the_gradient_of_the_force(void **state)
{
    (void)state;
    static const double h = 1e-6;
    struct toy t;
    toy_init(&t);
    for (int n = STICKS; n <= SLIPS; n++) {
        double hessian[2][2];
        seat_hessian(&t.seat, at(&t), n, hessian);
        for (int c = 0; c < 2; c++) {
            double up[NODES][3] = {{0}}, down[NODES][3] = {{0}};
            const double was = t.u[n][c];
            t.u[n][c] = was + h;
            seat_add_force(&t.seat, t.normal, at(&t), up);
            t.u[n][c] = was - h;
            seat_add_force(&t.seat, t.normal, at(&t), down);
            t.u[n][c] = was;
            for (int k = 0; k < 2; k++)
                assert_near(hessian[k][c], (up[n][k] - down[n][k]) / (2 * h), 1e-7);
        }
    }
}

/* After a step the slipping spring is stretched to just its limit, and its force is as before. */
static void advance_moves_the_anchors(void **state)
{
    (void)state;
    struct toy t;
    toy_init(&t);
    const double before[NODES] = {0.5, 1, 0, 1};
    double force[2][NODES][3] = {{{0}}};
    seat_add_force(&t.seat, t.normal, at(&t), force[0]);
    const double dissipated = seat_advance(&t.seat, at(&t), before);
    seat_add_force(&t.seat, t.normal, at(&t), force[1]);
    assert_memory_equal(force[0][STICKS], force[1][STICKS], sizeof force[0][STICKS]);
    for (int c = 0; c < 2; c++) {
        assert_near(force[1][SLIPS][c], force[0][SLIPS][c], 1e-13);
        assert_true(t.anchor[FREE][c] == t.u[FREE][c]);
        assert_true(t.anchor[RESTS][c] == t.u[RESTS][c]);
    }
    const double slip = 0.5 - friction * 2 / 10;
    assert_near(hypot(t.anchor[SLIPS][0] - 1, t.anchor[SLIPS][1] - 2), slip, 1e-13);
    assert_near(dissipated, friction * (1 + 2) / 2 * slip, 1e-13);
    /* Nothing moves and nothing is lost when it is called again. */
    assert_near(seat_advance(&t.seat, at(&t), t.normal), 0, 1e-14);
}

static void without_friction_nothing_pulls(void **state)
{
    (void)state;
    struct toy t;
    toy_init(&t);
    t.seat.friction = 0;
    double force[NODES][3] = {{0}};
    seat_add_force(&t.seat, t.normal, at(&t), force);
    for (int n = 0; n < NODES; n++) assert_true(force[n][0] == 0 && force[n][1] == 0);
    assert_true(seat_energy(&t.seat, at(&t)) == 0);
    assert_true(seat_advance(&t.seat, at(&t), t.normal) == 0);
}

static struct seat seat_of(const struct mesh *mesh)
{
    struct seat seat = {0};
    struct ischia_error err;
    if (seat_init(&seat, mesh, friction, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    return seat;
}

/* Springs by area: they add up to 1 MPa/mm over the seat quads; outer skin starts in contact. */
static void springs_belong_to_areas(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&small);
    struct seat seat = seat_of(&mesh);
    double sum = 0;
    for (int n = 0; n < mesh.node_count; n++) {
        sum += seat.stick_stiffness_N_mm[n];
        const bool touches = mesh.X_mm[n][2] == 0;
        assert_true((seat.stick_stiffness_N_mm[n] > 0) == touches);
        assert_true((seat.normal_N[n] > 0) == touches);
        assert_true(seat.normal_N[n] < 1e-9);
    }
    assert_near(sum, 1.0 * 4 * 6, 1e-12);
    const struct box *b = &small;
    const double corner = seat.stick_stiffness_N_mm[box_node(b, 0, 0, 0)];
    assert_near(seat.stick_stiffness_N_mm[box_node(b, 1, 1, 0)], 4 * corner, 1e-13);
    seat_finish(&seat);
    seat_finish(&seat);
    box_mesh_free(&mesh);
}

static void binding_needs_seat_contact_and_pressure(void **state)
{
    (void)state;
    struct mesh mesh = box_mesh(&small);
    double(*u)[3] = box_alloc((size_t)mesh.node_count, sizeof *u);
    double(*force)[3] = box_alloc((size_t)mesh.node_count, sizeof *force);
    const int n = box_node(&small, 1, 1, 0), above = box_node(&small, 1, 1, 1);
    force[n][2] = force[above][2] = 1;
    u[above][2] = -3;
    assert_true(seat_binds(&mesh, (const double(*)[3])u, (const double(*)[3])force, n));
    assert_false(seat_binds(&mesh, (const double(*)[3])u, (const double(*)[3])force, above));
    u[n][2] = 1e-3;
    assert_near(seat_gap_mm(&mesh, (const double(*)[3])u, n), 1e-3, 0);
    assert_false(seat_binds(&mesh, (const double(*)[3])u, (const double(*)[3])force, n));
    u[n][2] = 0;
    force[n][2] = -1;
    assert_false(seat_binds(&mesh, (const double(*)[3])u, (const double(*)[3])force, n));
    free(u);
    free(force);
    box_mesh_free(&mesh);
}

/* The matrix gets the Hessian of a node that has come to the seat; of one that rests there, whose
 * friction belongs to the condensed system, it gets nothing. */
static void matrix_gets_the_nodes_that_come_to_the_seat(void **state)
{
    (void)state;
    static const struct box tall = {{2, 2, 2}, {4, 6, 3}, 0, 0};
    static const int heights[] = {0, 1};
    for (int h = 0; h < 2; h++) {
        struct mesh mesh = box_mesh(&tall);
        struct seat seat = seat_of(&mesh);
        struct assembly a = {0};
        const int node = box_node(&tall, 1, 1, heights[h]);
        mesh.node_flags[node] |= NODE_ON_SEAT;
        seat.stick_stiffness_N_mm[node] = 2;
        assert_int_equal(assembly_init(&a, &mesh, NULL), ISCHIA_OK);
        double(*u)[3] = box_alloc((size_t)mesh.node_count, sizeof *u);
        double hessian[2][2];
        u[node][0] = 0.3;
        u[node][1] = 0.4;
        seat.normal_N[node] = 0.25;
        linear_clear(a.linear);
        seat_add_stiffness(&seat, &a, (const double(*)[3])u);
        seat_hessian(&seat, (const double(*)[3])u, node, hessian);
        const double *values = linear_values(a.linear), share = heights[h] > 0;
        for (int c = 0; c < 2; c++)
            assert_near(values[a.diagonal[node][c]], share * hessian[c][c], 1e-15);
        assert_near(values[a.tangential[node]], share * hessian[0][1], 1e-15);
        assert_true(values[a.diagonal[node][2]] == 0);
        free(u);
        assembly_finish(&a);
        seat_finish(&seat);
        box_mesh_free(&mesh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(potential_is_that_of_the_header),
        cmocka_unit_test(force_is_the_gradient_and_obeys_coulomb),
        cmocka_unit_test(hessian_is_the_gradient_of_the_force),
        cmocka_unit_test(advance_moves_the_anchors),
        cmocka_unit_test(without_friction_nothing_pulls),
        cmocka_unit_test(springs_belong_to_areas),
        cmocka_unit_test(binding_needs_seat_contact_and_pressure),
        cmocka_unit_test(matrix_gets_the_nodes_that_come_to_the_seat),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
