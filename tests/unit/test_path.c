/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/path.h"
#include "solver/track.h"
#include "tests/unit/near.h"
#include "tests/verification/bodies.h"

static const double size_mm[3] = {10, 10, 10};

/* Parts point to each other, so it must not be copied. */
static void bench_make(struct bench *b)
{
    static const struct element_material tissue = {0.005, 0.5, 0.025, 0.0005};
    const struct element_material material[TISSUE_COUNT] = {tissue, tissue, tissue};
    struct ischia_error err;
    *b = (struct bench){0};
    if (block_init(&b->mesh, size_mm, (const int[3]){3, 3, 3}, NODE_ON_BONE, &err) != ISCHIA_OK ||
        bench_init(b, material, 0.3, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    b->mesh.tip_z_mm = size_mm[2];
}

/* What the observer is told, and when it is to stop. */
struct log {
    int steps, iterations, load_step;
    double d_mm, force_N;
    int cancel_at_iteration, fail_at_step; /* < 0: never */
};

static bool on_iteration(void *context, int load_step, int newton_iteration, double force_N)
{
    struct log *l = context;
    assert_true(isfinite(force_N) && newton_iteration >= 0);
    assert_true(load_step == l->steps + 1 && load_step >= l->load_step);
    l->load_step = load_step;
    return l->iterations++ != l->cancel_at_iteration;
}

static enum ischia_code on_step(void *context, const struct equilibrium *state,
                                struct ischia_error *err)
{
    struct log *l = context;
    CHECK(l->steps != l->fail_at_step, err, ISCHIA_E_IO, "the log is full");
    assert_true(state->d_mm > l->d_mm && state->force_N > 0);
    l->d_mm = state->d_mm;
    l->force_N = state->force_N;
    l->steps++;
    return ISCHIA_OK;
}

static const struct path_effort usual_effort = {.pace = 1, .factorisations_max = 1000};
static const struct path_effort slow_effort = {.pace = 0.5, .factorisations_max = 1000};

static enum ischia_code follow(struct bench *b, double force_N, struct log *log,
                               struct path_report *ret_report, struct ischia_error *err)
{
    const struct path_observer observer = {
        .on_iteration = on_iteration, .on_step = on_step, .context = log};
    return path_follow(&b->body, &b->assembly, &b->seat, force_N, &usual_effort,
                       log != NULL ? &observer : NULL, &b->state, ret_report, err);
}

static void path_ends_at_the_force(void **state)
{
    (void)state;
    static const double forces[] = {0.3, 1, 3};
    for (size_t i = 0; i < sizeof forces / sizeof forces[0]; i++) {
        struct bench b;
        struct log log = {.cancel_at_iteration = -1, .fail_at_step = -1};
        struct path_report report;
        struct ischia_error err = {.message = "as it was"};
        bench_make(&b);
        if (follow(&b, forces[i], &log, &report, &err) != ISCHIA_OK) fail_msg("%s", err.message);
        assert_string_equal(err.message, "as it was");
        assert_int_equal(report.reason, ISCHIA_CONVERGED);
        assert_near(b.state.force_N / forces[i], 1, 1e-8);
        assert_near(report.last_force_N / forces[i], 1, 1e-8);
        assert_true(report.force_residual <= 1e-8);
        assert_true(fabs(report.energy_residual) < 0.01);
        assert_true(log.steps == report.load_steps && report.load_steps >= 1);
        assert_true(log.force_N == b.state.force_N && log.d_mm == b.state.d_mm);
        assert_true(report.newton_iterations > 0 && report.factorisations > 0);
        bench_finish(&b);
    }
}

static void watching_changes_nothing(void **state)
{
    (void)state;
    struct bench a, b;
    struct log log = {.cancel_at_iteration = -1, .fail_at_step = -1};
    struct path_report seen, unseen;
    bench_make(&a);
    bench_make(&b);
    assert_int_equal(follow(&a, 0.5, &log, &seen, NULL), ISCHIA_OK);
    assert_int_equal(follow(&b, 0.5, NULL, &unseen, NULL), ISCHIA_OK);
    assert_memory_equal(a.state.u_mm, b.state.u_mm,
                        (size_t)a.mesh.node_count * sizeof *a.state.u_mm);
    assert_true(seen.energy_residual == unseen.energy_residual);
    bench_finish(&a);
    bench_finish(&b);
}

/* Half the pace: more steps to the same end. */
static void a_slower_pace_takes_more_steps(void **state)
{
    (void)state;
    struct bench a, b;
    struct path_report usual, slow;
    bench_make(&a);
    bench_make(&b);
    assert_int_equal(
        path_follow(&a.body, &a.assembly, &a.seat, 3, &usual_effort, NULL, &a.state, &usual, NULL),
        ISCHIA_OK);
    assert_int_equal(
        path_follow(&b.body, &b.assembly, &b.seat, 3, &slow_effort, NULL, &b.state, &slow, NULL),
        ISCHIA_OK);
    assert_int_equal(slow.reason, ISCHIA_CONVERGED);
    assert_true(slow.load_steps > usual.load_steps);
    assert_near(b.state.d_mm / a.state.d_mm, 1, 1e-3);
    bench_finish(&a);
    bench_finish(&b);
}

/* Pressed with more and more: the bits of a path from rest to each, and its report. */
static void a_path_goes_on_to_larger_forces(void **state)
{
    (void)state;
    static const double force_N[] = {0.5, 0.5, 1, 3};
    struct bench a;
    struct path *path;
    bench_make(&a);
    assert_int_equal(
        path_create(&path, &a.body, &a.assembly, &a.seat, &usual_effort, &a.state, NULL),
        ISCHIA_OK);
    for (size_t i = 0; i < sizeof force_N / sizeof force_N[0]; i++) {
        struct bench b;
        struct path_report on, fresh;
        bench_make(&b);
        assert_true(path_serves(path, force_N[i]));
        assert_int_equal(path_press(path, force_N[i], NULL, &on, NULL), ISCHIA_OK);
        assert_int_equal(follow(&b, force_N[i], NULL, &fresh, NULL), ISCHIA_OK);
        assert_int_equal(on.reason, ISCHIA_CONVERGED);
        assert_memory_equal(a.state.u_mm, b.state.u_mm,
                            (size_t)a.mesh.node_count * sizeof *a.state.u_mm);
        assert_true(on.energy_residual == fresh.energy_residual);
        assert_true(on.last_force_N == fresh.last_force_N);
        assert_int_equal(on.load_steps, fresh.load_steps);
        assert_int_equal(on.factorisations, fresh.factorisations);
        bench_finish(&b);
    }
    assert_false(path_serves(path, 1)); /* it has gone by */
    path_destroy(path);
    bench_finish(&a);
}

static void fill(struct track *t, double with)
{
    struct track_step *s = &t->last;
    for (int n = 0; n < t->nodes; n++) {
        s->normal_N[n] = s->tangent.normal_rate_N_mm[n] = s->ahead.normal_rate_N_mm[n] = with + n;
        for (int c = 0; c < 3; c++) {
            s->u_mm[n][c] = 1e-3 * sin(with + n + c); /* a body that can be: it is linearised */
            s->tangent.direction[n][c] = s->ahead.direction[n][c] = with * (c - 1) + n;
        }
        for (int c = 0; c < 2; c++) s->anchor_mm[n][c] = with - n - c;
    }
    s->at = (struct track_point){with, 2 * with, 3, 4, 5, 6, 7};
    s->tangent.stiffness_N_mm = 8 * with;
    s->ahead.stiffness_N_mm = 9 * with;
}

static void assert_same_numbers(const void *a, const void *b, size_t per_node,
                                const struct track *t)
{
    assert_memory_equal(a, b, per_node * sizeof(double) * (size_t)t->nodes);
}

/* All that the next step goes on with: the buffer of a tangent that may not be found, too. */
static void a_memory_holds_the_whole_step(void **state)
{
    (void)state;
    struct bench a, b;
    struct track one, other;
    struct track_step memory;
    const struct track_step *last = &one.last, *expected = &other.last;
    bench_make(&a);
    bench_make(&b);
    assert_int_equal(track_init(&one, &a.body, &a.assembly, &a.seat, &a.state, NULL), ISCHIA_OK);
    assert_int_equal(track_init(&other, &b.body, &b.assembly, &b.seat, &b.state, NULL), ISCHIA_OK);
    assert_int_equal(track_step_init(&memory, one.nodes, NULL), ISCHIA_OK);
    fill(&one, 0.25);
    fill(&other, 0.25);
    track_remember(&one, &memory);
    fill(&one, 0.5);
    track_recall(&one, &memory);
    assert_memory_equal(&last->at, &expected->at, sizeof last->at);
    assert_same_numbers(last->u_mm, expected->u_mm, 3, &one);
    assert_same_numbers(one.state->u_mm, expected->u_mm, 3, &one);
    assert_same_numbers(last->normal_N, expected->normal_N, 1, &one);
    assert_same_numbers(last->anchor_mm, expected->anchor_mm, 2, &one);
    assert_same_numbers(last->tangent.direction, expected->tangent.direction, 3, &one);
    assert_same_numbers(last->tangent.normal_rate_N_mm, expected->tangent.normal_rate_N_mm, 1,
                        &one);
    assert_same_numbers(last->ahead.direction, expected->ahead.direction, 3, &one);
    assert_same_numbers(last->ahead.normal_rate_N_mm, expected->ahead.normal_rate_N_mm, 1, &one);
    assert_true(last->tangent.stiffness_N_mm == expected->tangent.stiffness_N_mm);
    assert_true(last->ahead.stiffness_N_mm == expected->ahead.stiffness_N_mm);
    track_step_finish(&memory);
    track_finish(&one);
    track_finish(&other);
    bench_finish(&a);
    bench_finish(&b);
}

/* A path that ends before it leaves for its force ends there with a larger one, without work. */
static void a_path_that_ended_stays_there(void **state)
{
    (void)state;
    const struct path_effort little = {.pace = 1, .factorisations_max = 6};
    struct log log = {.cancel_at_iteration = 0, .fail_at_step = 0}; /* any call would be an error */
    const struct path_observer observer = {
        .on_iteration = on_iteration, .on_step = on_step, .context = &log};
    struct path_report first, larger;
    struct bench b;
    struct path *path;
    bench_make(&b);
    assert_int_equal(path_create(&path, &b.body, &b.assembly, &b.seat, &little, &b.state, NULL),
                     ISCHIA_OK);
    assert_int_equal(path_press(path, 3, NULL, &first, NULL), ISCHIA_OK);
    assert_true(first.reason < 0 && first.last_force_N > 0);
    assert_int_equal(path_press(path, 4, &observer, &larger, NULL), ISCHIA_OK);
    assert_int_equal(log.iterations + log.steps, 0);
    assert_int_equal(larger.reason, first.reason);
    assert_int_equal(larger.factorisations, first.factorisations);
    assert_true(larger.last_force_N == first.last_force_N);
    assert_true(larger.energy_residual == first.energy_residual);
    path_destroy(path);
    bench_finish(&b);
}

/* A path that takes more factorisations than it may ends short, and says so. */
static void a_path_ends_at_its_limit_of_work(void **state)
{
    (void)state;
    const struct path_effort little = {.pace = 1, .factorisations_max = 6};
    struct bench b;
    struct path_report report;
    bench_make(&b);
    assert_int_equal(
        path_follow(&b.body, &b.assembly, &b.seat, 3, &little, NULL, &b.state, &report, NULL),
        ISCHIA_OK);
    assert_true(report.reason < 0);
    assert_true(report.factorisations >= 6 && report.last_force_N > 0 && report.last_force_N < 3);
    bench_finish(&b);
}

static void observers_end_the_path(void **state)
{
    (void)state;
    static const struct {
        int iteration, step;
        enum ischia_code code;
    } ends[] = {{0, -1, ISCHIA_E_CANCELLED}, {5, -1, ISCHIA_E_CANCELLED}, {-1, 2, ISCHIA_E_IO}};
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        struct bench b;
        struct log log = {.cancel_at_iteration = ends[i].iteration, .fail_at_step = ends[i].step};
        struct path_report report = {.load_steps = -7};
        struct ischia_error err = {0};
        bench_make(&b);
        assert_int_equal(follow(&b, 0.5, &log, &report, &err), ends[i].code);
        assert_int_equal(err.code, ends[i].code);
        assert_int_equal(report.load_steps, -7); /* untouched */
        if (ends[i].iteration >= 0) assert_int_equal(log.iterations, ends[i].iteration + 1);
        bench_finish(&b);
    }
}

/* A force that flattens the block beyond what its elements can follow: a reason, not an error, and
 * the state is the last that converged. */
static void what_cannot_be_reached_has_a_reason(void **state)
{
    (void)state;
    struct bench b;
    struct log log = {.cancel_at_iteration = -1, .fail_at_step = -1};
    struct path_report report;
    struct ischia_error err;
    bench_make(&b);
    if (follow(&b, 1e30, &log, &report, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    assert_true(report.reason < 0);
    assert_true(strlen(report.tried) > 10);
    assert_true(report.last_force_N > 0 && report.last_force_N < 1e30);
    assert_near(b.state.d_mm, log.d_mm, 0);
    assert_true(b.state.force_N == log.force_N && report.last_force_N >= log.force_N);
    assert_true(body_det_F_min(&b.body, (const double(*)[3])b.state.u_mm) > 0);
    bench_finish(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(path_ends_at_the_force),
        cmocka_unit_test(watching_changes_nothing),
        cmocka_unit_test(a_slower_pace_takes_more_steps),
        cmocka_unit_test(a_path_goes_on_to_larger_forces),
        cmocka_unit_test(a_memory_holds_the_whole_step),
        cmocka_unit_test(a_path_that_ended_stays_there),
        cmocka_unit_test(a_path_ends_at_its_limit_of_work),
        cmocka_unit_test(observers_end_the_path),
        cmocka_unit_test(what_cannot_be_reached_has_a_reason),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
