/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/samples.h"

#include "api/parameters_doc.h"
#include "api/risk.h"

static struct json *root;

static int set_up(void **state)
{
    struct ischia_error err;
    struct doc_faults faults;
    char *text;
    (void)state;
    doc_faults_init(&faults);
    if (parameters_doc_text(&text, LANGUAGE_EN, 2, &err) != ISCHIA_OK) return -1;
    const enum ischia_code code =
        json_parse(&root, text, strlen(text), &json_limits_stored, &faults, &err);
    free(text);
    return code == ISCHIA_OK && faults.count == 0 ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    json_destroy(root);
    return 0;
}

static const struct json *element(const char *array, int index)
{
    const struct json *m = json_first(json_member(root, array));
    while (index-- > 0) m = json_next(m);
    return m;
}

static double number_in(const struct json *object, const char *group, const char *key)
{
    return json_number(json_member(json_member(object, group), key));
}

static void every_parameter_as_the_table_has_it(void **state)
{
    (void)state;
    assert_int_equal(json_count(json_member(root, "parameters")), ISCHIA_PARAM_COUNT);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct json *p = element("parameters", i);
        assert_string_equal(json_string(json_member(p, "key")), ischia_params[i].key);
        assert_string_equal(json_string(json_member(p, "unit")), ischia_params[i].unit);
        assert_true(number_in(p, "accepted", "min") == ischia_params[i].accepted_min);
        assert_true(number_in(p, "accepted", "max") == ischia_params[i].accepted_max);
        assert_true(number_in(p, "studied", "min") == ischia_params[i].studied_min);
        assert_true(number_in(p, "studied", "max") == ischia_params[i].studied_max);
    }
}

/* What the document calls an alias is one that the reader takes. */
static void aliases_work(void **state)
{
    (void)state;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct json *aliases = json_member(element("parameters", i), "aliases");
        const bool greek = i == ISCHIA_MUM || i == ISCHIA_MUF;
        assert_int_equal(json_count(aliases), greek ? 2 : 0);
        for (const struct json *a = json_first(aliases); a != NULL; a = json_next(a))
            assert_string_equal(case_doc_canonical_key(json_string(a)), ischia_params[i].key);
    }
}

static void options_presets_and_bands(void **state)
{
    (void)state;
    assert_int_equal(json_count(json_member(root, "options")), ISCHIA_OPTION_COUNT);
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++)
        assert_true(json_number(json_member(element("options", i), "default")) ==
                    ischia_options[i].default_value);
    assert_string_equal(json_string(json_member(element("options", 0), "pointer")), "/skin/mu");
    assert_int_equal(json_count(json_member(root, "presets")), ISCHIA_PRESET_COUNT);
    assert_true(number_in(element("presets", 0), "model", "friction") ==
                ischia_presets[0].option[ISCHIA_FRICTION]);
    assert_int_equal(json_count(json_member(root, "resolutions")), ISCHIA_RESOLUTION_COUNT);
    assert_int_equal(json_count(json_member(root, "bands")), RISK_BAND_COUNT);
    assert_int_equal(json_count(json_member(root, "caveats")), RISK_CAVEAT_COUNT);
    assert_true(number_in(root, "thresholds", "E_shear") == ISCHIA_E_SHEAR_THRESHOLD);
    assert_int_equal(json_count(json_member(root, "fields")), 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_parameter_as_the_table_has_it),
        cmocka_unit_test(aliases_work),
        cmocka_unit_test(options_presets_and_bands),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
