/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/fhir_date.h"

#include <stddef.h>
#include <string.h>

enum { MS_PER_SECOND = 1000, MS_PER_MINUTE = 60 * 1000, MS_PER_HOUR = 60 * MS_PER_MINUTE };
static const int64_t ms_per_day = 24LL * MS_PER_HOUR;

/* Days from 1970-01-01 (proleptic Gregorian), after Howard Hinnant's days_from_civil. */
static int64_t days(int year, int month, int day)
{
    const int y = month <= 2 ? year - 1 : year;
    const int era = (y >= 0 ? y : y - 399) / 400, of_era = y - era * 400;
    const int of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
    return (int64_t)era * 146097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719468;
}

static int days_in(int year, int month)
{
    return (int)(days(month == 12 ? year + 1 : year, month == 12 ? 1 : month + 1, 1) -
                 days(year, month, 1));
}

/* Exactly `count` digits, of a number in [min, max]; *at moves behind them. */
static bool number(const char **at, int count, int min, int max, int *ret)
{
    int value = 0;
    for (int i = 0; i < count; i++, (*at)++) {
        if (**at < '0' || **at > '9') return false;
        value = 10 * value + (**at - '0');
    }
    *ret = value;
    return value >= min && value <= max;
}

static bool take(const char **at, char c)
{
    if (**at != c) return false;
    (*at)++;
    return true;
}

/* "Z", "+01:00" or nothing, at the end. */
static bool offset(const char **at, int *ret_minutes)
{
    int hours = 0, minutes = 0;
    const char sign = **at;
    *ret_minutes = 0;
    if (take(at, 'Z')) return **at == '\0';
    if (sign != '+' && sign != '-') return sign == '\0';
    (*at)++;
    if (!number(at, 2, 0, 14, &hours) || !take(at, ':') || !number(at, 2, 0, 59, &minutes))
        return false;
    *ret_minutes = (sign == '-' ? -1 : 1) * (60 * hours + minutes);
    return **at == '\0';
}

/* Behind the 'T': adds the time to *lo and sets how long it lasts. */
static bool time_of_day(const char *at, int64_t *lo, int64_t *ret_length)
{
    int hour, minute, second = 0, zone, fraction = 0;
    if (!number(&at, 2, 0, 23, &hour) || !take(&at, ':') || !number(&at, 2, 0, 59, &minute))
        return false;
    *ret_length = MS_PER_MINUTE;
    const bool to_the_second = take(&at, ':');
    if (to_the_second) {
        if (!number(&at, 2, 0, 60, &second)) return false;
        *ret_length = MS_PER_SECOND;
    }
    if (to_the_second && take(&at, '.')) {
        int scale = 100, digits = 0;
        for (; *at >= '0' && *at <= '9'; at++, digits++, scale /= 10)
            fraction += scale * (*at - '0');
        if (digits == 0) return false;
        *ret_length = 1;
    }
    if (!offset(&at, &zone)) return false;
    *lo += (int64_t)hour * MS_PER_HOUR + (int64_t)(minute - zone) * MS_PER_MINUTE +
           (int64_t)second * MS_PER_SECOND + fraction;
    return true;
}

bool fhir_date_span(const char *text, int64_t *ret_lo, int64_t *ret_hi)
{
    int year, month = 1, day = 1;
    const char *at = text;
    if (!number(&at, 4, 1, 9999, &year)) return false;
    int64_t length = (days(year + 1, 1, 1) - days(year, 1, 1)) * ms_per_day;
    if (take(&at, '-')) {
        if (!number(&at, 2, 1, 12, &month)) return false;
        length = days_in(year, month) * ms_per_day;
        if (take(&at, '-')) {
            if (!number(&at, 2, 1, days_in(year, month), &day)) return false;
            length = ms_per_day;
        }
    }
    int64_t lo = days(year, month, day) * ms_per_day;
    if (*at == 'T' && at - text == 10) {
        if (!time_of_day(at + 1, &lo, &length)) return false;
    } else if (*at != '\0') {
        return false;
    }
    *ret_lo = lo;
    *ret_hi = lo + length;
    return true;
}

bool fhir_date_is_after(const char *a, const char *b)
{
    int64_t begins, other, end;
    return fhir_date_span(a, &begins, &end) && (!fhir_date_span(b, &other, &end) || begins > other);
}

/* 0 says that there is no bound; nothing that is looked for is older than 1970. */
static int64_t bound(int64_t ms) { return ms < 1 ? 1 : ms; }

bool fhir_date_range(const char *value, int64_t *ret_lo, int64_t *ret_hi)
{
    static const struct {
        char name[3];
        bool from, from_end, until, until_end; /* which ends of the span bound the range */
    } prefixes[] = {
        {"eq", true, false, true, true},   {"ge", true, false, false, false},
        {"gt", true, true, false, false},  {"sa", true, true, false, false},
        {"le", false, false, true, true},  {"lt", false, false, true, false},
        {"eb", false, false, true, false},
    };
    size_t p = 0;
    int64_t first, end;
    const bool plain = value[0] >= '0' && value[0] <= '9';
    while (!plain && p < sizeof prefixes / sizeof prefixes[0] &&
           strncmp(value, prefixes[p].name, 2) != 0)
        p++;
    if (p == sizeof prefixes / sizeof prefixes[0]) return false;
    if (!fhir_date_span(plain ? value : value + 2, &first, &end)) return false;
    *ret_lo = prefixes[p].from ? bound(prefixes[p].from_end ? end : first) : 0;
    *ret_hi = prefixes[p].until ? bound(prefixes[p].until_end ? end : first) : 0;
    return true;
}
