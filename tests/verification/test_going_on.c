/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Soft sides whose first attempts fail: a larger force goes on from a smaller one with the bits of
 * a solve from rest. Hundreds of iterations each, so not among the unit tests, which run sanitized.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tests/unit/solving.h"

static bool count(void *context, const struct ischia_progress *p)
{
    assert_true(p->load_step >= 1); /* another attempt counts anew */
    ++*(int *)context;
    return true;
}

static int iterations_for(struct ischia_solver *solver, const struct ischia_case *c,
                          struct ischia_result *ret)
{
    int calls = 0;
    const struct ischia_observer observer = {count, &calls};
    assert_int_equal(ischia_solve(solver, c, &observer, ret, NULL, NULL), ISCHIA_OK);
    return calls;
}

/* A soft side whose first attempt ends below the smaller force; then the larger one. Iterations
 * made, of how many the result counts. */
static int iterations_after(const double param[ISCHIA_PARAM_COUNT], double larger_N, int *ret_of)
{
    struct ischia_solver *solver = solver_make(), *fresh = solver_make();
    struct ischia_case c = coarse_case(0);
    memcpy(c.param, param, sizeof c.param);
    const struct ischia_result r = solve(solver, &c, NULL);
    assert_non_null(strstr(r.numerics.detail, "corners"));
    c.param[ISCHIA_F] = larger_N;
    struct ischia_result cold, warm;
    *ret_of = iterations_for(fresh, &c, &cold);
    const int on = iterations_for(solver, &c, &warm);
    same_bits(&warm, &cold);
    ischia_solver_destroy(solver);
    ischia_solver_destroy(fresh);
    return on;
}

static void a_later_attempt_goes_on_too(void **state)
{
    (void)state;
    static const double param[ISCHIA_PARAM_COUNT] = {3, 39, 19, 35, 1, 8, 192};
    int from_rest;
    const int on = iterations_after(param, 310, &from_rest);
    assert_in_range(on, 1, from_rest / 3);
}

/* A path whose last step was taken in parts goes on from before that step. */
static void a_path_goes_on_from_where_it_left(void **state)
{
    (void)state;
    static const double param[ISCHIA_PARAM_COUNT] = {3, 15, 19, 22, 1, 2.8, 270};
    int from_rest;
    const int on = iterations_after(param, 310, &from_rest);
    assert_in_range(on, 1, from_rest / 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_later_attempt_goes_on_too),
        cmocka_unit_test(a_path_goes_on_from_where_it_left),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
