/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/mesh.h"
#include "solver/solver.h"
#include "tests/unit/near.h"
#include "tests/unit/solving.h"

static void result_is_whole(void **state)
{
    (void)state;
    struct ischia_solver *solver = solver_make();
    const struct ischia_case c = coarse_case(0);
    struct ischia_field field;
    const struct ischia_result r = solve(solver, &c, &field);
    assert_true(ischia_result_converged(&r) && ischia_result_is_valid(&r));
    assert_int_equal(field.node_count, mesh_local_node_count(&mesh_divisions[ISCHIA_COARSE]));
    assert_near(r.numerics.last_converged_F_N, 196, 196e-8);
    assert_true(r.numerics.force_residual <= 1e-8 && r.numerics.det_F_min > 0);
    assert_true(r.numerics.wall_s == 0 && r.numerics.cpu_s == 0); /* the solver has no clock */
    assert_string_equal(r.numerics.detail, "");
    assert_in_range(r.load_curve_count, 3, ISCHIA_LOAD_POINTS_MAX);
    for (int i = 1; i < r.load_curve_count; i++) {
        assert_true(r.load_curve[i].F_N > r.load_curve[i - 1].F_N);
        assert_true(r.load_curve[i].displacement_mm > r.load_curve[i - 1].displacement_mm);
    }
    const struct ischia_load_point *end = &r.load_curve[r.load_curve_count - 1];
    assert_near(end->F_N, 196, 196e-8);
    assert_true(end->eps_max == r.strain.eps_max);
    assert_true(end->E_shear_max == r.strain.E_shear_max);
    assert_true(end->displacement_mm == r.seat.displacement_mm);
    /* Pressure times area is the force: kPa mm2 = 1e-3 N. */
    assert_near(r.seat.mean_pressure_kPa * r.seat.contact_area_mm2 * 1e-3, 196, 196e-7);
    assert_true(r.threshold_force_shear_N > 0 && r.threshold_force_shear_N < 196);
    ischia_field_finish(&field);
    ischia_solver_destroy(solver);
}

/* The field belongs to the mesh of the case: bone down by the displacement, nothing below the seat,
 * symmetry planes in place. */
static void field_fits_the_mesh(void **state)
{
    (void)state;
    struct ischia_solver *solver = solver_make();
    const struct ischia_case c = coarse_case(0);
    struct ischia_field field;
    struct mesh mesh;
    const struct ischia_result r = solve(solver, &c, &field);
    assert_int_equal(mesh_local_init(&mesh, &c, &mesh_divisions[ISCHIA_COARSE], NULL), ISCHIA_OK);
    assert_int_equal(field.node_count, mesh.node_count);
    for (int n = 0; n < mesh.node_count; n++) {
        const double *u = field.displacement_mm + 3 * n;
        const unsigned flags = mesh.node_flags[n];
        if (flags & NODE_ON_X0) assert_true(u[0] == 0);
        if (flags & NODE_ON_Y0) assert_true(u[1] == 0);
        if (flags & NODE_ON_SEAT) assert_true(mesh.X_mm[n][2] + u[2] >= -1e-12);
        if (flags & NODE_ON_BONE) {
            assert_true(u[0] == 0 && u[1] == 0);
            assert_near(u[2], -r.seat.displacement_mm, 1e-12);
        }
    }
    mesh_finish(&mesh);
    ischia_field_finish(&field);
    ischia_field_finish(&field);
    ischia_field_finish(NULL);
    ischia_solver_destroy(solver);
}

static void same_case_same_bits(void **state)
{
    (void)state;
    struct ischia_solver *solver = solver_make(), *fresh = solver_make();
    const struct ischia_case c = coarse_case(0), other = coarse_case(2);
    struct ischia_field first, again, elsewhere;
    const struct ischia_result a = solve(solver, &c, &first);
    const struct ischia_result between = solve(solver, &other, NULL);
    const struct ischia_result b = solve(solver, &c, &again);
    const struct ischia_result d = solve(fresh, &c, &elsewhere);
    const size_t bytes = 3 * first.node_count * sizeof *first.displacement_mm;
    assert_true(between.strain.eps_max != a.strain.eps_max);
    assert_true(b.strain.eps_max == a.strain.eps_max && d.strain.eps_max == a.strain.eps_max);
    assert_int_equal(b.numerics.newton_iterations, a.numerics.newton_iterations);
    assert_memory_equal(again.displacement_mm, first.displacement_mm, bytes);
    assert_memory_equal(elsewhere.displacement_mm, first.displacement_mm, bytes);
    assert_memory_equal(b.load_curve, a.load_curve,
                        (size_t)a.load_curve_count * sizeof a.load_curve[0]);
    ischia_field_finish(&first);
    ischia_field_finish(&again);
    ischia_field_finish(&elsewhere);
    ischia_solver_destroy(solver);
    ischia_solver_destroy(fresh);
    ischia_solver_destroy(NULL);
}

/* --- observers -------------------------------------------------------------------------------- */

/* Whatever was solved before: from rest, or on from a smaller force of the same side. */
static void a_larger_force_goes_on_with_the_same_bits(void **state)
{
    (void)state;
    static const double share[] = {0.4, 0.4, 0.8, 1, 0.6}; /* the last is smaller: from rest */
    struct ischia_solver *solver = solver_make();
    for (int variant = 0; variant < 2; variant++)
        for (size_t i = 0; i < sizeof share / sizeof share[0]; i++) {
            struct ischia_solver *fresh = solver_make();
            struct ischia_case c = coarse_case(variant);
            c.param[ISCHIA_F] *= share[i];
            struct ischia_field field, cold_field;
            const struct ischia_result r = solve(solver, &c, &field);
            const struct ischia_result cold = solve(fresh, &c, &cold_field);
            same_bits(&r, &cold);
            assert_memory_equal(field.displacement_mm, cold_field.displacement_mm,
                                3 * sizeof(double) * field.node_count);
            ischia_field_finish(&field);
            ischia_field_finish(&cold_field);
            ischia_solver_destroy(fresh);
        }
    ischia_solver_destroy(solver);
}

