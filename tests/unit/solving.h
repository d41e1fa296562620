/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_UNIT_SOLVING_H
#define ISCHIA_TESTS_UNIT_SOLVING_H

/* Whole coarse solves in tests. Include after cmocka.h. */

#include <string.h>

#include "solver/solver.h"

/* Row 1R of Table 2, coarse; `variant` makes others of it. */
static inline struct ischia_case coarse_case(int variant)
{
    static const double param[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8, 5, 196};
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, param, sizeof param);
    c.param[ISCHIA_F] += 10 * variant;
    c.param[ISCHIA_EM] -= 3 * variant;
    c.resolution = ISCHIA_COARSE;
    return c;
}

static inline struct ischia_solver *solver_make(void)
{
    struct ischia_solver *solver;
    struct ischia_error err;
    if (ischia_solver_create(&solver, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    return solver;
}

static inline struct ischia_result solve(struct ischia_solver *solver, const struct ischia_case *c,
                                         struct ischia_field *ret_field)
{
    struct ischia_result result;
    struct ischia_error err = {.message = "as it was"};
    memset(&result, 0x5a, sizeof result);
    if (ischia_solve(solver, c, NULL, &result, ret_field, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    assert_string_equal(err.message, "as it was");
    return result;
}

static inline void same_bits(const struct ischia_result *a, const struct ischia_result *b)
{
    assert_true(ischia_result_converged(a));
    assert_memory_equal(&a->strain, &b->strain, sizeof a->strain);
    assert_memory_equal(a->clusters, b->clusters, sizeof a->clusters);
    assert_memory_equal(&a->seat, &b->seat, sizeof a->seat);
    assert_int_equal(a->load_curve_count, b->load_curve_count);
    assert_memory_equal(a->load_curve, b->load_curve,
                        sizeof *a->load_curve * (size_t)a->load_curve_count);
    assert_int_equal(a->numerics.newton_iterations, b->numerics.newton_iterations);
    assert_int_equal(a->numerics.factorisations, b->numerics.factorisations);
    assert_true(a->numerics.energy_residual == b->numerics.energy_residual);
    assert_string_equal(a->numerics.detail, b->numerics.detail);
}

#endif
