/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "api/ucum.h"

static void test_powers_of_ten_are_exact(void **state)
{
    static const struct {
        const char *digits, *from, *to, *same;
    } rows[] = {
        {"0.71", "cm", "mm", "7.1"},  {"7.1e2", "um", "mm", "0.71"}, {"8000", "Pa", "kPa", "8"},
        {"0.008", "MPa", "kPa", "8"}, {"0.8", "N/cm2", "kPa", "8"},  {"0.258", "kN", "N", "258"},
        {"258000", "mN", "N", "258"}, {"0.0228", "m", "mm", "22.8"}, {"80", "hPa", "kPa", "8"},
        {"1E-1", "cm", "mm", "1"},
    };
    char converted[UCUM_DIGITS_BYTES];
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(ucum_convert(rows[i].digits, rows[i].from, rows[i].to, converted),
                         UCUM_CONVERTED);
        const double got = strtod(converted, NULL), wanted = strtod(rows[i].same, NULL);
        assert_memory_equal(&got, &wanted, sizeof got);
    }
}

static void test_exponents_beyond_any_number(void **state)
{
    static const struct {
        const char *digits;
        double value;
    } rows[] = {
        {"1e-9223372036854775808", 0},
        {"1e-99999999999999999999999", 0},
        {"0e9223372036854775807", 0},
        {"1e9223372036854775807", HUGE_VAL},
    };
    static const char *const units[] = {"um", "m"};
    char converted[UCUM_DIGITS_BYTES];
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        for (size_t u = 0; u < 2; u++) {
            assert_int_equal(ucum_convert(rows[i].digits, units[u], "mm", converted),
                             UCUM_CONVERTED);
            const double got = strtod(converted, NULL);
            assert_memory_equal(&got, &rows[i].value, sizeof got);
        }
}

static void test_the_same_unit_keeps_the_digits(void **state)
{
    char converted[UCUM_DIGITS_BYTES];
    (void)state;
    assert_int_equal(ucum_convert("7.100", "mm", "mm", converted), UCUM_CONVERTED);
    assert_string_equal(converted, "7.100");
}

static void test_other_factors(void **state)
{
    char converted[UCUM_DIGITS_BYTES];
    (void)state;
    assert_int_equal(ucum_convert("1", "[in_i]", "mm", converted), UCUM_CONVERTED);
    assert_true(strtod(converted, NULL) == 25.4);
    assert_int_equal(ucum_convert("60", "mm[Hg]", "kPa", converted), UCUM_CONVERTED);
    assert_true(strtod(converted, NULL) == 60 * 0.133322);
    assert_int_equal(ucum_convert("10", "kgf", "N", converted), UCUM_CONVERTED);
    assert_true(strtod(converted, NULL) == 10 * 9.80665);
}

static void test_what_is_refused_leaves_the_output(void **state)
{
    char converted[UCUM_DIGITS_BYTES] = "untouched";
    (void)state;
    assert_int_equal(ucum_convert("1", "furlong", "mm", converted), UCUM_UNKNOWN);
    assert_int_equal(ucum_convert("1", "", "mm", converted), UCUM_UNKNOWN);
    assert_int_equal(ucum_convert("1", "MM", "mm", converted), UCUM_UNKNOWN);
    assert_int_equal(ucum_convert("1", "kPa", "mm", converted), UCUM_OTHER_KIND);
    assert_string_equal(converted, "untouched");
}

static void test_the_table_is_consistent(void **state)
{
    char known[128], converted[UCUM_DIGITS_BYTES];
    (void)state;
    for (size_t i = 0; ucum_unit_at(i) != NULL; i++) {
        const struct ucum_unit *unit = ucum_unit_at(i);
        assert_true(unit->factor > 0);
        assert_true(unit->power == 0 || unit->factor == 1);
        assert_int_equal(ucum_convert("1", unit->code, unit->canonical, converted), UCUM_CONVERTED);
        assert_non_null(strstr(ucum_known(unit->canonical, known, sizeof known), unit->code));
    }
    assert_string_equal(ucum_known("mm", known, 5), "mm");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_powers_of_ten_are_exact),
        cmocka_unit_test(test_exponents_beyond_any_number),
        cmocka_unit_test(test_the_same_unit_keeps_the_digits),
        cmocka_unit_test(test_other_factors),
        cmocka_unit_test(test_what_is_refused_leaves_the_output),
        cmocka_unit_test(test_the_table_is_consistent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
