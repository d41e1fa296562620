/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Samples of the inputs: the truncated normal distribution against its own closed form, and the
 * limits that every sample keeps. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/study/sampling.h"
#include "solver/study/sequence.h"

static double phi(double x) { return 0.5 * erfc(-x * M_SQRT1_2); }

static struct ischia_case measured(double R1, double R2)
{
    struct ischia_case c = ischia_case_default();
    const double param[ISCHIA_PARAM_COUNT] = {R1, R2, 29, 22, 1, 5, 300};
    memcpy(c.param, param, sizeof param);
    return c;
}

static void the_distribution_is_the_truncated_normal(void **state)
{
    static const struct {
        double mean, sd, low, high;
    } cases[] = {
        {10, 2, 3, 15}, {3, 1, 3, 15}, {3.5, 4, 3, 15}, {14.9, 0.7, 3, 15}, {20, 5, 40, 90}};
    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        const double m = cases[k].mean, s = cases[k].sd, low = cases[k].low, high = cases[k].high;
        double last = low;
        for (int i = 0; i < 1000; i++) {
            const double u = (i + 0.5) / 1000;
            const double x = sampling_truncated_normal(m, s, low, high, u);
            /* upper tails: they keep their digits where the limits are far above the mean */
            const double all = phi((m - low) / s) - phi((m - high) / s);
            const double below = (phi((m - low) / s) - phi((m - x) / s)) / all;
            if (!(fabs(below - u) < 1e-9))
                fail_msg("case %zu: P(%g) is %g, not %g", k, x, below, u);
            assert_true(x > last || i == 0);
            assert_true(x > low && x < high); /* nothing lies on the limits */
            last = x;
        }
    }
}

static void what_is_left_far_out_stays_between_the_limits(void **state)
{
    (void)state;
    for (double u = 0; u < 1; u += 0.0625) {
        double x = sampling_truncated_normal(8, 0.01, 30, 40, u);
        assert_true(x >= 30 && x < 30.1); /* 2200 sd out */
        x = sampling_truncated_normal(40, 0.01, 8, 30, u);
        assert_true(x <= 30 && x > 29.9);
        x = sampling_truncated_normal(8, 1e-9, 3, 15, u);
        assert_true(fabs(x - 8) < 1e-7);
    }
}

static void samples_keep_the_limits_without_piling_up(void **state)
{
    const struct ischia_case c = measured(8, 8.5);
    const double sd[ISCHIA_PARAM_COUNT] = {2, 10, 10, 15, 1, 0, 200};
    int on_limit = 0, at_R1 = 0;
    (void)state;
    for (uint32_t k = 0; k < 4096; k++) {
        double u[ISCHIA_PARAM_COUNT];
        for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) u[i] = sequence_sobol(k, i, 7);
        const struct ischia_case at = sampling_case(&c, sd, u);
        assert_true(ischia_case_is_valid(&at));
        assert_true(at.param[ISCHIA_MUF] == c.param[ISCHIA_MUF]);
        at_R1 += at.param[ISCHIA_R2] == at.param[ISCHIA_R1];
        for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
            on_limit += at.param[i] == ischia_params[i].accepted_min ||
                        at.param[i] == ischia_params[i].accepted_max;
    }
    assert_int_equal(on_limit, 0);
    assert_int_equal(at_R1, 0);
}

static void an_exact_R2_bounds_R1(void **state)
{
    const struct ischia_case c = measured(8, 9);
    const double sd[ISCHIA_PARAM_COUNT] = {3};
    (void)state;
    for (int i = 0; i < 100; i++) {
        const double u[ISCHIA_PARAM_COUNT] = {i / 100.0};
        const struct ischia_case at = sampling_case(&c, sd, u);
        assert_true(at.param[ISCHIA_R1] < 9 && ischia_case_is_valid(&at));
    }
}

static void typical_is_absolute_or_relative(void **state)
{
    const struct ischia_case c = measured(8, 30);
    double sd[ISCHIA_PARAM_COUNT];
    (void)state;
    sampling_sd_typical(&c, sd);
    assert_true(sampling_sd_is_valid(sd));
    assert_true(sd[ISCHIA_EM] == 2 && sd[ISCHIA_EF] == 3);
    assert_true(fabs(sd[ISCHIA_F] - 30) < 1e-12 && fabs(sd[ISCHIA_MUF] - 1) < 1e-12);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        assert_true((sampling_typical[i].absolute > 0) != (sampling_typical[i].relative > 0));
    sd[0] = sampling_sd_max(ISCHIA_R1);
    assert_true(sampling_sd_is_valid(sd));
    sd[0] = nextafter(sd[0], 100);
    assert_false(sampling_sd_is_valid(sd));
    sd[0] = -1e-300;
    assert_false(sampling_sd_is_valid(sd));
    sd[0] = (double)NAN;
    assert_false(sampling_sd_is_valid(sd));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_distribution_is_the_truncated_normal),
        cmocka_unit_test(what_is_left_far_out_stays_between_the_limits),
        cmocka_unit_test(samples_keep_the_limits_without_piling_up),
        cmocka_unit_test(an_exact_R2_bounds_R1),
        cmocka_unit_test(typical_is_absolute_or_relative),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
