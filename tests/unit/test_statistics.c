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
#include "solver/study/statistics.h"

enum { VALUES_MAX = 64 };

static size_t read_sample(const char *name, double *a, double *b)
{
    struct data_file file;
    size_t n = 0;
    assert_true(data_open(&file, "pairs.csv"));
    while (data_next(&file)) {
        if (strcmp(file.word[0], name) != 0) continue;
        a[n] = data_number(&file, 1);
        b[n++] = data_number(&file, 2);
    }
    (void)fclose(file.in);
    return n;
}

static void expect_row(const struct data_file *file, const struct statistics_pair *s)
{
    const double got[] = {s->pearson_r,
                          s->pearson_p,
                          s->pearson_ci.low,
                          s->pearson_ci.high,
                          s->spearman_rho,
                          s->spearman_p,
                          s->mean_square,
                          s->slope,
                          s->intercept,
                          s->corrected_mean_square,
                          s->constant_mean_square,
                          s->bias,
                          s->bias_sd,
                          s->bias_ci.low,
                          s->bias_ci.high,
                          s->limits.low,
                          s->limits.high,
                          s->limits_half_ci};
    /* In "offset" the readings are 1e6 + 1: six digits are gone before anybody computes. */
    const double tolerance = strcmp(file->word[0], "offset") == 0 ? 1e-7 : 1e-11;
    assert_int_equal(file->count - 2, sizeof got / sizeof got[0]); /* name and what ends the line */
    for (size_t i = 0; i < sizeof got / sizeof got[0]; i++) {
        const double expected = data_number(file, (int)i + 1);
        if (!(fabs(got[i] - expected) <= tolerance * (fabs(expected) + 1e-3)))
            fail_msg("%s, statistic %zu: %.17g, expected %.17g", file->word[0], i, got[i],
                     expected);
    }
}

static void agrees_with_scipy(void **state)
{
    (void)state;
    struct data_file file;
    int samples = 0;
    assert_true(data_open(&file, "pairs_expected.csv"));
    for (; data_next(&file); samples++) {
        double a[VALUES_MAX], b[VALUES_MAX];
        struct statistics_pair s;
        const size_t n = read_sample(file.word[0], a, b);
        assert_true(n >= 4);
        assert_int_equal(statistics_compare(a, b, n, &s, NULL), ISCHIA_OK);
        assert_int_equal(s.n, n);
        expect_row(&file, &s);
    }
    (void)fclose(file.in);
    assert_int_equal(samples, 5);
}

static void a_line_is_perfectly_correlated(void **state)
{
    (void)state;
    const double a[] = {1, 2, 3, 4, 5}, b[] = {3, 5, 7, 9, 11};
    struct statistics_pair s;
    assert_int_equal(statistics_compare(a, b, 5, &s, NULL), ISCHIA_OK);
    assert_near(s.pearson_r, 1, 1e-15);
    assert_near(s.spearman_rho, 1, 1e-15);
    assert_near(s.slope, 2, 1e-15);
    assert_near(s.intercept, 1, 1e-14);
    assert_near(s.corrected_mean_square, 0, 1e-28);
    assert_near(s.mean_square, (4 + 9 + 16 + 25 + 36) / 5.0, 1e-14);
    assert_near(s.bias, 4, 1e-15);
    assert_near(s.b.min, 3, 0);
    assert_near(s.b.max, 11, 0);
}

static void a_constant_has_no_correlation(void **state)
{
    (void)state;
    const double a[] = {1, 1, 1}, b[] = {1, 2, 3};
    struct statistics_pair s;
    assert_int_equal(statistics_compare(a, b, 3, &s, NULL), ISCHIA_OK);
    assert_true(isnan(s.pearson_r) && isnan(s.pearson_p) && isnan(s.pearson_ci.low));
    assert_true(isnan(s.slope));
    assert_near(s.bias, 1, 1e-15);
}

static void too_few_or_not_finite_is_refused(void **state)
{
    (void)state;
    const double a[] = {1, 2, (double)NAN}, b[] = {1, 2, 3};
    struct statistics_pair s;
    struct ischia_error err;
    assert_int_equal(statistics_compare(a, b, 2, &s, &err), ISCHIA_E_INPUT);
    assert_int_equal(statistics_compare(a, b, 3, &s, &err), ISCHIA_E_INPUT);
    assert_non_null(strstr(err.message, "pair 3"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_scipy),
        cmocka_unit_test(a_line_is_perfectly_correlated),
        cmocka_unit_test(a_constant_has_no_correlation),
        cmocka_unit_test(too_few_or_not_finite_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