struct watcher {
    int calls, cancel_at; /* < 0: never */
    struct ischia_progress last;
};

static bool watch(void *context, const struct ischia_progress *p)
{
    struct watcher *w = context;
    assert_true(p->fraction >= w->last.fraction && p->fraction >= 0 && p->fraction <= 1);
    assert_true(p->load_step >= w->last.load_step && p->load_step >= 1);
    assert_true(isfinite(p->F_N) && p->message != NULL && strlen(p->message) > 5);
    w->last = *p;
    return w->calls++ != w->cancel_at;
}

static int calls_for(struct ischia_solver *solver, const struct ischia_case *c)
{
    struct watcher w = {.cancel_at = -1};
    const struct ischia_observer observer = {watch, &w};
    struct ischia_result r;
    assert_int_equal(ischia_solve(solver, c, &observer, &r, NULL, NULL), ISCHIA_OK);
    return w.calls;
}

static void going_on_is_less_work_until_forgotten(void **state)
{
    (void)state;
    struct ischia_solver *solver = solver_make();
    struct ischia_case c = coarse_case(0);
    const int from_rest = calls_for(solver, &c);
    c.param[ISCHIA_F] *= 0.9;
    ischia_solver_forget(solver);
    assert_true(calls_for(solver, &c) > from_rest / 2);
    c = coarse_case(0);
    assert_true(calls_for(solver, &c) < from_rest / 2);
    ischia_solver_forget(solver);
    assert_int_equal(calls_for(solver, &c), from_rest);
    ischia_solver_destroy(solver);
}

static void progress_never_goes_back(void **state)
{
    (void)state;
    struct ischia_solver *solver = solver_make();
    for (int variant = 0; variant < 3; variant++) {
        const struct ischia_case c = coarse_case(variant);
        struct watcher w = {.cancel_at = -1};
        const struct ischia_observer observer = {watch, &w};
        struct ischia_result r;
        assert_int_equal(ischia_solve(solver, &c, &observer, &r, NULL, NULL), ISCHIA_OK);
        assert_true(w.calls > r.numerics.load_steps);
        assert_true(w.last.fraction > 0.9);
        assert_near(w.last.F_N, c.param[ISCHIA_F], 1e-6 * c.param[ISCHIA_F]);
    }
    ischia_solver_destroy(solver);
}

/* Cancelled anywhere: outputs untouched, and the solver gives the same bits afterwards. */
static void cancelling_leaves_no_trace(void **state)
{
    (void)state;
    static const int cancel_at[] = {0, 1, 7, 25};
    struct ischia_solver *solver = solver_make();
    const struct ischia_case c = coarse_case(0);
    const struct ischia_result before = solve(solver, &c, NULL);
    for (size_t i = 0; i < sizeof cancel_at / sizeof cancel_at[0]; i++) {
        struct watcher w = {.cancel_at = cancel_at[i]};
        const struct ischia_observer observer = {watch, &w};
        struct ischia_result r = {.load_curve_count = -7};
        struct ischia_field field = {.node_count = 77};
        struct ischia_error err = {0};
        assert_int_equal(ischia_solve(solver, &c, &observer, &r, &field, &err), ISCHIA_E_CANCELLED);
        assert_int_equal(err.code, ISCHIA_E_CANCELLED);
        assert_int_equal(w.calls, cancel_at[i] + 1);
        assert_int_equal(r.load_curve_count, -7);
        assert_int_equal(field.node_count, 77);
    }
    const struct ischia_result after = solve(solver, &c, NULL);
    assert_true(after.strain.eps_max == before.strain.eps_max);
    assert_int_equal(after.numerics.newton_iterations, before.numerics.newton_iterations);
    ischia_solver_destroy(solver);
}

static void hand_written_derivatives_agree(void **state)
{
    (void)state;
    char *text = NULL;
    size_t size = 0;
    struct ischia_error err;
    FILE *out = open_memstream(&text, &size);
    assert_non_null(out);
    const enum ischia_code code = ischia_check_tangents(out, &err);
    assert_int_equal(fclose(out), 0);
    assert_int_equal(code, ISCHIA_OK);
    assert_null(strstr(text, "DISAGREES"));
    assert_non_null(strstr(text, "agrees"));
    free(text);
}

static void a_report_that_cannot_be_written_is_an_error(void **state)
{
    (void)state;
    struct ischia_error err;
    FILE *out = fopen("/dev/full", "w");
    assert_non_null(out);
    (void)setvbuf(out, NULL, _IONBF, 0);
    assert_int_equal(ischia_check_tangents(out, &err), ISCHIA_E_IO);
    (void)fclose(out);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(result_is_whole),
        cmocka_unit_test(field_fits_the_mesh),
        cmocka_unit_test(same_case_same_bits),
        cmocka_unit_test(a_larger_force_goes_on_with_the_same_bits),
        cmocka_unit_test(going_on_is_less_work_until_forgotten),
        cmocka_unit_test(progress_never_goes_back),
        cmocka_unit_test(cancelling_leaves_no_trace),
        cmocka_unit_test(hand_written_derivatives_agree),
        cmocka_unit_test(a_report_that_cannot_be_written_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
