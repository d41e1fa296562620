/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Slow motion where nothing snaps must end where a load step ends, with its drag accounted for.
 * What it does in a snap: tests/verification/test_snap.c. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/snap.h"
#include "tests/unit/near.h"
#include "tests/verification/bodies.h"

/* A bonded block that was pressed by 1 mm, without friction, so that its way does not count. Parts
 * point to each other, so it must not be copied. */
struct pressed {
    struct bench b;
    struct track track;
    struct snap *snap;
};

/* The linker sends the calls of calloc through here. */
static int allocations_left = -1; /* < 0: as many as are wanted */

void *__real_calloc(size_t count, size_t size);
void *__wrap_calloc(size_t count, size_t size);

void *__wrap_calloc(size_t count, size_t size)
{
    if (allocations_left == 0) return NULL;
    if (allocations_left > 0) allocations_left--;
    return __real_calloc(count, size);
}

static void must(enum ischia_code code, const struct ischia_error *err)
{
    if (code != ISCHIA_OK) fail_msg("%s", err->message);
}

static void pressed_make(struct pressed *p)
{
    static const double size_mm[3] = {10, 10, 10};
    const struct element_material tissue = {0.005, 0.5, 0.025, 0.0005};
    const struct element_material material[TISSUE_COUNT] = {tissue, tissue, tissue};
    const struct newton_control control = {.force_N = 1, .tolerance = 1e-6, .iterations_max = 100};
    struct newton_report report;
    struct track_point now;
    struct ischia_error err;
    *p = (struct pressed){0};
    must(block_init(&p->b.mesh, size_mm, (const int[3]){3, 3, 3}, NODE_ON_BONE, &err), &err);
    must(bench_init(&p->b, material, 0, &err), &err);
    p->b.mesh.tip_z_mm = size_mm[2];
    must(track_init(&p->track, &p->b.body, &p->b.assembly, &p->b.seat, &p->b.state, &err), &err);
    must(snap_create(&p->snap, &p->track, &err), &err);
    must(track_start(&p->track, &err), &err);
    track_predict(&p->track, 1);
    must(newton_minimise(p->track.newton, &p->b.state, &control, NULL, NULL, &report, &err), &err);
    assert_int_equal(report.reason, ISCHIA_CONVERGED);
    must(track_weigh(&p->track, 0, &now, &err), &err);
    track_book(&p->track, &now);
}

static void pressed_finish(struct pressed *p)
{
    snap_destroy(p->snap);
    track_finish(&p->track);
    bench_finish(&p->b);
}

static void press_on(struct pressed *p, double dd_mm)
{
    const struct newton_control control = {.force_N = 1, .tolerance = 1e-8, .iterations_max = 100};
    struct newton_report report;
    struct track_point now;
    struct ischia_error err;
    track_predict(&p->track, dd_mm);
    must(newton_minimise(p->track.newton, &p->b.state, &control, NULL, NULL, &report, &err), &err);
    assert_int_equal(report.reason, ISCHIA_CONVERGED);
    must(track_weigh(&p->track, 0, &now, &err), &err);
    track_book(&p->track, &now);
}

static void slow_motion_ends_where_a_load_step_ends(void **state)
{
    (void)state;
    struct pressed slow, fast;
    struct snap_report report;
    struct ischia_error err;
    pressed_make(&slow);
    pressed_make(&fast);
    const struct track_point from = slow.track.last.at;
    must(snap_follow(slow.snap, &slow.track, 0.05, 500, NULL, NULL, &report, &err), &err);
    press_on(&fast, 0.05);
    assert_true(report.arrived);
    assert_true(report.newton_iterations > 0 && report.factorisations > 0);
    assert_near(slow.track.last.at.d_mm, 1.05, 1e-12);
    /* Residuals on the way are a thousandth of a force that is up to 20 times the present one. */
    assert_near(slow.track.last.at.force_N / fast.track.last.at.force_N, 1, 2e-2);
    assert_true(slow.track.last.at.stiffness_N_mm > 0);
    const double work = slow.track.last.at.work_Nmm - from.work_Nmm;
    const double drag = slow.track.last.at.drag_Nmm - from.drag_Nmm;
    assert_true(drag > 0);
    /* The bone pushes against drag, so it does more work than without, and by as much. */
    assert_near((work - drag) / (fast.track.last.at.work_Nmm - from.work_Nmm), 1, 2e-2);
    assert_true(fabs(track_lost_Nmm(&from, &slow.track.last.at)) < 0.02 * work);
    assert_true(fabs(track_lost_Nmm(&from, &slow.track.last.at)) < 0.1 * drag);
    pressed_finish(&slow);
    pressed_finish(&fast);
}

