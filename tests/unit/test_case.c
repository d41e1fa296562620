/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/case.h"

/* Row 1R of Table 2. */
static struct ischia_case row_1R(void)
{
    static const double param[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8.0, 5.0, 196};
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, param, sizeof param);
    return c;
}

static void tables_are_complete(void **state)
{
    (void)state;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct ischia_param_info *p = &ischia_params[i];
        assert_non_null(p->key);
        assert_non_null(p->unit);
        assert_true(p->accepted_min > 0 && p->accepted_min < p->studied_min);
        assert_true(p->studied_min < p->studied_max && p->studied_max < p->accepted_max);
    }
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++) {
        const struct ischia_option_info *o = &ischia_options[i];
        assert_non_null(o->group);
        assert_non_null(o->key);
        assert_true(o->default_value >= o->accepted_min && o->default_value <= o->accepted_max);
        assert_true(ischia_presets[0].option[i] == o->default_value);
    }
    for (int i = 0; i < ISCHIA_RESOLUTION_COUNT; i++) assert_non_null(ischia_resolution_names[i]);
}

static void every_preset_is_a_model_that_can_be_solved(void **state)
{
    (void)state;
    assert_string_equal(ischia_presets[1].name, "as-published");
    assert_true(ischia_presets[1].option[ISCHIA_BULK_RATIO] == 100);
    for (int i = 0; i < ISCHIA_PRESET_COUNT; i++) {
        struct ischia_case c = row_1R();
        memcpy(c.option, ischia_presets[i].option, sizeof c.option);
        assert_true(ischia_case_is_valid(&c));
    }
}

static void a_default_case_misses_all_inputs(void **state)
{
    (void)state;
    const struct ischia_case c = ischia_case_default();
    struct ischia_case_fault faults[ISCHIA_CASE_FAULTS_MAX];
    assert_int_equal(ischia_case_faults(&c, faults), ISCHIA_PARAM_COUNT);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        assert_int_equal(faults[i].index, i);
        assert_int_equal(faults[i].kind, ISCHIA_CASE_MISSING);
    }
    assert_false(ischia_case_is_valid(&c));
}

static void a_row_of_table_2_is_valid_without_warning(void **state)
{
    (void)state;
    const struct ischia_case c = row_1R();
    struct ischia_case_fault warnings[ISCHIA_PARAM_COUNT];
    assert_true(ischia_case_is_valid(&c));
    assert_int_equal(ischia_case_warnings(&c, warnings), 0);
}

static void faults_name_the_number_and_what_is_wrong(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    struct ischia_case_fault faults[ISCHIA_CASE_FAULTS_MAX];
    c.param[ISCHIA_MUM] = 80;
    c.option[ISCHIA_SKIN_MU] = -1;
    assert_int_equal(ischia_case_faults(&c, faults), 2);
    assert_int_equal(faults[0].kind, ISCHIA_CASE_OUT_OF_RANGE);
    assert_int_equal(faults[0].index, ISCHIA_MUM);
    assert_int_equal(faults[1].kind, ISCHIA_CASE_OUT_OF_RANGE);
    assert_int_equal(faults[1].index, ISCHIA_PARAM_COUNT + ISCHIA_SKIN_MU);
}

static void swapped_radii_are_inconsistent(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    struct ischia_case_fault faults[ISCHIA_CASE_FAULTS_MAX];
    c.param[ISCHIA_R1] = 12;
    c.param[ISCHIA_R2] = 9;
    assert_int_equal(ischia_case_faults(&c, faults), 1);
    assert_int_equal(faults[0].kind, ISCHIA_CASE_ORDER);
    assert_int_equal(faults[0].index, ISCHIA_R2);
}

static void infinity_is_out_of_range(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    c.param[ISCHIA_F] = (double)INFINITY;
    assert_false(ischia_case_is_valid(&c));
}

static void outside_the_study_is_a_warning(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    struct ischia_case_fault warnings[ISCHIA_PARAM_COUNT];
    c.param[ISCHIA_R2] = 80;
    assert_true(ischia_case_is_valid(&c));
    assert_int_equal(ischia_case_warnings(&c, warnings), 1);
    assert_int_equal(warnings[0].kind, ISCHIA_CASE_UNSTUDIED);
    assert_int_equal(warnings[0].index, ISCHIA_R2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tables_are_complete),
        cmocka_unit_test(every_preset_is_a_model_that_can_be_solved),
        cmocka_unit_test(a_default_case_misses_all_inputs),
        cmocka_unit_test(a_row_of_table_2_is_valid_without_warning),
        cmocka_unit_test(faults_name_the_number_and_what_is_wrong),
        cmocka_unit_test(swapped_radii_are_inconsistent),
        cmocka_unit_test(infinity_is_out_of_range),
        cmocka_unit_test(outside_the_study_is_a_warning),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
