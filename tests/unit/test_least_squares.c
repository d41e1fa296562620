/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "data_file.h"
#include "near.h"
#include "solver/study/least_squares.h"

static void agrees_with_numpy_and_R(void **state)
{
    (void)state;
    enum { N = 20, K = 3 };
    double A[K * N], y[N];
    struct data_file file;
    struct least_squares fit;
    assert_true(data_open(&file, "regression.csv"));
    for (int i = 0; i < N; i++) {
        assert_true(data_next(&file));
        for (int j = 0; j < K; j++) A[j * N + i] = data_number(&file, j);
        y[i] = data_number(&file, K);
    }
    (void)fclose(file.in);
    assert_int_equal(least_squares_init(&fit, A, y, N, K, NULL), ISCHIA_OK);
    const double got[] = {fit.beta[0],     fit.beta[1],        fit.beta[2],     fit.se[0],
                          fit.se[1],       fit.se[2],          fit.mean_square, fit.r2,
                          fit.r2_adjusted, fit.loo_mean_square};
    assert_true(data_open(&file, "regression_expected.csv") && data_next(&file));
    for (int i = 0; i < 10; i++) assert_near(got[i], data_number(&file, i), 1e-12);
    (void)fclose(file.in);
    least_squares_finish(&fit);
}

static void dependent_columns_are_refused(void **state)
{
    (void)state;
    const double A[] = {1, 1, 1, 1, 1, 2, 3, 4, 2, 3, 4, 5}, y[] = {1, 2, 3, 5};
    struct least_squares fit;
    struct ischia_error err;
    assert_int_equal(least_squares_init(&fit, A, y, 4, 3, &err), ISCHIA_E_INPUT);
    assert_non_null(strstr(err.message, "identify"));
    assert_int_equal(least_squares_init(&fit, A, y, 2, 3, &err), ISCHIA_E_INPUT);
}

static void as_many_rows_as_terms_interpolate(void **state)
{
    (void)state;
    const double A[] = {1, 1, 0, 2}, y[] = {3, 7};
    struct least_squares fit;
    assert_int_equal(least_squares_init(&fit, A, y, 2, 2, NULL), ISCHIA_OK);
    assert_near(fit.beta[0], 3, 1e-14);
    assert_near(fit.beta[1], 2, 1e-14);
    assert_true(isnan(fit.se[0]) && isnan(fit.loo_mean_square));
    least_squares_finish(&fit);
}

static void a_constant_has_no_variance_to_explain(void **state)
{
    (void)state;
    const double A[] = {1, 1, 1, 1, 0, 1, 2, 5}, y[] = {0.1, 0.1, 0.1, 0.1};
    struct least_squares fit;
    assert_int_equal(least_squares_init(&fit, A, y, 4, 2, NULL), ISCHIA_OK);
    assert_true(isnan(fit.r2) && isnan(fit.r2_adjusted));
    least_squares_finish(&fit);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_numpy_and_R),
        cmocka_unit_test(dependent_columns_are_refused),
        cmocka_unit_test(as_many_rows_as_terms_interpolate),
        cmocka_unit_test(a_constant_has_no_variance_to_explain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
