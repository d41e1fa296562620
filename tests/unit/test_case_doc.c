/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/samples.h"

#include "api/case_doc.h"
#include "api/case_keys.h"

#define GOOD "\"R1\":7.1,\"R2\":22.8,\"eM\":31,\"eF\":10,\"muM\":8,\"muF\":5,\"F\":258"

static struct ischia_request request;
static struct doc_faults faults;
static struct ischia_error err;

static enum ischia_code read_json(const char *text)
{
    doc_faults_init(&faults);
    return case_doc_read(&request, text, strlen(text), &json_limits_request, &faults, &err);
}

static enum ischia_code read_form(const char *text)
{
    doc_faults_init(&faults);
    return case_doc_read_form(&request, text, strlen(text), 65536, &faults, &err);
}

static void expect_faults(size_t count)
{
    if (faults.count != count)
        for (size_t i = 0; i < faults.count; i++)
            print_error("%s %s: %s\n", faults.item[i].pointer, faults.item[i].code,
                        faults.item[i].detail);
    assert_int_equal(faults.count, count);
}

static void expect_fault(size_t i, const char *pointer, const char *code, const char *detail)
{
    assert_true(i < faults.count);
    assert_string_equal(faults.item[i].pointer, pointer);
    assert_string_equal(faults.item[i].code, code);
    assert_string_equal(faults.item[i].detail, detail);
}

static void a_flat_case_is_read(void **state)
{
    const struct ischia_request sample = sample_request();
    (void)state;
    assert_int_equal(read_json("{" GOOD "}"), ISCHIA_OK);
    expect_faults(0);
    assert_memory_equal(&request, &sample, sizeof sample);
}

static void everything_optional_is_read(void **state)
{
    (void)state;
    assert_int_equal(
        read_json("{" GOOD ",\"subject\":\"P-017\",\"side\":\"right\",\"label\":\"caf\xC3\xA9\","
                  "\"measured_at\":\"2026-03-01\",\"skin\":{\"mu\":20,\"thickness\":2},"
                  "\"resolution\":\"fine\",\"model\":{\"name\":\"default\",\"friction\":0}}"),
        ISCHIA_OK);
    expect_faults(0);
    assert_string_equal(request.subject, "P-017");
    assert_int_equal(request.side, ISCHIA_SIDE_RIGHT);
    assert_string_equal(request.label, "caf\xC3\xA9");
    assert_string_equal(request.measured_at, "2026-03-01");
    assert_true(request.values.option[ISCHIA_SKIN_MU] == 20);
    assert_true(request.values.option[ISCHIA_SKIN_THICKNESS] == 2);
    assert_true(request.values.option[ISCHIA_FRICTION] == 0);
    assert_true(request.values.option[ISCHIA_BULK_RATIO] == 2000);
    assert_int_equal(request.values.resolution, ISCHIA_FINE);
}

static void null_means_not_given(void **state)
{
    (void)state;
    assert_int_equal(read_json("{" GOOD ",\"subject\":null,\"side\":null,\"label\":null}"),
                     ISCHIA_OK);
    expect_faults(0);
}

static void every_spelling_of_mu(void **state)
{
    static const char *const spellings[] = {"muM",      "\xCE\xBCM", "\xC2\xB5M",
                                            "\\u03bcM", "\\u00b5M",  "\\u006duM"};
    (void)state;
    for (size_t i = 0; i < sizeof spellings / sizeof spellings[0]; i++) {
        char text[160];
        (void)snprintf(text, sizeof text,
                       "{\"R1\":7,\"R2\":22,\"eM\":31,\"eF\":10,\"%s\":3.5,\"\xC2\xB5"
                       "F\":5,\"F\":258}",
                       spellings[i]);
        assert_int_equal(read_json(text), ISCHIA_OK);
        expect_faults(0);
        assert_true(request.values.param[ISCHIA_MUM] == 3.5);
        assert_true(request.values.param[ISCHIA_MUF] == 5);
    }
}

