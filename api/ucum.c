/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/ucum.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/text.h"

/* Factors as UCUM defines them: inch 25.4 mm, pound-force 4.4482216152605 N, gram-force 9.80665e-3
 * N, metre of mercury 133.322 kPa. */
static const struct ucum_unit units[] = {
    {"mm", "mm", 0, 1},         {"cm", "mm", 1, 1},        {"m", "mm", 3, 1},
    {"um", "mm", -3, 1},        {"[in_i]", "mm", 0, 25.4}, {"kPa", "kPa", 0, 1},
    {"Pa", "kPa", -3, 1},       {"hPa", "kPa", -1, 1},     {"MPa", "kPa", 3, 1},
    {"N/mm2", "kPa", 3, 1},     {"N/cm2", "kPa", 1, 1},    {"mm[Hg]", "kPa", 0, 0.133322},
    {"N", "N", 0, 1},           {"mN", "N", -3, 1},        {"kN", "N", 3, 1},
    {"gf", "N", 0, 0.00980665}, {"kgf", "N", 0, 9.80665},  {"[lbf_av]", "N", 0, 4.4482216152605},
};
enum { UNIT_COUNT = sizeof units / sizeof units[0] };
enum { FAR = 9999 }; /* beyond any double, whichever way, behind the digits that JSON may have */

const struct ucum_unit *ucum_unit_at(size_t index)
{
    return index < UNIT_COUNT ? &units[index] : NULL;
}

static const struct ucum_unit *find(const char *code)
{
    for (size_t i = 0; i < UNIT_COUNT; i++)
        if (strcmp(units[i].code, code) == 0) return &units[i];
    return NULL;
}

/* "7.1e2" with a power of -1: "7.1e1". */
static void shift(const char *digits, int power, char ret[UCUM_DIGITS_BYTES])
{
    const size_t mantissa = strcspn(digits, "eE");
    const long given = digits[mantissa] == '\0' ? 0 : strtol(digits + mantissa + 1, NULL, 10);
    const long exponent = given < -FAR ? -FAR : given > FAR ? FAR : given;
    (void)snprintf(ret, UCUM_DIGITS_BYTES, "%.*se%ld", (int)mantissa, digits, exponent + power);
}

enum ucum_answer ucum_convert(const char *digits, const char *from, const char *to,
                              char ret[UCUM_DIGITS_BYTES])
{
    const struct ucum_unit *unit = find(from);
    if (unit == NULL) return UCUM_UNKNOWN;
    if (strcmp(unit->canonical, to) != 0) return UCUM_OTHER_KIND;
    if (strcmp(from, to) == 0)
        (void)snprintf(ret, UCUM_DIGITS_BYTES, "%s", digits);
    else if (unit->factor == 1)
        shift(digits, unit->power, ret);
    else
        (void)snprintf(ret, UCUM_DIGITS_BYTES, "%.17g", strtod(digits, NULL) * unit->factor);
    return UCUM_CONVERTED;
}

const char *ucum_known(const char *to, char *buffer, size_t size)
{
    size_t used = 0;
    buffer[0] = '\0';
    for (size_t i = 0; i < UNIT_COUNT; i++) {
        if (strcmp(units[i].canonical, to) != 0) continue;
        const int n =
            snprintf(buffer + used, size - used, "%s%s", used == 0 ? "" : ", ", units[i].code);
        if (n < 0 || (size_t)n >= size - used) break;
        used += (size_t)n;
    }
    buffer[used] = '\0';
    return buffer;
}
