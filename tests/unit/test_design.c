/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "near.h"
#include "solver/study/design.h"

static void add_factor(struct design *d, const char *name, int levels, const double *level)
{
    struct design_factor *f = &d->factor[d->factor_count++];
    assert_true(design_factor_find(name, f));
    f->level_count = levels;
    memcpy(f->level, level, (size_t)levels * sizeof *level);
}

static struct design seven_factors(enum design_kind kind)
{
    static const char *const name[] = {"R1", "R2", "eM", "eF", "muM", "muF", "F"};
    const double level[] = {5, 7, 9};
    struct design d = {.kind = kind, .base = ischia_case_default(), .axial = 1};
    for (int f = 0; f < 7; f++) add_factor(&d, name[f], 3, level);
    return d;
}

static struct design_points points_of(const struct design *d)
{
    struct design_points p;
    assert_true(design_is_valid(d));
    assert_int_equal(design_points_init(&p, d, DESIGN_ROWS_MAX, NULL), ISCHIA_OK);
    return p;
}

static void a_full_factorial_has_every_combination_once(void **state)
{
    (void)state;
    const struct design d = seven_factors(DESIGN_FULL);
    struct design_points p = points_of(&d);
    static unsigned char seen[2187];
    memset(seen, 0, sizeof seen);
    assert_int_equal(p.count, 2187);
    for (size_t row = 0; row < p.count; row++) {
        int number = 0;
        for (int f = 0; f < 7; f++)
            number = number * 3 + (int)((p.value[row * 7 + (size_t)f] - 5) / 2);
        assert_int_equal(number, row); /* last factor fastest */
        seen[number]++;
    }
    for (int i = 0; i < 2187; i++) assert_int_equal(seen[i], 1);
    design_points_finish(&p);
}

/* Resolution V: the 36 terms of a quadratic keep apart, which their Gram matrix shows. */
static void a_ninth_fraction_keeps_pairs_balanced(void **state)
{
    (void)state;
    struct design d = seven_factors(DESIGN_FULL);
    const int generator[2][7] = {{1, 1, 0, 0, 1, 1, 1}, {0, 0, 1, 1, 1, 1, 2}};
    d.modulus = 3;
    d.generator_count = 2;
    for (int g = 0; g < 2; g++) memcpy(d.generator[g], generator[g], sizeof generator[g]);
    struct design_points p = points_of(&d);
    assert_int_equal(p.count, 243);
    for (int i = 0; i < 7; i++) {
        for (int j = 0; j < i; j++) {
            int hits[9] = {0};
            for (size_t row = 0; row < p.count; row++)
                hits[(int)(p.value[row * 7 + (size_t)i] - 5) / 2 * 3 +
                     (int)(p.value[row * 7 + (size_t)j] - 5) / 2]++;
            for (int k = 0; k < 9; k++) assert_int_equal(hits[k], 27);
        }
    }
    design_points_finish(&p);
}

static void a_central_composite_has_corners_axes_and_centre(void **state)
{
    (void)state;
    struct design d = seven_factors(DESIGN_CENTRAL_COMPOSITE);
    struct design_points p = points_of(&d);
    assert_int_equal(p.count, 128 + 14 + 1);
    design_points_finish(&p);
    d.modulus = 2;
    d.generator_count = 1;
    for (int f = 0; f < 7; f++) d.generator[0][f] = 1;
    p = points_of(&d);
    assert_int_equal(p.count, 64 + 14 + 1);
    const double *axial = &p.value[64 * 7], *centre = &p.value[78 * 7];
    assert_true(axial[0] == 5 && axial[1] == 7 && axial[7] == 9);
    for (int f = 0; f < 7; f++) assert_true(centre[f] == 7);
    design_points_finish(&p);
}

static void space_filling_points_stay_inside(void **state)
{
    (void)state;
    for (enum design_kind kind = DESIGN_SOBOL; kind <= DESIGN_HALTON; kind++) {
        struct design d = seven_factors(kind);
        d.points = 200;
        d.seed = 3;
        struct design_points p = points_of(&d);
        assert_int_equal(p.count, 200);
        for (size_t i = 0; i < 200 * 7; i++) assert_true(p.value[i] >= 5 && p.value[i] < 9);
        design_points_finish(&p);
    }
}