static void given_twice_by_any_spelling(void **state)
{
    (void)state;
    assert_int_equal(read_json("{" GOOD ",\"\xCE\xBCM\":8}"), ISCHIA_OK);
    expect_faults(1);
    expect_fault(0, "/\xCE\xBCM", "duplicate", "\xCE\xBCM is given more than once, also as muM");
    assert_int_equal(read_json("{" GOOD ",\"F\":8}"), ISCHIA_OK);
    expect_faults(1);
    expect_fault(0, "/F", "duplicate", "F is given more than once");
    assert_int_equal(read_json("{\"\xCE\xBCM\":8," GOOD ",\"\xC2\xB5M\":8}"), ISCHIA_OK);
    expect_faults(2);
}

/* Each bad value: one fault, which names the field, the value and what is accepted. */
static void bad_values(void **state)
{
    static const struct {
        const char *member, *pointer, *code, *detail;
    } cases[] = {
        {"\"muM\":80", "/muM", "out_of_range", "muM is 80 kPa; accepted 0.5 to 30 kPa"},
        {"\"muM\":-8", "/muM", "out_of_range", "muM is -8 kPa; accepted 0.5 to 30 kPa"},
        {"\"muM\":0", "/muM", "out_of_range", "muM is 0 kPa; accepted 0.5 to 30 kPa"},
        {"\"muM\":1e308", "/muM", "out_of_range", "muM is 1e+308 kPa; accepted 0.5 to 30 kPa"},
        {"\"muM\":1e999", "/muM", "not_finite", "muM is beyond 1.8e308; accepted finite numbers"},
        {"\"muM\":\"8\"", "/muM", "wrong_type",
         "muM is \"8\"; accepted a number from 0.5 to 30 kPa"},
        {"\"muM\":null", "/muM", "wrong_type", "muM is null; accepted a number from 0.5 to 30 kPa"},
        {"\"muM\":[8]", "/muM", "wrong_type",
         "muM is an array; accepted a number from 0.5 to 30 kPa"},
        {"\"muM\":{}", "/muM", "wrong_type",
         "muM is an object; accepted a number from 0.5 to 30 kPa"},
        {"\"muM\":true", "/muM", "wrong_type",
         "muM is true or false; accepted a number from 0.5 to 30 kPa"},
        {"\"label\":\"x\"", "/muM", "missing", "muM is missing; accepted 0.5 to 30 kPa"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[200];
        (void)snprintf(text, sizeof text,
                       "{\"R1\":7,\"R2\":22,\"eM\":31,\"eF\":10,%s,\"muF\":5,\"F\":258}",
                       cases[i].member);
        assert_int_equal(read_json(text), ISCHIA_OK);
        expect_faults(1);
        expect_fault(0, cases[i].pointer, cases[i].code, cases[i].detail);
    }
}

static void bad_optional_values(void **state)
{
    static const struct {
        const char *member, *pointer, *code;
    } cases[] = {
        {"\"subject\":\"Jane Doe\"", "/subject", "malformed"},
        {"\"subject\":7", "/subject", "wrong_type"},
        {"\"subject\":\"\"", "/subject", "malformed"},
        {"\"side\":\"L\"", "/side", "not_allowed"},
        {"\"side\":\"\"", "/side", "not_allowed"},
        {"\"measured_at\":\"yesterday\"", "/measured_at", "malformed"},
        {"\"label\":\"a\\nb\"", "/label", "malformed"},
        {"\"label\":{}", "/label", "wrong_type"},
        {"\"sd\":\"usual\"", "/sd", "not_allowed"},
        {"\"sd\":1", "/sd", "wrong_type"},
        {"\"sd\":{\"R1\":-0.1}", "/sd/R1", "out_of_range"},
        {"\"sd\":{\"R1\":12.1}", "/sd/R1", "out_of_range"},
        {"\"sd\":{\"R1\":\"1\"}", "/sd/R1", "wrong_type"},
        {"\"sd\":{\"R1\":1,\"R1\":1}", "/sd/R1", "duplicate"},
        {"\"sd\":{\"muM\":1,\"\u03BCM\":1}", "/sd/muM", "duplicate"},
        {"\"sd\":{\"skin\":1}", "/sd/skin", "unknown"},
        {"\"sd.R1\":1", "/sd.R1", "unknown"},
        {"\"skin\":67", "/skin", "wrong_type"},
        {"\"skin\":{\"mu\":1}", "/skin/mu", "out_of_range"},
        {"\"skin\":{\"mu\":\"67\"}", "/skin/mu", "wrong_type"},
        {"\"skin\":{\"mu\":67,\"mu\":67}", "/skin/mu", "duplicate"},
        {"\"skin\":{\"colour\":1}", "/skin/colour", "unknown"},
        {"\"skin.mu\":67", "/skin.mu", "unknown"},
        {"\"resolution\":\"ultra\"", "/resolution", "not_allowed"},
        {"\"resolution\":2", "/resolution", "wrong_type"},
        {"\"model\":\"other\"", "/model", "not_allowed"},
        {"\"model\":3", "/model", "wrong_type"},
        {"\"model\":null", "/model", "wrong_type"},
        {"\"model\":{\"friction\":-1}", "/model/friction", "out_of_range"},
        {"\"model\":{\"mu\":3}", "/model/mu", "unknown"},
        {"\"a/b~c\":1", "/a~1b~0c", "unknown"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[200];
        (void)snprintf(text, sizeof text, "{" GOOD ",%s}", cases[i].member);
        assert_int_equal(read_json(text), ISCHIA_OK);
        expect_faults(1);
        assert_string_equal(faults.item[0].pointer, cases[i].pointer);
        assert_string_equal(faults.item[0].code, cases[i].code);
    }
}

/* A name typed into the subject by mistake is not repeated to logs and screens. */
static void what_may_be_a_name_is_not_repeated(void **state)
{
    (void)state;
    assert_int_equal(read_json("{" GOOD ",\"subject\":\"Jane Doe\"}"), ISCHIA_OK);
    expect_faults(1);
    assert_null(strstr(faults.item[0].detail, "Jane"));
}

static void labels_are_measured_in_characters(void **state)
{
    char text[1024];
    (void)state;
    for (int n = 200; n <= 201; n++) {
        size_t at = (size_t)snprintf(text, sizeof text, "{" GOOD ",\"label\":\"");
        for (int i = 0; i < n; i++, at += 2) {
            text[at] = '\xC3';
            text[at + 1] = '\xA9';
        }
        (void)snprintf(text + at, sizeof text - at, "\"}");
        assert_int_equal(read_json(text), ISCHIA_OK);
        expect_faults(n == 200 ? 0 : 1);
    }
}

static void all_faults_at_once(void **state)
{
    (void)state;
    assert_int_equal(read_json("{\"R1\":\"7\",\"R2\":-1,\"eM\":0,\"eF\":1e308,\"muM\":1e999,"
                               "\"RCCI1\":1,\"F\":-2,\"subject\":\"a b\",\"F\":3}"),
                     ISCHIA_OK);
    expect_faults(9);
    expect_fault(2, "/R1", "wrong_type", "R1 is \"7\"; accepted a number from 3 to 15 mm");
    expect_fault(3, "/RCCI1", "unknown", "RCCI1 is not a known key; did you mean R1?");
    expect_fault(8, "/muF", "missing", "muF is missing; accepted 0.5 to 30 kPa");
}

static void swapped_radii(void **state)
{
    (void)state;
    assert_int_equal(
        read_json("{\"R1\":12,\"R2\":9,\"eM\":31,\"eF\":10,\"muM\":8,\"muF\":5,\"F\":258}"),
        ISCHIA_OK);
    expect_faults(1);
    assert_string_equal(faults.item[0].code, "inconsistent");
}

static void more_faults_than_room(void **state)
{
    char text[2048] = "{\"x0\":0";
    (void)state;
    for (int i = 1; i < 60; i++) {
        const size_t used = strlen(text);
        (void)snprintf(text + used, sizeof text - used, ",\"x%d\":0", i);
    }
    (void)strncat(text, "}", 2);
    assert_int_equal(read_json(text), ISCHIA_OK);
    expect_faults(DOC_FAULTS_MAX);
    assert_int_equal(faults.dropped, 60 + 7 - DOC_FAULTS_MAX);
}

static void documents_of_another_kind(void **state)
{
    static const char *const texts[] = {"[]", "7", "null", "\"R1\"", "true"};
    (void)state;
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        assert_int_equal(read_json(texts[i]), ISCHIA_OK);
        expect_faults(1);
        assert_string_equal(faults.item[0].pointer, "");
    }
    assert_int_equal(read_json("{"), ISCHIA_E_INPUT);
}

static void nearest_keys(void **state)
{
    static const struct {
        const char *typed, *meant;
    } cases[] = {
        {"mum", "muM"},
        {"MUF", "muF"},
        {"eG", "eF"},
        {"muG", "muF"},
        {"RCCI2", "R2"},
        {"force", "F"},
        {"resolutoin", "resolution"},
        {"subjet", "subject"},
        {"R3", "R1"},
        {"skin.thick", "skin.thickness"},
        {"zzzzzz", NULL},
        {"", NULL},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *nearest = case_doc_nearest_key(cases[i].typed);
        if (cases[i].meant == NULL)
            assert_null(nearest);
        else
            assert_string_equal(nearest, cases[i].meant);
    }
}

static void columns_with_units(void **state)
{
    (void)state;
    assert_string_equal(case_doc_column_key("R1_mm"), "R1");
    assert_string_equal(case_doc_column_key("muM_kPa"), "muM");
    assert_string_equal(case_doc_column_key("\xC2\xB5"
                                            "F_kPa"),
                        "muF");
    assert_string_equal(case_doc_column_key("F_N"), "F");
    assert_string_equal(case_doc_column_key("F"), "F");
    assert_string_equal(case_doc_column_key("measured_at"), "measured_at");
    assert_null(case_doc_column_key("R1_cm"));
    assert_null(case_doc_column_key("F_kN"));
    assert_null(case_doc_column_key("note"));
    assert_null(case_doc_column_key("_mm"));
}

/* The names of the options are written twice (case_fields.c says why): they must agree. */
static void option_keys_agree_with_the_table(void **state)
{
    (void)state;
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++) {
        char name[64];
        (void)snprintf(name, sizeof name, "%s.%s", ischia_options[i].group, ischia_options[i].key);
        assert_string_equal(case_key_name(KEY_FIRST_OPTION + i), name);
        assert_string_equal(case_doc_canonical_key(name), name);
    }
    for (int key = 0; key < KEY_COUNT; key++)
        assert_int_equal(case_key_find(case_key_name(key)), key);
}

