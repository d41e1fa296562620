/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "solver/curve.h"
#include "tests/unit/near.h"

static void same_point(const struct ischia_load_point *a, const struct ischia_load_point *b)
{
    assert_near(a->F_N, b->F_N, 1e-12);
    assert_near(a->displacement_mm, b->displacement_mm, 1e-12);
    assert_near(a->eps_max, b->eps_max, 1e-12);
    assert_near(a->E_shear_max, b->E_shear_max, 1e-12);
    assert_near(a->E_comp_max, b->E_comp_max, 1e-12);
}

static void between_points_it_is_linear_from_rest_on(void **state)
{
    (void)state;
    struct load_curve curve = {.count = 0};
    const struct ischia_load_point first = {10, 2, 0.2, 0.4, 0.1}, second = {20, 3, 0.4, 0.8, 0.3};
    const struct ischia_load_point half = {5, 1, 0.1, 0.2, 0.05}, later = {15, 2.5, 0.3, 0.6, 0.2};
    load_curve_add(&curve, &first);
    load_curve_add(&curve, &second);
    struct ischia_load_point p = load_curve_at(&curve, 5);
    same_point(&p, &half);
    p = load_curve_at(&curve, 15);
    same_point(&p, &later);
    p = load_curve_at(&curve, 99); /* the last beyond it */
    same_point(&p, &second);
}

static void forces_only_rise(void **state)
{
    (void)state;
    struct load_curve curve = {.count = 0};
    load_curve_add(&curve, &(struct ischia_load_point){.F_N = 10});
    load_curve_add(&curve, &(struct ischia_load_point){.F_N = 10});
    load_curve_add(&curve, &(struct ischia_load_point){.F_N = 9});
    assert_int_equal(curve.count, 1);
    for (int i = 0; i < 2 * ISCHIA_LOAD_POINTS_MAX; i++)
        load_curve_add(&curve, &(struct ischia_load_point){.F_N = 11 + i});
    assert_int_equal(curve.count, ISCHIA_LOAD_POINTS_MAX);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(between_points_it_is_linear_from_rest_on),
        cmocka_unit_test(forces_only_rise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
