/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/gmres.h"
#include "tests/unit/near.h"

enum { N_MAX = 60 };

struct system {
    int n;
    double A[N_MAX][N_MAX];
    double inverse_diagonal[N_MAX]; /* the preconditioner */
    int solves_left;                /* of the preconditioner, before it fails; < 0: never */
};

static void apply(void *context, const double *x, double *ret_y)
{
    const struct system *s = context;
    for (int i = 0; i < s->n; i++) {
        ret_y[i] = 0;
        for (int j = 0; j < s->n; j++) ret_y[i] += s->A[i][j] * x[j];
    }
}

static enum ischia_code precondition(void *context, double *x, struct ischia_error *err)
{
    struct system *s = context;
    CHECK(s->solves_left-- != 0, err, ISCHIA_E_MEMORY, "no memory for this solve");
    for (int i = 0; i < s->n; i++) x[i] *= s->inverse_diagonal[i];
    return ISCHIA_OK;
}

/* Pseudo-random in [-1, 1], the same in every run. */
static double noise(int i, int j) { return sin(12.9898 * i + 78.233 * j + 0.5); }

static enum ischia_code solve(struct system *s, double tolerance, double *x, double *ret_reached,
                              struct ischia_error *err)
{
    const struct gmres_operator op = {apply, precondition, s};
    double *work = malloc(gmres_work_size(s->n) * sizeof *work);
    assert_non_null(work);
    const enum ischia_code code = gmres(&op, s->n, tolerance, x, work, ret_reached, err);
    free(work);
    return code;
}

/* Not symmetric, diagonally dominant. */
static void dominant_system(struct system *s, int n, double off)
{
    *s = (struct system){.n = n, .solves_left = -1};
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) s->A[i][j] = off * noise(i, j);
        s->A[i][i] = 3 + i;
        s->inverse_diagonal[i] = 1 / s->A[i][i];
    }
}

static void unsymmetric_system_is_solved(void **state)
{
    (void)state;
    struct system s;
    double x[N_MAX], exact[N_MAX], reached;
    dominant_system(&s, N_MAX, 0.1);
    for (int i = 0; i < s.n; i++) exact[i] = noise(i, 7);
    apply(&s, exact, x);
    assert_int_equal(solve(&s, 1e-12, x, &reached, NULL), ISCHIA_OK);
    assert_true(reached <= 1e-12);
    for (int i = 0; i < s.n; i++) assert_near(x[i], exact[i], 1e-11);
}

/* What is reported is the true preconditioned residual, also when the tolerance is loose. */
static void reached_is_the_residual(void **state)
{
    (void)state;
    struct system s;
    double b[N_MAX], x[N_MAX], Ax[N_MAX], reached, rest2 = 0, start2 = 0;
    dominant_system(&s, 40, 0.4);
    for (int i = 0; i < s.n; i++) x[i] = b[i] = noise(3, i);
    assert_int_equal(solve(&s, 0.05, x, &reached, NULL), ISCHIA_OK);
    apply(&s, x, Ax);
    for (int i = 0; i < s.n; i++) {
        rest2 += pow((b[i] - Ax[i]) * s.inverse_diagonal[i], 2);
        start2 += pow(b[i] * s.inverse_diagonal[i], 2);
    }
    assert_true(reached > 1e-6 && reached <= 0.05);
    assert_near(sqrt(rest2 / start2), reached, 1e-12);
}

static void zero_right_hand_side_gives_zero(void **state)
{
    (void)state;
    struct system s;
    double x[N_MAX] = {0}, reached = 5;
    dominant_system(&s, 10, 0.1);
    assert_int_equal(solve(&s, 1e-10, x, &reached, NULL), ISCHIA_OK);
    assert_true(reached == 0);
    for (int i = 0; i < s.n; i++) assert_true(x[i] == 0);
}

/* x -> x shifted round by one: nothing is gained before n iterations, and that is reported. */
static void running_out_of_iterations_is_reported(void **state)
{
    (void)state;
    struct system s = {.n = N_MAX, .solves_left = -1};
    double x[N_MAX] = {1}, reached;
    for (int i = 0; i < s.n; i++) {
        s.A[(i + 1) % s.n][i] = 1;
        s.inverse_diagonal[i] = 1;
    }
    assert_int_equal(solve(&s, 1e-10, x, &reached, NULL), ISCHIA_OK);
    assert_near(reached, 1, 1e-12);
}

/* The Krylov space may end early: with the solution, or, for a singular A, without one. */
static void early_end_is_told_from_failure(void **state)
{
    (void)state;
    struct system s = {.n = 3, .solves_left = -1};
    double x[3] = {2, -4, 6}, reached;
    for (int i = 0; i < 3; i++) s.A[i][i] = s.inverse_diagonal[i] = 1;
    assert_int_equal(solve(&s, 1e-10, x, &reached, NULL), ISCHIA_OK);
    assert_near(reached, 0, 1e-15);
    assert_near(x[2], 6, 1e-14);

    memset(s.A, 0, sizeof s.A);
    assert_int_equal(solve(&s, 1e-10, x, &reached, NULL), ISCHIA_OK);
    assert_near(reached, 1, 1e-15);
}

static void failure_of_the_preconditioner_is_passed_on(void **state)
{
    (void)state;
    for (int after = 0; after < 4; after++) {
        struct system s;
        struct ischia_error err;
        double x[N_MAX], reached;
        dominant_system(&s, 30, 0.4);
        s.solves_left = after;
        for (int i = 0; i < s.n; i++) x[i] = 1 + noise(i, 1);
        assert_int_equal(solve(&s, 1e-12, x, &reached, &err), ISCHIA_E_MEMORY);
        assert_string_equal(err.message, "no memory for this solve");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unsymmetric_system_is_solved),
        cmocka_unit_test(reached_is_the_residual),
        cmocka_unit_test(zero_right_hand_side_gives_zero),
        cmocka_unit_test(running_out_of_iterations_is_reported),
        cmocka_unit_test(early_end_is_told_from_failure),
        cmocka_unit_test(failure_of_the_preconditioner_is_passed_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