static void a_form_is_read(void **state)
{
    (void)state;
    assert_int_equal(
        read_form("R1=7.1&R2=22.8&eM=31&eF=10&%CE%BCM=8&%c2%b5F=+5+&F=2.58e2&label=caf%C3%A9+x"
                  "&subject=&side=left&skin.mu=20&model.friction=0&resolution=fine&&"),
        ISCHIA_OK);
    expect_faults(0);
    assert_true(request.values.param[ISCHIA_F] == 258);
    assert_true(request.values.param[ISCHIA_MUF] == 5);
    assert_true(request.values.option[ISCHIA_SKIN_MU] == 20);
    assert_string_equal(request.label, "caf\xC3\xA9 x");
    assert_string_equal(request.subject, "");
}

/* The form for one value of muM: "+" is a space in a form, so it is escaped. */
static void read_form_muM(const char *muM)
{
    char text[120];
    (void)snprintf(text, sizeof text, "R1=7&R2=22&eM=31&eF=10&muM=%s%s&muF=5&F=258",
                   muM[0] == '+' ? "%2B" : "", muM + (muM[0] == '+'));
    assert_int_equal(read_form(text), ISCHIA_OK);
}

static void form_numbers_are_as_typed(void **state)
{
    static const char *const eight[] = {"8,0", "8.0", "8.", "+8", "08", "%C2%A08", "8e0", ",8e1"};
    static const char *const bad[] = {"0x8", "nan", "8 kPa", "٨", "1e999", "inf", "8,e"};
    (void)state;
    for (size_t i = 0; i < sizeof eight / sizeof eight[0]; i++) {
        read_form_muM(eight[i]);
        expect_faults(0);
        assert_true(request.values.param[ISCHIA_MUM] == 8);
    }
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        read_form_muM(bad[i]);
        expect_faults(1);
        assert_string_equal(faults.item[0].pointer, "/muM");
    }
    assert_int_equal(read_form("R1=7,1&R2=22&eM=31&eF=10&muM=8&muF=5&F=258&skin.mu=66,5"),
                     ISCHIA_OK);
    expect_faults(0);
    assert_true(request.values.option[ISCHIA_SKIN_MU] == 66.5);
}