/* A move through the elements below is halved until it is none. */
static void a_move_that_is_too_long_is_shortened(void **state)
{
    (void)state;
    struct pressed p;
    struct snap_report report;
    struct ischia_error err;
    pressed_make(&p);
    must(snap_follow(p.snap, &p.track, 30, 2000, NULL, NULL, &report, &err), &err);
    if (report.arrived) assert_true(p.track.last.at.d_mm > 1 && p.track.last.at.d_mm < 10);
    assert_true(body_det_F_min(&p.b.body, (const double(*)[3])p.track.last.u_mm) > 0);
    pressed_finish(&p);
}

static void a_budget_is_kept(void **state)
{
    (void)state;
    struct pressed p;
    struct snap_report report;
    struct ischia_error err;
    pressed_make(&p);
    must(snap_follow(p.snap, &p.track, 0.05, 1, NULL, NULL, &report, &err), &err);
    assert_false(report.arrived);
    assert_in_range(report.factorisations, 1, 30);
    pressed_finish(&p);
}

static bool stop(void *context, const struct newton_report *report, double force_N)
{
    (void)report;
    assert_true(isfinite(force_N));
    return ++*(int *)context < 3;
}

static void it_can_be_cancelled(void **state)
{
    (void)state;
    struct pressed p;
    struct snap_report report;
    struct ischia_error err;
    int calls = 0;
    pressed_make(&p);
    assert_int_equal(snap_follow(p.snap, &p.track, 0.05, 500, stop, &calls, &report, &err),
                     ISCHIA_E_CANCELLED);
    assert_int_equal(calls, 3);
    pressed_finish(&p);
}

/* The last step is without drag, by the body's own derivatives. */
static void the_end_is_an_equilibrium_of_the_model(void **state)
{
    (void)state;
    struct pressed p;
    struct snap_report report;
    struct ischia_error err;
    pressed_make(&p);
    must(snap_follow(p.snap, &p.track, 0.05, 500, NULL, NULL, &report, &err), &err);
    assert_true(report.arrived);
    const size_t nodes = (size_t)p.b.mesh.node_count;
    struct body_derivatives d = {.force = calloc(nodes, sizeof *d.force),
                                 .border = calloc((size_t)p.b.assembly.n, sizeof *d.border)};
    assert_true(d.force != NULL && d.border != NULL);
    const double(*u)[3] = (const double(*)[3])p.track.last.u_mm;
    double sum = 0;
    (void)body_linearise(&p.b.body, &p.b.assembly, u, 0, &d);
    for (size_t n = 0; n < nodes; n++) /* inside, where neither seat nor bone acts */
        for (int c = 0; c < 3; c++)
            if (p.b.assembly.equation[n][c] >= 0 && !(p.b.mesh.node_flags[n] & NODE_ON_SEAT))
                sum += d.force[n][c] * d.force[n][c];
    assert_true(sqrt(sum) <= 1e-3 * track_force_scale_N(p.track.last.at.force_N));
    free(d.force);
    free(d.border);
    pressed_finish(&p);
}

static void every_failed_allocation_is_reported(void **state)
{
    (void)state;
    struct pressed p;
    struct ischia_error err;
    pressed_make(&p);
    for (int n = 0; n < 5; n++) {
        struct snap *none = NULL;
        allocations_left = n;
        assert_int_equal(snap_create(&none, &p.track, &err), ISCHIA_E_MEMORY);
        allocations_left = -1;
        assert_null(none);
        assert_non_null(strstr(err.message, "memory"));
    }
    pressed_finish(&p);
}

static void drag_is_by_shear_modulus_and_volume(void **state)
{
    (void)state;
    struct pressed p;
    double sum = 0;
    pressed_make(&p);
    double *shear_Nmm = calloc((size_t)p.b.mesh.node_count, sizeof *shear_Nmm);
    assert_non_null(shear_Nmm);
    body_shear_of_nodes(&p.b.body, shear_Nmm);
    for (int n = 0; n < p.b.mesh.node_count; n++) sum += shear_Nmm[n];
    assert_near(sum, 0.005 * 1000, 1e-9); /* 5 kPa on a cube of 10 mm */
    free(shear_Nmm);
    pressed_finish(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slow_motion_ends_where_a_load_step_ends),
        cmocka_unit_test(a_move_that_is_too_long_is_shortened),
        cmocka_unit_test(a_budget_is_kept),
        cmocka_unit_test(it_can_be_cancelled),
        cmocka_unit_test(the_end_is_an_equilibrium_of_the_model),
        cmocka_unit_test(every_failed_allocation_is_reported),
        cmocka_unit_test(drag_is_by_shear_modulus_and_volume),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
