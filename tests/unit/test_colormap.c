/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/colormap.h"

/* CIE 1976 lightness L* of an sRGB colour (IEC 61966-2-1, white point D65). */
static double lightness(const unsigned char rgb[3])
{
    static const double weight[3] = {0.2126, 0.7152, 0.0722};
    double Y = 0;
    for (int k = 0; k < 3; k++) {
        const double c = rgb[k] / 255.0;
        Y += weight[k] * (c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4));
    }
    return Y > 216.0 / 24389 ? 116 * cbrt(Y) - 16 : Y * 24389 / 27;
}

static void lightness_falls_evenly(void **state)
{
    (void)state;
    enum { STEPS = 14 };
    unsigned char rgb[3];
    double first = 0, last = 0;
    colormap(0, rgb);
    first = lightness(rgb);
    colormap(1, rgb);
    last = lightness(rgb);
    assert_true(first > 90 && last < 15);
    for (int i = 0; i <= STEPS; i++) {
        colormap((double)i / STEPS, rgb);
        assert_true(fabs(lightness(rgb) - (first + (last - first) * i / STEPS)) < 4);
    }
}

static void fractions_are_clamped(void **state)
{
    (void)state;
    unsigned char a[3], b[3];
    colormap(0, a);
    colormap(-3, b);
    assert_memory_equal(a, b, 3);
    colormap(1, a);
    colormap(7, b);
    assert_memory_equal(a, b, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lightness_falls_evenly),
        cmocka_unit_test(fractions_are_clamped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