static void two_decimal_marks_are_refused(void **state)
{
    (void)state;
    read_form_muM("1,234.5");
    expect_faults(1);
    expect_fault(0, "/muM", "ambiguous",
                 "muM is \"1,234.5\" with more than one decimal mark; write 1234.5 or 1234,5");
}

/* Only a person's form: JSON and the rows of a CSV file have one way to write a number. */
static void other_numbers_stay_strict(void **state)
{
    struct case_doc_fields fields;
    (void)state;
    doc_faults_init(&faults);
    case_doc_fields_init(&fields, &request, &faults);
    case_doc_fields_set(&fields, "muM", "8,0");
    expect_faults(1);
    assert_string_equal(faults.item[0].code, "wrong_type");
}

static void form_faults(void **state)
{
    (void)state;
    assert_int_equal(
        read_form("R1=7&R1=7&R2=22&eM=31&eF=10&muM=&muF=5&F=258&sd=1&skin=1&colour=red"),
        ISCHIA_OK);
    expect_faults(5);
    expect_fault(0, "/R1", "duplicate", "R1 is given more than once");
    assert_string_equal(faults.item[1].code, "not_allowed");
    assert_string_equal(faults.item[2].pointer, "/skin");
    assert_string_equal(faults.item[2].code, "unsupported");
    assert_string_equal(faults.item[3].code, "unknown");
    expect_fault(4, "/muM", "missing", "muM is missing; accepted 0.5 to 30 kPa");
}

