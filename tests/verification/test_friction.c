/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Coulomb's law at single nodes of the seat.
 *
 * Oracles: a node that slips carries mu N against its slip, one that sticks the force of its
 * spring; slip of length s under a steady N dissipates mu N s; a node that is driven to and fro by
 * +-a dissipates 4 mu N (a - mu N / k) a cycle, the area of the hysteresis loop of a spring k in
 * series with a slider mu N (Masing 1926; Jenkins' element).
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/verification/bodies.h"

static const double mu = 0.4;
static const double rounding = 1e-12;

/* One element of 2 mm; nodes 0 ... 3 lie on the seat. */
struct rig {
    struct mesh mesh;
    struct seat seat;
    double u[8][3];
    double before_N[8];
};

static void rig_init(struct rig *r, double normal_N)
{
    const double size[3] = {2, 2, 2};
    const int m[3] = {1, 1, 1};
    *r = (struct rig){0};
    assert_int_equal(block_init(&r->mesh, size, m, 0, NULL), ISCHIA_OK);
    assert_int_equal(seat_init(&r->seat, &r->mesh, mu, NULL), ISCHIA_OK);
    for (int n = 0; n < 4; n++) r->seat.normal_N[n] = r->before_N[n] = normal_N;
}

static void rig_finish(struct rig *r)
{
    seat_finish(&r->seat);
    mesh_finish(&r->mesh);
}

static void forces(const struct rig *r, double ret[8][3])
{
    memset(ret, 0, sizeof(double[8][3]));
    seat_add_force(&r->seat, r->seat.normal_N, (const double(*)[3])r->u, ret);
}

/* Moves node 0 to (x, y) and ends the step; returns what was dissipated. */
static double move_to(struct rig *r, double x, double y)
{
    r->u[0][0] = x;
    r->u[0][1] = y;
    return seat_advance(&r->seat, (const double(*)[3])r->u, r->before_N);
}

static void assert_near(double found, double expected, double scale)
{
    if (!(fabs(found - expected) <= rounding * scale))
        fail_msg("%.17g, expected %.17g", found, expected);
}

static void a_slipping_node_carries_mu_N_against_its_slip(void **state)
{
    (void)state;
    struct rig r;
    rig_init(&r, 0.3);
    for (int i = 0; i < 9; i++) {
        const double angle = 0.7 * i;
        double f[8][3];
        r.u[0][0] = 5 * cos(angle);
        r.u[0][1] = 5 * sin(angle);
        forces(&r, f);
        assert_near(f[0][0], mu * 0.3 * cos(angle), 1);
        assert_near(f[0][1], mu * 0.3 * sin(angle), 1);
        assert_near(f[0][2], 0, 1);
        assert_near(f[1][0], 0, 1); /* the others have not moved */
    }
    rig_finish(&r);
}

static void a_sticking_node_carries_its_spring_force(void **state)
{
    (void)state;
    struct rig r;
    double f[8][3];
    rig_init(&r, 0.3);
    const double k = r.seat.stick_stiffness_N_mm[0], limit_mm = mu * 0.3 / k;
    r.u[0][0] = 0.6 * limit_mm;
    r.u[0][1] = -0.7 * limit_mm;
    forces(&r, f);
    assert_true(hypot(f[0][0], f[0][1]) < mu * 0.3);
    assert_near(f[0][0], k * r.u[0][0], 1);
    assert_near(f[0][1], k * r.u[0][1], 1);
    assert_near(seat_advance(&r.seat, (const double(*)[3])r.u, r.before_N), 0, 1);
    assert_near(r.seat.anchor_mm[0][0], 0, 1);
    rig_finish(&r);
}

static void slip_dissipates_mu_N_times_its_length(void **state)
{
    (void)state;
    struct rig r;
    double f[8][3], slip_mm = 0, dissipated = 0;
    rig_init(&r, 0.3);
    const double stretch = mu * 0.3 / r.seat.stick_stiffness_N_mm[0];
    for (int s = 1; s <= 10; s++) dissipated += move_to(&r, 0.3 * s, 0.4 * s);
    slip_mm = 10 * 0.5 - stretch; /* the spring keeps its stretch at the slip limit */
    assert_near(dissipated, mu * 0.3 * slip_mm, 1);
    forces(&r, f);
    assert_near(hypot(f[0][0], f[0][1]), mu * 0.3, 1); /* on the limit after the step */
    rig_finish(&r);
}

static void a_cycle_dissipates_the_area_of_its_loop(void **state)
{
    (void)state;
    const double a = 3, N = 0.3;
    struct rig r;
    double first = 0, cycle = 0;
    rig_init(&r, N);
    const double k = r.seat.stick_stiffness_N_mm[0];
    assert_true(a > 2 * mu * N / k);
    for (int s = 1; s <= 100; s++) first += move_to(&r, a * s / 100, 0);
    assert_near(first, mu * N * (a - mu * N / k), 1);
    for (int s = 1; s <= 400; s++) {
        const double phase = s / 100.0; /* a -> -a -> a */
        cycle += move_to(&r, a * (fabs(phase - 2) - 1), 0);
    }
    assert_near(cycle, 4 * mu * N * (a - mu * N / k), 10);
    rig_finish(&r);
}

static void a_growing_contact_force_counts_with_its_mean(void **state)
{
    (void)state;
    struct rig r;
    rig_init(&r, 0.3);
    const double k = r.seat.stick_stiffness_N_mm[0];
    r.before_N[0] = 0.1;
    const double slip_mm = 5 - mu * 0.3 / k;
    assert_near(move_to(&r, 5, 0), mu * 0.2 * slip_mm, 1);
    rig_finish(&r);
}

static void a_node_off_the_seat_takes_its_anchor_along(void **state)
{
    (void)state;
    struct rig r;
    double f[8][3];
    rig_init(&r, 0);
    assert_near(move_to(&r, 1, -2), 0, 1);
    r.seat.normal_N[0] = 0.3; /* it lands there: no force until it moves on */
    forces(&r, f);
    assert_near(hypot(f[0][0], f[0][1]), 0, 1);
    rig_finish(&r);
}

static void springs_share_the_area_of_the_seat(void **state)
{
    (void)state;
    struct rig r;
    rig_init(&r, 0);
    double sum = 0;
    for (int n = 0; n < 8; n++) sum += r.seat.stick_stiffness_N_mm[n];
    for (int n = 0; n < 4; n++) assert_near(r.seat.stick_stiffness_N_mm[n], sum / 4, 1);
    assert_true(sum > 0);
    rig_finish(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_slipping_node_carries_mu_N_against_its_slip),
        cmocka_unit_test(a_sticking_node_carries_its_spring_force),
        cmocka_unit_test(slip_dissipates_mu_N_times_its_length),
        cmocka_unit_test(a_cycle_dissipates_the_area_of_its_loop),
        cmocka_unit_test(a_growing_contact_force_counts_with_its_mean),
        cmocka_unit_test(a_node_off_the_seat_takes_its_anchor_along),
        cmocka_unit_test(springs_share_the_area_of_the_seat),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