static void a_log_factor_goes_by_ratio(void **state)
{
    struct design d = {
        .kind = DESIGN_SOBOL, .points = 64, .seed = 3, .base = ischia_case_default()};
    struct design_points points;
    (void)state;
    add_factor(&d, "muM", 2, (const double[]){0.5, 32});
    d.factor[0].log = true;
    assert_true(design_is_valid(&d));
    assert_int_equal(design_points_init(&points, &d, 64, NULL), ISCHIA_OK);
    int below = 0;
    for (size_t i = 0; i < points.count; i++) {
        assert_true(points.value[i] >= 0.5 && points.value[i] <= 32);
        below += points.value[i] < 4; /* the geometric middle */
    }
    assert_int_equal(below, 32);
    assert_true(fabs(design_normalised(&d.factor[0], 4)) < 1e-12);
    assert_true(fabs(design_normalised(&d.factor[0], 0.5) + 1) < 1e-12);
    design_points_finish(&points);
    d.factor[0].level[0] = 0;
    assert_false(design_is_valid(&d));
}

static void each_morris_step_moves_one_factor(void **state)
{
    (void)state;
    struct design d = seven_factors(DESIGN_MORRIS);
    d.paths = 12;
    d.path_levels = 4;
    d.seed = 5;
    struct design_points p = points_of(&d);
    assert_int_equal(p.count, 12 * 8);
    for (size_t path = 0; path < 12; path++) {
        int moved[7] = {0};
        for (size_t step = 1; step < 8; step++) {
            const double *now = &p.value[(path * 8 + step) * 7], *before = now - 7;
            int changes = 0;
            for (int f = 0; f < 7; f++) {
                if (now[f] == before[f]) continue;
                changes++;
                moved[f]++;
                assert_near(fabs(now[f] - before[f]), 4 * 2.0 / 3, 1e-12);
                assert_true(now[f] >= 5 && now[f] <= 9);
            }
            assert_int_equal(changes, 1);
        }
        for (int f = 0; f < 7; f++) assert_int_equal(moved[f], 1);
    }
    design_points_finish(&p);
}

static void options_are_factors_too(void **state)
{
    (void)state;
    const double level[] = {20, 2000};
    struct design d = {.kind = DESIGN_FULL, .base = ischia_case_default()};
    char name[DESIGN_NAME_BYTES];
    add_factor(&d, "model.bulk_ratio", 2, level);
    struct design_points p = points_of(&d);
    assert_string_equal(design_factor_name(&d.factor[0], name), "model.bulk_ratio");
    assert_int_equal(p.count, 2);
    assert_true(design_case(&d, &p, 0).option[ISCHIA_BULK_RATIO] == 20);
    assert_true(design_case(&d, &p, 1).option[ISCHIA_FRICTION] == 0.4);
    design_points_finish(&p);
}

static void bad_designs_are_invalid(void **state)
{
    (void)state;
    struct design d = seven_factors(DESIGN_FULL);
    struct design_factor unknown;
    assert_false(design_factor_find("muX", &unknown));
    d.factor[1] = d.factor[0];
    assert_false(design_is_valid(&d));
    d = seven_factors(DESIGN_FULL);
    d.factor[0].level[1] = d.factor[0].level[0];
    assert_false(design_is_valid(&d));
    d = seven_factors(DESIGN_MORRIS);
    d.paths = 3;
    d.path_levels = 3;
    assert_false(design_is_valid(&d));
}

static void a_design_beyond_the_limit_is_refused(void **state)
{
    (void)state;
    const double level[] = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8};
    struct design d = {.kind = DESIGN_FULL, .base = ischia_case_default()};
    static const char *const name[] = {"R1", "R2", "eM", "eF", "muM", "muF", "F"};
    struct design_points p;
    for (int f = 0; f < 7; f++) add_factor(&d, name[f], 8, level);
    assert_int_equal(design_points_init(&p, &d, DESIGN_ROWS_MAX, NULL), ISCHIA_E_LIMIT);
    /* 8^7 combinations, of which one in 2^4 would be kept: too many to look at for 1000 rows */
    d.modulus = 2;
    d.generator_count = 4;
    assert_int_equal(design_points_init(&p, &d, 1000, NULL), ISCHIA_E_LIMIT);
    d = seven_factors(DESIGN_SOBOL);
    d.points = DESIGN_ROWS_MAX;
    assert_int_equal(design_points_init(&p, &d, 1000, NULL), ISCHIA_E_LIMIT);
    d.points = 1000;
    assert_int_equal(design_points_init(&p, &d, 1000, NULL), ISCHIA_OK);
    design_points_finish(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_full_factorial_has_every_combination_once),
        cmocka_unit_test(a_ninth_fraction_keeps_pairs_balanced),
        cmocka_unit_test(a_central_composite_has_corners_axes_and_centre),
        cmocka_unit_test(space_filling_points_stay_inside),
        cmocka_unit_test(a_log_factor_goes_by_ratio),
        cmocka_unit_test(each_morris_step_moves_one_factor),
        cmocka_unit_test(options_are_factors_too),
        cmocka_unit_test(bad_designs_are_invalid),
        cmocka_unit_test(a_design_beyond_the_limit_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
