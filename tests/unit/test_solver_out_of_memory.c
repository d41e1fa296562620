/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A solve with its 1st, 2nd, ... allocation failing, until one gets through: those of the
 * mechanics, of CHOLMOD and METIS alike. Each run ends with ISCHIA_E_MEMORY and leaves its outputs
 * alone, or a library could do without and the result has the same bits; nothing leaks.
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

/* Creates, solves and destroys. */
static enum ischia_code live_and_die(double *ret_eps_max, struct ischia_error *err)
{
    const struct ischia_case c = light_case();
    struct ischia_solver *solver;
    struct ischia_result result = {.load_curve_count = -7};
    struct ischia_field field = {.node_count = 77};
    enum ischia_code code = ischia_solver_create(&solver, err);
    if (code != ISCHIA_OK) return code;
    code = ischia_solve(solver, &c, NULL, &result, &field, err);
    if (code == ISCHIA_OK) {
        assert_true(ischia_result_converged(&result));
        *ret_eps_max = result.strain.eps_max;
        ischia_field_finish(&field);
    } else {
        assert_int_equal(result.load_curve_count, -7);
        assert_int_equal(field.node_count, 77);
    }
    ischia_solver_destroy(solver);
    return code;
}

/* How the runs went. */
struct tally {
    double eps_max; /* when nothing fails */
    int failed, spared;
};

static void tally_init(struct tally *t)
{
    struct ischia_error err;
    *t = (struct tally){0};
    /* Also makes what libraries keep for good, so that it does not count as a leak. */
    if (live_and_die(&t->eps_max, &err) != ISCHIA_OK) fail_msg("%s", err.message);
}

/* False when the solve has no nth allocation. */
static bool fail_nth(struct tally *t, long nth, bool and_all_after)
{
    struct ischia_error err = {0};
    double eps_max = -1;
    const long live = failing_malloc_live();
    failing_malloc_arm(nth, and_all_after);
    const enum ischia_code code = live_and_die(&eps_max, &err);
    const bool happened = failing_malloc_happened();
    failing_malloc_disarm();
    if (failing_malloc_live() != live)
        fail_msg("allocation %ld: %ld blocks are not freed", nth, failing_malloc_live() - live);
    if (code != ISCHIA_OK && (code != ISCHIA_E_MEMORY || err.code != ISCHIA_E_MEMORY))
        fail_msg("allocation %ld: %s: %s", nth, ischia_code_name(code), err.message);
    if (code == ISCHIA_OK && eps_max != t->eps_max) fail_msg("allocation %ld: other bits", nth);
    t->failed += code != ISCHIA_OK;
    t->spared += happened && code == ISCHIA_OK;
    return happened;
}

static void every_allocation_of_a_solve(void **state)
{
    (void)state;
    struct tally t;
    long nth = 1;
    tally_init(&t);
    while (fail_nth(&t, nth, nth % 2 == 0)) nth++;
    print_message("%d allocations failed, %d could be done without\n", t.failed, t.spared);
    assert_true(t.failed > 300);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_allocation_of_a_solve)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