static void broken_forms(void **state)
{
    static const char *const bad[] = {"R1=%",   "R1=%4",   "R1=%zz", "%00=1",
                                      "R1=%ff", "R1=\xff", "%C3=1"};
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(read_form(bad[i]), ISCHIA_E_INPUT);
    doc_faults_init(&faults);
    assert_int_equal(case_doc_read_form(&request, "a\0b", 3, 65536, &faults, &err), ISCHIA_E_INPUT);
    assert_int_equal(case_doc_read_form(&request, "abcd", 4, 3, &faults, &err), ISCHIA_E_LIMIT);
    doc_faults_init(&faults);
    assert_int_equal(case_doc_read_form(&request, NULL, 0, 10, &faults, &err), ISCHIA_OK);
    expect_faults(ISCHIA_PARAM_COUNT);
}

static void what_is_written_reads_back(void **state)
{
    struct ischia_request written = sample_request();
    struct json_out out;
    char *text;
    (void)state;
    written.values.param[ISCHIA_R1] = 7.0 + 1e-15;
    written.values.option[ISCHIA_FRICTION] = 1.0 / 3;
    written.values.resolution = ISCHIA_FINE;
    written.side = ISCHIA_SIDE_LEFT;
    (void)snprintf(written.subject, sizeof written.subject, "P-017");
    (void)snprintf(written.label, sizeof written.label, "a \"b\" \xCE\xBC");
    (void)snprintf(written.measured_at, sizeof written.measured_at, "2026-03-01T09:30:00Z");
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    case_doc_write(&out, &written);
    json_close_object(&out);
    assert_int_equal(json_out_take(&out, &text, NULL, &err), ISCHIA_OK);
    assert_int_equal(read_json(text), ISCHIA_OK);
    expect_faults(0);
    assert_memory_equal(&request, &written, sizeof written);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_flat_case_is_read),
        cmocka_unit_test(everything_optional_is_read),
        cmocka_unit_test(null_means_not_given),
        cmocka_unit_test(every_spelling_of_mu),
        cmocka_unit_test(given_twice_by_any_spelling),
        cmocka_unit_test(bad_values),
        cmocka_unit_test(bad_optional_values),
        cmocka_unit_test(what_may_be_a_name_is_not_repeated),
        cmocka_unit_test(labels_are_measured_in_characters),
        cmocka_unit_test(all_faults_at_once),
        cmocka_unit_test(swapped_radii),
        cmocka_unit_test(more_faults_than_room),
        cmocka_unit_test(documents_of_another_kind),
        cmocka_unit_test(nearest_keys),
        cmocka_unit_test(columns_with_units),
        cmocka_unit_test(option_keys_agree_with_the_table),
        cmocka_unit_test(a_form_is_read),
        cmocka_unit_test(form_numbers_are_as_typed),
        cmocka_unit_test(two_decimal_marks_are_refused),
        cmocka_unit_test(other_numbers_stay_strict),
        cmocka_unit_test(form_faults),
        cmocka_unit_test(broken_forms),
        cmocka_unit_test(what_is_written_reads_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
