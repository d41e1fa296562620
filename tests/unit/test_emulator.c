/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "near.h"
#include "solver/study/design.h"
#include "solver/study/emulator.h"

/* Table 1 of Macron et al. (2020), F of the whole side. */
static struct design table_1(void)
{
    static const double level[ISCHIA_PARAM_COUNT][3] = {{5, 7, 9},      {15, 39, 63}, {19, 29, 39},
                                                        {9, 22, 35},    {1, 4.5, 8},  {2.8, 5.4, 8},
                                                        {192, 310, 428}};
    struct design d = {.kind = DESIGN_FULL, .base = ischia_case_default(), .factor_count = 7};
    for (int f = 0; f < 7; f++) {
        d.factor[f].index = f;
        d.factor[f].level_count = 3;
        memcpy(d.factor[f].level, level[f], sizeof level[f]);
    }
    return d;
}

/* Fills x [n][7] with the normalised points of the design. */
static size_t coordinates(const struct design *d, double **ret_x)
{
    struct design_points points;
    assert_int_equal(design_points_init(&points, d, DESIGN_ROWS_MAX, NULL), ISCHIA_OK);
    const size_t n = points.count;
    *ret_x = calloc(n * 7, sizeof(double));
    assert_non_null(*ret_x);
    for (size_t i = 0; i < n * 7; i++)
        (*ret_x)[i] = design_normalised(&d->factor[i % 7], points.value[i]);
    design_points_finish(&points);
    return n;
}

static void an_exact_polynomial_comes_back(void **state)
{
    (void)state;
    const struct design d = table_1();
    double *x, beta[EMULATOR_TERMS_MAX], scratch[7];
    struct emulator e, truth = {.params = 7, .degree = 2};
    const size_t n = coordinates(&d, &x);
    double *y = calloc(n, sizeof *y);
    assert_int_equal(n, 2187);
    assert_non_null(y);
    truth.terms = emulator_terms(7, 2, truth.term);
    assert_int_equal(truth.terms, 36);
    for (int t = 0; t < truth.terms; t++) beta[t] = sin(1.0 + 3 * t);
    truth.fit.beta = beta;
    for (size_t i = 0; i < n; i++) y[i] = emulator_value(&truth, &x[i * 7]);
    assert_int_equal(emulator_init(&e, 7, 2, x, y, n, NULL), ISCHIA_OK);
    for (int t = 0; t < e.terms; t++) assert_near(e.fit.beta[t], beta[t], 1e-10);
    assert_near(e.fit.mean_square, 0, 1e-20);
    assert_near(e.fit.r2, 1, 1e-12);
    for (int f = 0; f < 7; f++) scratch[f] = 0.1 * f - 0.3;
    assert_near(emulator_value(&e, scratch), emulator_value(&truth, scratch), 1e-10);
    emulator_finish(&e);
    free(y);
    free(x);
}

static void degree_one_is_the_orthogonal_projection(void **state)
{
    (void)state;
    /* On a full factorial the linear coefficients do not see squares or products. */
    const struct design d = table_1();
    double *x;
    struct emulator e;
    const size_t n = coordinates(&d, &x);
    double *y = calloc(n, sizeof *y);
    assert_non_null(y);
    for (size_t i = 0; i < n; i++) {
        const double *p = &x[i * 7];
        y[i] = 1 + 0.5 * p[0] - 0.25 * p[6] + 0.125 * p[1] * p[1] + 2 * p[2] * p[3];
    }
    assert_int_equal(emulator_init(&e, 7, 1, x, y, n, NULL), ISCHIA_OK);
    assert_int_equal(e.terms, 8);
    assert_near(e.fit.beta[1], 0.5, 1e-12);
    assert_near(e.fit.beta[7], -0.25, 1e-12);
    assert_near(e.sensitivity.share[1], 0.8, 1e-12);
    assert_near(e.sensitivity.first_order[6], 0.2, 1e-12);
    emulator_finish(&e);
    free(y);
    free(x);
}

static void sensitivities_follow_the_moments(void **state)
{
    (void)state;
    /* y = 3 + x0 + x1^2 + x0 x1: variances 1/3, 4/45, 1/9. */
    struct emulator_term term[EMULATOR_TERMS_MAX];
    const int terms = emulator_terms(2, 2, term);
    const double beta[] = {3, 1, 0, 0, 1, 1}, variance = 1.0 / 3 + 4.0 / 45 + 1.0 / 9;
    assert_int_equal(terms, 6);
    const struct emulator_sensitivity s = emulator_sensitivity_of(term, terms, 2, beta);
    assert_near(s.variance, variance, 1e-15);
    assert_near(s.first_order[0], 1.0 / 3 / variance, 1e-15);
    assert_near(s.first_order[1], 4.0 / 45 / variance, 1e-15);
    assert_near(s.total[0], (1.0 / 3 + 1.0 / 9) / variance, 1e-15);
    assert_near(s.total[1], (4.0 / 45 + 1.0 / 9) / variance, 1e-15);
    assert_near(s.share[0], 0, 0);
}

/* Sobol' indices of the polynomial against a brute-force quadrature on a product grid. */
static void sobol_indices_agree_with_quadrature(void **state)
{
    (void)state;
    enum { GRID = 400 };
    struct emulator e = {.params = 2, .degree = 2};
    double beta[] = {0.3, 1.1, -0.4, 0.7, 0.2, -0.9};
    e.terms = emulator_terms(2, 2, e.term);
    e.fit.beta = beta;
    double mean = 0, square = 0, mean_square_given_x0 = 0;
    for (int i = 0; i < GRID; i++) {
        double conditional = 0;
        for (int j = 0; j < GRID; j++) {
            const double x[2] = {(2 * i + 1.0) / GRID - 1, (2 * j + 1.0) / GRID - 1};
            const double y = emulator_value(&e, x);
            conditional += y / GRID;
            square += y * y / GRID / GRID;
        }
        mean += conditional / GRID;
        mean_square_given_x0 += conditional * conditional / GRID;
    }
    const double variance = square - mean * mean;
    const struct emulator_sensitivity s = emulator_sensitivity_of(e.term, e.terms, 2, beta);
    assert_near(s.variance, variance, 1e-4);
    assert_near(s.first_order[0], (mean_square_given_x0 - mean * mean) / variance, 1e-4);
    assert_near(s.total[1], 1 - s.first_order[0], 1e-12);
}

static void a_design_too_small_is_refused(void **state)
{
    (void)state;
    const double x[] = {-1, 1, -1, 1}, y[] = {1, 2, 3, 4};
    struct emulator e;
    struct ischia_error err;
    /* Two levels cannot tell a square from the constant. */
    assert_int_equal(emulator_init(&e, 1, 2, x, y, 4, &err), ISCHIA_E_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_exact_polynomial_comes_back),
        cmocka_unit_test(degree_one_is_the_orthogonal_projection),
        cmocka_unit_test(sensitivities_follow_the_moments),
        cmocka_unit_test(sobol_indices_agree_with_quadrature),
        cmocka_unit_test(a_design_too_small_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
