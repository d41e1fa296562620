/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A block between bone and seat: small enough that every claim of newton.h can be looked at. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/unit/near.h"
#include "tests/verification/bodies.h"

static const double size_mm[3] = {10, 10, 10};

/* Parts point to each other, so it must not be copied. */
static void bench_make(struct bench *b, double friction)
{
    static const struct element_material tissue = {0.005, 0.5, 0.025, 0.0005};
    const struct element_material material[TISSUE_COUNT] = {tissue, tissue, tissue};
    struct ischia_error err;
    *b = (struct bench){0};
    if (block_init(&b->mesh, size_mm, (const int[3]){3, 3, 3}, NODE_ON_BONE, &err) != ISCHIA_OK ||
        bench_init(b, material, friction, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
}

static const double (*displacement(const struct bench *b))[3]
{
    return (const double(*)[3])b->state.u_mm;
}

static struct newton_report minimise(struct bench *b, const struct newton_control *control)
{
    struct newton_report report = {0};
    struct ischia_error err;
    if (newton_minimise(b->newton, &b->state, control, NULL, NULL, &report, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    return report;
}

static void press_to(struct bench *b, double d_mm)
{
    struct ischia_error err;
    if (bench_press(b, d_mm, &err) != ISCHIA_OK) fail_msg("%s", err.message);
}

/* Out-of-balance force of the whole, from the body alone: not by newton's own book-keeping. */
static void check_equilibrium(struct bench *b, double tolerance_N)
{
    const size_t nodes = (size_t)b->mesh.node_count;
    struct body_derivatives d = {.force = calloc(nodes, sizeof *d.force),
                                 .border = calloc((size_t)b->assembly.n, sizeof *d.border)};
    assert_true(d.force != NULL && d.border != NULL);
    double bone_N = 0, seat_N = 0;
    (void)body_linearise(&b->body, &b->assembly, displacement(b), 0, &d);
    seat_add_force(&b->seat, b->seat.normal_N, displacement(b), d.force);
    for (int n = 0; n < b->mesh.node_count; n++) {
        const double gap = seat_gap_mm(&b->mesh, displacement(b), n);
        const bool may_touch = b->mesh.node_flags[n] & NODE_ON_SEAT;
        if (may_touch) assert_true(gap >= -1e-12);
        for (int c = 0; c < 3; c++) {
            const bool pressed = c == 2 && b->seat.normal_N[n] > 0;
            const double resting = pressed ? b->seat.normal_N[n] : 0;
            if (pressed) assert_near(gap, 0, 1e-12);
            if (b->assembly.equation[n][c] >= 0)
                assert_near(d.force[n][c], resting, tolerance_N);
            else if (c == 2)
                bone_N -= d.force[n][c];
        }
        seat_N += b->seat.normal_N[n];
    }
    assert_near(bone_N, b->state.force_N, tolerance_N * 100);
    assert_near(seat_N, b->state.force_N, tolerance_N * 100); /* what goes in comes out */
    free(d.force);
    free(d.border);
}

static void displacement_control_ends_in_equilibrium(void **state)
{
    (void)state;
    static const double frictions[] = {0, 0.2, 0.8};
    for (size_t i = 0; i < sizeof frictions / sizeof frictions[0]; i++) {
        struct bench b;
        bench_make(&b, frictions[i]);
        for (int step = 1; step <= 4; step++) {
            press_to(&b, 0.8 * step);
            check_equilibrium(&b, 1e-8);
            (void)bench_end_step(&b);
        }
        assert_true(b.state.d_mm == 0.8 * 4 && b.state.force_N > 0.1);
        assert_near(b.state.elastic_Nmm, body_energy(&b.body, displacement(&b)), 1e-12);
        bench_finish(&b);
    }
}

static void force_control_hits_the_force(void **state)
{
    (void)state;
    const struct newton_control control = {
        .force_controlled = true, .force_N = 0.4, .tolerance = 1e-9, .iterations_max = 100};
    struct bench b;
    bench_make(&b, 0.4);
    press_to(&b, 1);
    const struct newton_report report = minimise(&b, &control);
    assert_int_equal(report.reason, ISCHIA_CONVERGED);
    assert_true(report.residual <= 1e-9 && report.iterations > 0 && report.factorisations > 0);
    assert_near(b.state.force_N, 0.4, 0.4e-9);
    assert_true(b.state.d_mm > 1);
    check_equilibrium(&b, 1e-8);
    for (int n = 0; n < b.mesh.node_count; n++)
        if (b.mesh.node_flags[n] & NODE_ON_BONE)
            assert_near(b.state.u_mm[n][2], -b.state.d_mm, 1e-12);
    bench_finish(&b);
}

static void a_solved_state_needs_no_iteration(void **state)
{
    (void)state;
    const struct newton_control control = {.force_N = 1, .tolerance = 1e-8, .iterations_max = 0};
    struct bench b;
    bench_make(&b, 0.2);
    press_to(&b, 1);
    const struct newton_report report = minimise(&b, &control);
    assert_int_equal(report.reason, ISCHIA_CONVERGED);
    assert_int_equal(report.iterations, 0);
    bench_finish(&b);
}

static void the_iteration_limit_is_a_reason(void **state)
{
    (void)state;
    const struct newton_control control = {
        .force_controlled = true, .force_N = 0.4, .tolerance = 1e-9, .iterations_max = 1};
    struct bench b;
    bench_make(&b, 0.2);
    press_to(&b, 1);
    assert_int_equal(minimise(&b, &control).reason, ISCHIA_DIVERGED_ITERATIONS);
    bench_finish(&b);
}

/* --- the tangent ------------------------------------------------------------------------------ */

/* dF/dd and du/dd against two neighbouring equilibria, without friction. */
static void tangent_is_the_derivative_of_equilibria(void **state)
{
    (void)state;
    static const double h = 1e-4, at = 2;
    struct bench b;
    struct ischia_error err;
    bench_make(&b, 0);
    const size_t nodes = (size_t)b.mesh.node_count;
    double(*direction)[3] = calloc(nodes, sizeof *direction), (*u)[3] = calloc(nodes, sizeof *u);
    double *rate = calloc(nodes, sizeof *rate), *normal = calloc(nodes, sizeof *normal);
    assert_true(direction && u && rate && normal);
    struct newton_tangent tangent = {.direction = direction, .normal_rate_N_mm = rate};
    for (int step = 1; step <= 4; step++) press_to(&b, at * step / 4);
    newton_linearise(b.newton, &b.state);
    if (newton_tangent(b.newton, &b.state, &tangent, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    press_to(&b, at - h);
    const double below_N = b.state.force_N;
    memcpy(u, b.state.u_mm, nodes * sizeof *u);
    memcpy(normal, b.seat.normal_N, nodes * sizeof *normal);
    press_to(&b, at + h);
    assert_near(tangent.stiffness_N_mm, (b.state.force_N - below_N) / (2 * h), 1e-5);
    for (size_t n = 0; n < nodes; n++) {
        for (int c = 0; c < 3; c++)
            assert_near(direction[n][c], (b.state.u_mm[n][c] - u[n][c]) / (2 * h), 1e-4);
        assert_near(rate[n], (b.seat.normal_N[n] - normal[n]) / (2 * h), 1e-5);
    }
    free(direction);
    free(u);
    free(rate);
    free(normal);
    bench_finish(&b);
}

/* How far the tangent of the last step is from a fresh one, at 2 mm: of the stiffness, relative,
 * and of the direction at the most. */
struct staleness {
    double stiffness, direction;
};

static struct staleness staleness_after_steps_of(double step_mm)
{
    struct bench b;
    struct ischia_error err;
    bench_make(&b, 0.3);
    const size_t nodes = (size_t)b.mesh.node_count;
    double(*last)[3] = calloc(nodes, sizeof *last), (*anew)[3] = calloc(nodes, sizeof *anew);
    double *rate = calloc(nodes, sizeof *rate);
    assert_true(last && anew && rate);
    struct newton_tangent of_last = {.direction = last, .normal_rate_N_mm = rate};
    struct newton_tangent fresh = {.direction = anew, .normal_rate_N_mm = rate};
    for (int step = 1; step * step_mm <= 2; step++) press_to(&b, step_mm * step);
    if (newton_tangent(b.newton, &b.state, &of_last, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    newton_linearise(b.newton, &b.state);
    if (newton_tangent(b.newton, &b.state, &fresh, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    assert_true(of_last.stiffness_N_mm > 0);
    struct staleness s = {.stiffness = fabs(of_last.stiffness_N_mm / fresh.stiffness_N_mm - 1)};
    for (size_t n = 0; n < nodes; n++)
        for (int c = 0; c < 3; c++) s.direction = fmax(s.direction, fabs(last[n][c] - anew[n][c]));
    free(last);
    free(anew);
    free(rate);
    bench_finish(&b);
    return s;
}

/* After a minimisation the tangent costs no factorisation and is that of its last step: off by what
 * is of the order of the step. */
static void tangent_of_the_last_step_is_near(void **state)
{
    (void)state;
    struct staleness before = staleness_after_steps_of(0.25);
    for (double step_mm = 0.125; step_mm > 0.05; step_mm /= 2) {
        const struct staleness now = staleness_after_steps_of(step_mm);
        assert_true(now.stiffness > 0 && now.stiffness < 0.6 * before.stiffness);
        assert_true(now.direction > 0 && now.direction < 0.6 * before.direction);
        before = now;
    }
    assert_true(before.stiffness < 0.01 && before.direction < 0.02);
}

/* The last steps to a tight tolerance are made with the factor of the step before. */
static void the_end_needs_no_factorisations(void **state)
{
    (void)state;
    const struct newton_control control = {
        .force_controlled = true, .force_N = 0.4, .tolerance = 1e-11, .iterations_max = 100};
    struct bench b;
    bench_make(&b, 0.4);
    press_to(&b, 1);
    const struct newton_report report = minimise(&b, &control);
    assert_int_equal(report.reason, ISCHIA_CONVERGED);
    assert_in_range(report.factorisations, 1, report.iterations - 1);
    check_equilibrium(&b, 1e-10);
    bench_finish(&b);
}

/* --- the observer ----------------------------------------------------------------------------- */

struct watcher {
    int calls, cancel_at;
    int last_iteration;
};

static bool watch(void *context, const struct newton_report *report, double force_N)
{
    struct watcher *w = context;
    assert_true(isfinite(force_N) && isfinite(report->residual));
    assert_int_equal(report->iterations, w->calls); /* one call for each, from 0 */
    w->last_iteration = report->iterations;
    return w->calls++ != w->cancel_at;
}

static void observer_sees_every_iteration_and_cancels(void **state)
{
    (void)state;
    const struct newton_control control = {
        .force_controlled = true, .force_N = 0.4, .tolerance = 1e-9, .iterations_max = 100};
    for (int cancel_at = -1; cancel_at < 3; cancel_at++) {
        struct bench b;
        struct watcher w = {.cancel_at = cancel_at};
        struct ischia_error err = {0};
        struct newton_report report = {.iterations = -7};
        bench_make(&b, 0.2);
        press_to(&b, 1);
        const enum ischia_code code =
            newton_minimise(b.newton, &b.state, &control, watch, &w, &report, &err);
        if (cancel_at < 0) {
            assert_int_equal(code, ISCHIA_OK);
            assert_int_equal(report.iterations, w.last_iteration);
        } else {
            assert_int_equal(code, ISCHIA_E_CANCELLED);
            assert_int_equal(err.code, ISCHIA_E_CANCELLED);
            assert_int_equal(w.calls, cancel_at + 1);
            assert_int_equal(report.iterations, -7); /* untouched */
        }
        bench_finish(&b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(displacement_control_ends_in_equilibrium),
        cmocka_unit_test(force_control_hits_the_force),
        cmocka_unit_test(a_solved_state_needs_no_iteration),
        cmocka_unit_test(the_iteration_limit_is_a_reason),
        cmocka_unit_test(tangent_is_the_derivative_of_equilibria),
        cmocka_unit_test(tangent_of_the_last_step_is_near),
        cmocka_unit_test(the_end_needs_no_factorisations),
        cmocka_unit_test(observer_sees_every_iteration_and_cancels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
