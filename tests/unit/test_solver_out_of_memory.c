/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A solve with its 1st, 2nd, ... allocation failing: those of the mechanics, of CHOLMOD and METIS
 * alike. Each run ends with ISCHIA_E_MEMORY, leaves its outputs alone and leaks nothing. The
 * allocations before the load path are failed one by one; of the thousands that CHOLMOD makes in
 * it, a sample.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/solver.h"
#include "tests/double/failing_malloc.h"

static struct ischia_case light_case(void)
{
    static const double param[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8, 5, 4};
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, param, sizeof param);
    c.resolution = ISCHIA_COARSE;
    return c;
}

/* The observer cancels in the first iteration: all that is needed before it is there then. */
static bool stop_at_once(void *context, const struct ischia_progress *progress)
{
    (void)context;
    (void)progress;
    return false;
}

/* Creates, solves and destroys. */
static enum ischia_code live_and_die(bool to_the_end, struct ischia_error *err)
{
    static const struct ischia_observer stopper = {stop_at_once, NULL};
    const struct ischia_case c = light_case();
    struct ischia_solver *solver;
    struct ischia_result result = {.load_curve_count = -7};
    struct ischia_field field = {.node_count = 77};
    enum ischia_code code = ischia_solver_create(&solver, err);
    if (code != ISCHIA_OK) return code;
    code = ischia_solve(solver, &c, to_the_end ? NULL : &stopper, &result, &field, err);
    if (code == ISCHIA_OK) {
        assert_true(ischia_result_converged(&result));
        ischia_field_finish(&field);
    } else {
        assert_int_equal(result.load_curve_count, -7);
        assert_int_equal(field.node_count, 77);
    }
    ischia_solver_destroy(solver);
    return code;
}

/* True when the nth allocation was reached, and so failed. */
static bool fails_cleanly(long nth, bool and_all_after, bool to_the_end)
{
    struct ischia_error err = {0};
    const long live = failing_malloc_live();
    failing_malloc_arm(nth, and_all_after);
    const enum ischia_code code = live_and_die(to_the_end, &err);
    const bool happened = failing_malloc_happened();
    failing_malloc_disarm();
    if (failing_malloc_live() != live)
        fail_msg("allocation %ld: %ld blocks are not freed", nth, failing_malloc_live() - live);
    if (happened && (code != ISCHIA_E_MEMORY || err.code != ISCHIA_E_MEMORY))
        fail_msg("allocation %ld: %s: %s", nth, ischia_code_name(code), err.message);
    if (!happened) assert_int_equal(code, to_the_end ? ISCHIA_OK : ISCHIA_E_CANCELLED);
    return happened;
}

static void every_allocation_before_the_path(void **state)
{
    (void)state;
    long nth = 1;
    while (fails_cleanly(nth, nth % 2 == 0, false)) nth++;
    print_message("%ld allocations failed one by one\n", nth - 1);
    assert_true(nth > 60);
}

static void allocations_all_along_the_path(void **state)
{
    (void)state;
    int count = 0;
    for (long nth = 1; fails_cleanly(nth, count % 2 == 0, true); nth += 1 + nth / 8) count++;
    print_message("%d allocations along the path failed\n", count);
    assert_true(count > 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_allocation_before_the_path),
        cmocka_unit_test(allocations_all_along_the_path),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
