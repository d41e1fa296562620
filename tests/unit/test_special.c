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
#include "solver/study/special.h"

static double evaluate(const struct data_file *f)
{
    const double a = data_number(f, 1), b = data_number(f, 2), x = data_number(f, 3);
    if (strcmp(f->word[0], "beta") == 0) return special_incomplete_beta(a, b, x);
    if (strcmp(f->word[0], "t_two_sided") == 0) return special_t_two_sided(a, b);
    if (strcmp(f->word[0], "t_quantile") == 0) return special_t_quantile(a, b);
    assert_string_equal(f->word[0], "normal_quantile");
    return special_normal_quantile(a);
}

static void agrees_with_scipy(void **state)
{
    (void)state;
    struct data_file file;
    int rows = 0;
    assert_true(data_open(&file, "special.csv"));
    while (data_next(&file)) {
        const double expected = data_number(&file, 4), got = evaluate(&file);
        if (!(fabs(got - expected) <= 1e-11 * fabs(expected) + 1e-300))
            fail_msg("%s(%s, %s, %s): %.17g, expected %.17g", file.word[0], file.word[1],
                     file.word[2], file.word[3], got, expected);
        rows++;
    }
    (void)fclose(file.in);
    assert_int_equal(rows, 235);
}

static void closed_forms_hold(void **state)
{
    (void)state;
    assert_near(special_incomplete_beta(1, 1, 0.3), 0.3, 1e-15);
    assert_near(special_incomplete_beta(2, 1, 0.3), 0.09, 1e-15);
    assert_true(special_incomplete_beta(3, 4, 0) == 0);
    assert_true(special_incomplete_beta(3, 4, 1) == 1);
    /* One degree of freedom is Cauchy's distribution: P(|T| >= 1) = 1/2. */
    assert_near(special_t_two_sided(1, 1), 0.5, 1e-15);
    assert_true(special_t_two_sided((double)INFINITY, 5) == 0);
    assert_true(special_t_quantile(0.5, 3) == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_scipy),
        cmocka_unit_test(closed_forms_hold),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
