/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "api/fhir_date.h"

enum { SECOND = 1000 };
static const int64_t day = 86400 * (int64_t)SECOND;

/* The C library as the oracle. */
static int64_t at(int year, int month, int date, int hour, int minute, int second)
{
    struct tm parts = {.tm_year = year - 1900,
                       .tm_mon = month - 1,
                       .tm_mday = date,
                       .tm_hour = hour,
                       .tm_min = minute,
                       .tm_sec = second};
    return (int64_t)timegm(&parts) * SECOND;
}

static void test_spans(void **state)
{
    const struct {
        const char *text;
        int64_t lo, length;
    } rows[] = {
        {"2026", at(2026, 1, 1, 0, 0, 0), 365 * day},
        {"2024", at(2024, 1, 1, 0, 0, 0), 366 * day},
        {"2026-02", at(2026, 2, 1, 0, 0, 0), 28 * day},
        {"2026-12", at(2026, 12, 1, 0, 0, 0), 31 * day},
        {"1969-07-20", at(1969, 7, 20, 0, 0, 0), day},
        {"2024-02-29", at(2024, 2, 29, 0, 0, 0), day},
        {"2026-03-01T09:30", at(2026, 3, 1, 9, 30, 0), 60 * SECOND},
        {"2026-03-01T09:30:15Z", at(2026, 3, 1, 9, 30, 15), SECOND},
        {"2026-03-01T09:30:15+05:30", at(2026, 3, 1, 4, 0, 15), SECOND},
        {"2026-03-01T00:30:00-01:00", at(2026, 3, 1, 1, 30, 0), SECOND},
        {"2026-03-01T09:30:15.25Z", at(2026, 3, 1, 9, 30, 15) + 250, 1},
        {"0001-01-01", at(1, 1, 1, 0, 0, 0), day},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        int64_t lo = 0, hi = 0;
        assert_true(fhir_date_span(rows[i].text, &lo, &hi));
        assert_int_equal(lo, rows[i].lo);
        assert_int_equal(hi - lo, rows[i].length);
    }
}

static void test_days_over_four_centuries(void **state)
{
    char text[40];
    (void)state;
    for (int year = 1900; year < 2300; year++)
        for (int month = 1; month <= 12; month++) {
            int64_t lo = 0, hi = 0;
            (void)snprintf(text, sizeof text, "%04d-%02d", year, month);
            assert_true(fhir_date_span(text, &lo, &hi));
            assert_int_equal(lo, at(year, month, 1, 0, 0, 0));
            assert_int_equal(hi, at(month == 12 ? year + 1 : year, month % 12 + 1, 1, 0, 0, 0));
        }
}

static void test_what_is_no_date(void **state)
{
    static const char *const bad[] = {"",
                                      "26",
                                      "2026-",
                                      "2026-13",
                                      "2026-00",
                                      "2026-02-30",
                                      "2026-02-00",
                                      "2026-1-1",
                                      "2026-03-01T",
                                      "0000",
                                      "2026-03-01T24:00",
                                      "2026-03-01T09",
                                      "2026T09:30",
                                      "2026-03-01x",
                                      "2026-03-01T09:30:15.Z",
                                      "2026-03-01T09:30.5Z",
                                      "2026-03-01T09:30+25:00",
                                      "2026-03-01T09:30:15+0530",
                                      " 2026"};
    int64_t lo = 7, hi = 7;
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(fhir_date_span(bad[i], &lo, &hi));
    assert_true(lo == 7 && hi == 7);
}

static void test_prefixes_bound_a_range(void **state)
{
    const int64_t first = at(2026, 3, 1, 0, 0, 0), after = first + day;
    const struct {
        const char *value;
        int64_t lo, hi;
    } rows[] = {
        {"2026-03-01", first, after}, {"eq2026-03-01", first, after}, {"ge2026-03-01", first, 0},
        {"gt2026-03-01", after, 0},   {"sa2026-03-01", after, 0},     {"le2026-03-01", 0, after},
        {"lt2026-03-01", 0, first},   {"eb2026-03-01", 0, first},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        int64_t lo = 7, hi = 7;
        assert_true(fhir_date_range(rows[i].value, &lo, &hi));
        assert_int_equal(lo, rows[i].lo);
        assert_int_equal(hi, rows[i].hi);
    }
    int64_t lo = 7, hi = 7;
    assert_false(fhir_date_range("ne2026", &lo, &hi));
    assert_false(fhir_date_range("ap2026", &lo, &hi));
    assert_false(fhir_date_range("g", &lo, &hi));
    assert_false(fhir_date_range("", &lo, &hi));
    assert_true(lo == 7 && hi == 7);
}

static void test_a_bound_before_1970_is_one(void **state)
{
    static const struct {
        const char *value;
        int64_t lo, hi;
    } rows[] = {
        {"lt1970-01-01", 0, 1}, {"eb1970", 0, 1},
        {"le1969", 0, 1},       {"lt0001", 0, 1},
        {"1969-07-20", 1, 1},   {"ge1970", 1, 0},
        {"gt1900", 1, 0},       {"1970-01-01T00:00:00.000Z", 1, 1},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        int64_t lo = 7, hi = 7;
        assert_true(fhir_date_range(rows[i].value, &lo, &hi));
        assert_int_equal(lo, rows[i].lo);
        assert_int_equal(hi, rows[i].hi);
    }
}

static void test_which_is_later(void **state)
{
    (void)state;
    assert_true(fhir_date_is_after("2026-03-01T08:30:00Z", "2026-03-01T09:00:00+02:00"));
    assert_false(fhir_date_is_after("2026-03-01T09:00:00+02:00", "2026-03-01T08:30:00Z"));
    assert_false(fhir_date_is_after("2026-03-01T09:00:00+01:00", "2026-03-01T08:00:00Z"));
    assert_true(fhir_date_is_after("2026-03-01T00:01:00Z", "2026-03-01"));
    assert_true(fhir_date_is_after("2026", ""));
    assert_true(fhir_date_is_after("0001", ""));
    assert_false(fhir_date_is_after("", "2026"));
    assert_false(fhir_date_is_after("", ""));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_spans),
        cmocka_unit_test(test_days_over_four_centuries),
        cmocka_unit_test(test_what_is_no_date),
        cmocka_unit_test(test_prefixes_bound_a_range),
        cmocka_unit_test(test_a_bound_before_1970_is_one),
        cmocka_unit_test(test_which_is_later),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
