/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "server/cli/study_sides.h"

static void add_factor(struct design *d, const char *name, int levels, const double *level)
{
    struct design_factor *f = &d->factor[d->factor_count++];
    assert_true(design_factor_find(name, f));
    f->level_count = levels;
    memcpy(f->level, level, (size_t)levels * sizeof *level);
}

/* F first, so that it changes slowest. */
static struct design two_sides(void)
{
    struct design d = {.kind = DESIGN_FULL, .base = ischia_case_default(), .axial = 1};
    static const double other[] = {7, 7, 30, 20, 8, 8};
    for (int p = 0; p < 6; p++) d.base.param[p] = other[p];
    add_factor(&d, "F", 3, (const double[]){100, 200, 300});
    add_factor(&d, "eM", 2, (const double[]){20, 30});
    return d;
}

static bool all(void *context, size_t row)
{
    (void)context;
    (void)row;
    return true;
}

static bool all_but_one(void *context, size_t row) { return row != *(const size_t *)context; }

static void rows_of_a_side_stay_together_forces_rising(void **state)
{
    (void)state;
    static const size_t row[] = {0, 2, 4, 1, 3, 5}, side[] = {0, 0, 0, 1, 1, 1};
    const struct design d = two_sides();
    struct design_points p;
    struct study_sides s;
    assert_int_equal(design_points_init(&p, &d, DESIGN_ROWS_MAX, NULL), ISCHIA_OK);
    assert_int_equal(study_sides_init(&s, &d, &p, all, NULL, NULL), ISCHIA_OK);
    assert_int_equal(s.count, 6);
    assert_memory_equal(s.row, row, sizeof row);
    assert_memory_equal(s.side, side, sizeof side);
    assert_int_equal(study_sides_end(&s, 0), 3);
    assert_int_equal(study_sides_end(&s, 4), 6);
    assert_int_equal(study_sides_end(&s, 6), 6);
    study_sides_finish(&s);
    design_points_finish(&p);
}

static void rows_that_are_there_are_left_out(void **state)
{
    (void)state;
    static const size_t row[] = {0, 2, 1, 3, 5};
    size_t there = 4;
    const struct design d = two_sides();
    struct design_points p;
    struct study_sides s;
    assert_int_equal(design_points_init(&p, &d, DESIGN_ROWS_MAX, NULL), ISCHIA_OK);
    assert_int_equal(study_sides_init(&s, &d, &p, all_but_one, &there, NULL), ISCHIA_OK);
    assert_int_equal(s.count, 5);
    assert_memory_equal(s.row, row, sizeof row);
    assert_int_equal(study_sides_end(&s, 0), 2);
    study_sides_finish(&s);
    design_points_finish(&p);
}

static void a_shard_has_whole_sides(void **state)
{
    (void)state;
    static const bool first[] = {true, false, true, false, true, false};
    const struct design d = two_sides();
    struct design_points p;
    bool mine[6];
    assert_int_equal(design_points_init(&p, &d, DESIGN_ROWS_MAX, NULL), ISCHIA_OK);
    assert_int_equal(study_sides_deal(&d, &p, 0, 2, mine, NULL), ISCHIA_OK);
    assert_memory_equal(mine, first, sizeof first);
    assert_int_equal(study_sides_deal(&d, &p, 1, 2, mine, NULL), ISCHIA_OK);
    for (int row = 0; row < 6; row++) assert_true(mine[row] != first[row]);
    design_points_finish(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_of_a_side_stay_together_forces_rising),
        cmocka_unit_test(rows_that_are_there_are_left_out),
        cmocka_unit_test(a_shard_has_whole_sides),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
