/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "solver/units.h"
#include "tests/unit/near.h"

static void a_side_is_four_quarters(void **state)
{
    (void)state;
    assert_true(quarter_force_N(196) == 49);
    assert_true(side_force_N(49) == 196);
    assert_true(side_extent(1.5) == 6);
    assert_true(side_force_N(quarter_force_N(0.1)) == 0.1);
}

/* 1 kPa on 1 mm2 is a thousandth of a newton; 1 MPa is 1 N/mm2. */
static void moduli_are_a_thousandth_inside(void **state)
{
    (void)state;
    assert_near(MPa_from_kPa(8), 0.008, 1e-18);
    assert_near(kPa_from_MPa(MPa_from_kPa(2.75)), 2.75, 1e-15);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_side_is_four_quarters),
        cmocka_unit_test(moduli_are_a_thousandth_inside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
