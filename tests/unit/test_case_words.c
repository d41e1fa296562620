/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "api/case_words.h"

static struct ischia_case row_1R(void)
{
    static const double param[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8, 5, 196};
    struct ischia_case c = ischia_case_default();
    memcpy(c.param, param, sizeof param);
    return c;
}

/* The one fault of the case, in words. */
static struct ischia_fault only_fault(const struct ischia_case *c, enum language language)
{
    struct ischia_case_fault found[ISCHIA_CASE_FAULTS_MAX];
    struct ischia_fault fault;
    assert_int_equal(ischia_case_faults(c, found), 1);
    case_fault_words(&fault, language, c, &found[0]);
    return fault;
}

static void a_fault_names_field_value_and_range(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    c.param[ISCHIA_MUM] = 80.5;
    struct ischia_fault fault = only_fault(&c, LANGUAGE_EN);
    assert_string_equal(fault.pointer, "/muM");
    assert_string_equal(fault.code, "out_of_range");
    assert_string_equal(fault.detail, "muM is 80.5 kPa; accepted 0.5 to 30 kPa");
    fault = only_fault(&c, LANGUAGE_FR);
    assert_string_equal(fault.pointer, "/muM");
    assert_string_equal(fault.code, "out_of_range");
    assert_non_null(strstr(fault.detail, "80,5 kPa"));
    assert_non_null(strstr(fault.detail, "0,5 à 30 kPa"));
}

static void an_option_is_named_with_its_group(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    c.option[ISCHIA_FRICTION] = -1;
    const struct ischia_fault fault = only_fault(&c, LANGUAGE_EN);
    assert_string_equal(fault.pointer, "/model/friction");
    assert_string_equal(fault.detail, "model.friction is -1; accepted 0 to 2");
}

static void what_is_missing_and_what_is_swapped(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    c.param[ISCHIA_F] = (double)NAN;
    struct ischia_fault fault = only_fault(&c, LANGUAGE_EN);
    assert_string_equal(fault.code, "missing");
    assert_string_equal(fault.detail, "F is missing; accepted 1 to 600 N");
    c = row_1R();
    c.param[ISCHIA_R1] = 12;
    c.param[ISCHIA_R2] = 9;
    fault = only_fault(&c, LANGUAGE_DE);
    assert_string_equal(fault.code, "inconsistent");
    assert_non_null(strstr(fault.detail, "vertauscht?"));
}

static void outside_the_study_is_a_warning(void **state)
{
    (void)state;
    struct ischia_case c = row_1R();
    struct ischia_fault warnings[ISCHIA_PARAM_COUNT];
    c.param[ISCHIA_R2] = 80;
    assert_int_equal(case_warnings(&c, LANGUAGE_EN, warnings), 1);
    assert_string_equal(warnings[0].pointer, "/R2");
    assert_string_equal(warnings[0].code, "outside_study_range");
    assert_string_equal(warnings[0].detail,
                        "R2 is 80 mm; the published study covers 15 to 63.3 mm");
    assert_int_equal(case_warnings(&c, LANGUAGE_DE, warnings), 1);
    assert_non_null(strstr(warnings[0].detail, "15 bis 63,3 mm"));
}

static void every_input_has_a_name_and_a_help(void **state)
{
    (void)state;
    for (int l = 0; l < LANGUAGE_COUNT; l++)
        for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
            assert_true(strlen(words_get((enum language)l, param_words[i].name)) > 3);
            assert_true(strlen(words_get((enum language)l, param_words[i].help)) > 20);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_fault_names_field_value_and_range),
        cmocka_unit_test(an_option_is_named_with_its_group),
        cmocka_unit_test(what_is_missing_and_what_is_swapped),
        cmocka_unit_test(outside_the_study_is_a_warning),
        cmocka_unit_test(every_input_has_a_name_and_a_help),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
