/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <float.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "solver/lanes.h"
#include "tests/unit/near.h"

/* Another number in each lane. */
static lanes ramp(double first, double step)
{
    lanes x = lanes_all(first);
    for (int l = 0; l < LANES; l++) x[l] += step * l;
    return x;
}

static void inverse_cube_roots_are_rounded_well(void **state)
{
    (void)state;
    for (int k = -120000; k <= 120000; k++) {
        const double x = pow(10, k * 1e-4);
        const lanes root = lanes_inverse_cbrt(ramp(x, x));
        for (int l = 0; l < LANES; l++)
            assert_near(root[l] * cbrt(x * (l + 1)), 1, 3 * DBL_EPSILON);
    }
    for (int k = -900; k <= 900; k++) { /* powers of eight, whose roots are exact */
        const double root = lanes_inverse_cbrt(lanes_all(ldexp(1, k / 3 * 3)))[0];
        assert_near(root * ldexp(1, k / 3), 1, DBL_EPSILON);
    }
}

static void square_roots_are_the_librarys(void **state)
{
    (void)state;
    const lanes x = ramp(2, 0.7), root = lanes_sqrt(x);
    for (int l = 0; l < LANES; l++) assert_true(root[l] == sqrt(x[l]));
}

static void choices_are_made_lane_by_lane(void **state)
{
    (void)state;
    const lanes x = ramp(-1, 2), y = ramp(1, -2); /* -1 1 3 ..., 1 -1 -3 ... */
    const lanes least = lanes_min(x, y), most = lanes_max(x, y), size = lanes_abs(x);
    const lanes kept = lanes_where(x > 0, x), chosen = lanes_select(x > 0, x, lanes_all(7));
    for (int l = 0; l < LANES; l++) {
        assert_true(least[l] == -fabs(x[l]) && most[l] == fabs(x[l]) && size[l] == fabs(x[l]));
        assert_true(kept[l] == (x[l] > 0 ? x[l] : 0));
        assert_true(chosen[l] == (x[l] > 0 ? x[l] : 7));
    }
    assert_true(lanes_any(x < 0));
    assert_true(lanes_any(x > 0));
    assert_false(lanes_any(x > 2.0 * LANES));
}

static void numbers_that_are_none_stay_in_their_lane(void **state)
{
    (void)state;
    lanes x = ramp(1, 1);
    x[LANES - 1] = (double)NAN;
    assert_true(lanes_inverse_cbrt(x)[0] == lanes_inverse_cbrt(ramp(1, 1))[0]);
    assert_false(lanes_any((x < 0) & (x > 0)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(inverse_cube_roots_are_rounded_well),
        cmocka_unit_test(square_roots_are_the_librarys),
        cmocka_unit_test(choices_are_made_lane_by_lane),
        cmocka_unit_test(numbers_that_are_none_stay_in_their_lane),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
