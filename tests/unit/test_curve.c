/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "solver/curve.h"
#include "tests/unit/near.h"

/* Four functions of the force that curve each in its own way. */
static struct ischia_load_point dense_at(double F_N)
{
    return (struct ischia_load_point){.F_N = F_N,
                                      .displacement_mm = log1p(F_N),
                                      .eps_max = sqrt(F_N),
                                      .E_shear_max = F_N * F_N,
                                      .E_comp_max = sin(F_N / 10)};
}

/* What is added to them: straight lines through rest. */
static struct ischia_load_point shifted_at(double F_N)
{
    struct ischia_load_point p = dense_at(F_N);
    p.displacement_mm += 0.5 * F_N;
    p.eps_max -= 0.01 * F_N;
    p.E_shear_max += 3 * F_N;
    p.E_comp_max -= 2 * F_N;
    return p;
}

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

/* Where the two curves differ by a straight line, refinement is exact. */
static void refinement_carries_the_difference_on(void **state)
{
    (void)state;
    static const double fine_N[] = {8, 20, 32};
    static const double expected_N[] = {2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30, 32};
    struct load_curve fine = {.count = 0}, dense = {.count = 0};
    for (int i = 1; i <= 20; i++) {
        const struct ischia_load_point p = dense_at(2 * i);
        load_curve_add(&dense, &p);
    }
    for (int i = 0; i < 3; i++) {
        const struct ischia_load_point p = shifted_at(fine_N[i]);
        load_curve_add(&fine, &p);
    }
    load_curve_refine(&fine, &dense);
    assert_int_equal(fine.count, 16); /* each once: three are the fine curve's own */
    for (int i = 0; i < fine.count; i++) {
        const struct ischia_load_point expected = shifted_at(expected_N[i]);
        same_point(&fine.point[i], &expected);
    }
}

/* No two points that say the same. */
static void dense_points_beside_a_fine_one_are_left_out(void **state)
{
    (void)state;
    static const double dense_N[] = {1, 9, 10.5, 15, 19.5};
    struct load_curve fine = {.count = 0}, dense = {.count = 0};
    for (int i = 0; i < 5; i++) {
        const struct ischia_load_point p = dense_at(dense_N[i]);
        load_curve_add(&dense, &p);
    }
    for (int i = 1; i <= 2; i++) {
        const struct ischia_load_point p = shifted_at(10 * i);
        load_curve_add(&fine, &p);
    }
    load_curve_refine(&fine, &dense);
    assert_int_equal(fine.count, 3);
    assert_near(fine.point[1].F_N, 15, 1e-15);
}

static void nothing_to_refine_with_changes_nothing(void **state)
{
    (void)state;
    struct load_curve fine = {.count = 0}, dense = {.count = 0};
    const struct ischia_load_point p = shifted_at(7);
    load_curve_add(&fine, &p);
    load_curve_refine(&fine, &dense);
    assert_int_equal(fine.count, 1);
    same_point(&fine.point[0], &p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(between_points_it_is_linear_from_rest_on),
        cmocka_unit_test(forces_only_rise),
        cmocka_unit_test(refinement_carries_the_difference_on),
        cmocka_unit_test(dense_points_beside_a_fine_one_are_left_out),
        cmocka_unit_test(nothing_to_refine_with_changes_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
