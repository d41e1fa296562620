/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/samples.h"

#include "api/result_doc.h"

static struct ischia_error err;
static char *written; /* not a local: gcc 12 would take it for a dangling pointer */

static char *write_result(const struct ischia_result *result)
{
    const struct ischia_request request = sample_request();
    assert_int_equal(result_doc_text(&written, &request.values, result, NULL, 0, &err), ISCHIA_OK);
    return written;
}

static enum ischia_code read_result(struct ischia_result *ret, const char *text)
{
    return result_doc_read(ret, NULL, text, strlen(text), &json_limits_stored, &err);
}

/* NaN is not equal to itself, so results are compared by their documents. */
static void assert_same(const struct ischia_result *a, const struct ischia_result *b)
{
    char *text_a = write_result(a), *text_b = write_result(b);
    assert_string_equal(text_a, text_b);
    free(text_a);
    free(text_b);
}

static void what_is_written_reads_back(void **state)
{
    const struct ischia_result result = sample_result();
    struct ischia_result back;
    struct result_model model;
    char *text = write_result(&result);
    (void)state;
    assert_int_equal(result_doc_read(&back, &model, text, strlen(text), &json_limits_stored, &err),
                     ISCHIA_OK);
    assert_string_equal(model.name, ISCHIA_MODEL_NAME);
    assert_int_equal(model.version, ISCHIA_MODEL_VERSION);
    assert_memory_equal(&back.strain, &result.strain, sizeof back.strain);
    assert_memory_equal(&back.seat, &result.seat, sizeof back.seat);
    assert_memory_equal(&back.load_curve, &result.load_curve, sizeof back.load_curve);
    assert_int_equal(back.load_curve_count, 2);
    assert_true(isnan(back.threshold_force_compression_N));
    assert_true(back.threshold_force_shear_N == 61.25);
    assert_false(back.clusters[ISCHIA_OVER_BOTH].has_largest);
    assert_true(back.numerics.energy_residual == 5e-324);
    assert_int_equal(back.numerics.reason, ISCHIA_CONVERGED);
    assert_same(&back, &result);
    free(text);
}

static void the_document_has_the_contract_s_words(void **state)
{
    static const char *const words[] = {
        "{\"strain\":{\"eps_max\":1.3333333333333333,\"eps_max_depth_mm\":0.30000000000000004,"
        "\"E_shear_max\":1.9,\"E_comp_max\":0.49},",
        "\"clusters\":{\"shear\":{\"threshold\":0.75,\"volume_mm3\":14400.1,\"count\":2,"
        "\"largest\":{",
        "\"compression\":{\"threshold\":0.45,",
        "\"both\":{\"volume_mm3\":0,\"count\":0,\"largest\":null}}",
        "\"muscle_volume_mm3\":173456.78125",
        "\"threshold_force_N\":{\"shear\":61.25,\"compression\":null}",
        "\"risk\":{\"band\":\"both\",",
        "\"numerics\":{\"converged\":true,",
        "\"model\":{\"name\":\"macron2020-local\",\"version\":1}}",
    };
    const struct ischia_result result = sample_result();
    char *text = write_result(&result);
    (void)state;
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strstr(text, words[i]) == NULL) fail_msg("%s is not in %s", words[i], text);
    free(text);
}

static void a_failure_makes_nothing_up(void **state)
{
    const struct ischia_result failure = sample_failure();
    struct ischia_result back;
    char *text = write_result(&failure);
    (void)state;
    assert_non_null(strstr(text, "{\"strain\":null,\"clusters\":null,"));
    assert_non_null(strstr(text, "\"seat\":null,"));
    assert_non_null(strstr(text, "\"threshold_force_N\":null,\"risk\":null,"));
    assert_non_null(strstr(text, "\"converged\":false,\"reason\":\"diverged_step\""));
    assert_non_null(strstr(text, "\"detail\":\"steps down to 1e-6 N\""));
    assert_int_equal(read_result(&back, text), ISCHIA_OK);
    assert_int_equal(back.numerics.reason, ISCHIA_DIVERGED_STEP);
    assert_int_equal(back.load_curve_count, 1);
    assert_same(&back, &failure);
    free(text);
}

/* A solver that says it converged and gives nonsense is not believed. */
static void nonsense_is_not_written(void **state)
{
    const struct ischia_request request = sample_request();
    struct ischia_result results[4];
    char *text = NULL;
    (void)state;
    for (int i = 0; i < 4; i++) results[i] = sample_result();
    results[0].strain.eps_max = (double)NAN;
    results[1].strain.E_comp_max = 0.51;
    results[2].numerics.force_residual = (double)NAN;
    results[3].load_curve[1].displacement_mm = (double)INFINITY;
    for (int i = 0; i < 4; i++)
        assert_int_equal(result_doc_text(&text, &request.values, &results[i], NULL, 0, &err),
                         ISCHIA_E_NUMERIC);
    assert_null(text);
}

/* Every member cut out, every value replaced by one of another kind: an error, never a result. */
static void replaced(const char *text, const char *from, const char *to, char *ret, size_t size)
{
    const char *at = strstr(text, from);
    assert_non_null(at);
    (void)snprintf(ret, size, "%.*s%s%s", (int)(at - text), text, to, at + strlen(from));
}

static void broken_documents_are_refused(void **state)
{
    static const struct {
        const char *from, *to;
    } cases[] = {
        {"\"eps_max\":1.3333333333333333,", ""},
        {"\"eps_max\":1.3333333333333333", "\"eps_max\":null"},
        {"\"eps_max\":1.3333333333333333", "\"eps_max\":\"1\""},
        {"\"E_comp_max\":0.49", "\"E_comp_max\":0.6"},
        {"\"count\":2", "\"count\":2.5"},
        {"\"count\":2", "\"count\":1e300"},
        {"\"seat\":{", "\"seat\":null,\"tae\":{"},
        {"\"centroid_mm\":[0,0.1,0.6666666666666666]", "\"centroid_mm\":[0,0.1]"},
        {"\"load_curve\":[", "\"load_curve\":[7,"},
        {"\"reason\":\"converged\"", "\"reason\":\"perhaps\""},
        {"\"version\":1", "\"version\":\"1\""},
        {"\"largest\":null", "\"largest\":3"},
        {"\"strain\":{", "\"strain\":{},\"strian\":{"},
    };
    const struct ischia_result result = sample_result();
    struct ischia_result back = {.load_curve_count = 77};
    char *text = write_result(&result), broken[8192];
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        replaced(text, cases[i].from, cases[i].to, broken, sizeof broken);
        if (read_result(&back, broken) != ISCHIA_E_INPUT) fail_msg("accepted: %s", cases[i].to);
    }
    assert_int_equal(read_result(&back, "[]"), ISCHIA_E_INPUT);
    assert_int_equal(back.load_curve_count, 77);
    free(text);
}

static void unknown_members_are_ignored(void **state)
{
    const struct ischia_result result = sample_result();
    struct ischia_result back;
    char *text = write_result(&result), more[8192];
    (void)state;
    replaced(text, "{\"strain\"", "{\"later\":[1,2],\"strain\"", more, sizeof more);
    assert_int_equal(read_result(&back, more), ISCHIA_OK);
    assert_same(&back, &result);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_written_reads_back),
        cmocka_unit_test(the_document_has_the_contract_s_words),
        cmocka_unit_test(a_failure_makes_nothing_up),
        cmocka_unit_test(nonsense_is_not_written),
        cmocka_unit_test(broken_documents_are_refused),
        cmocka_unit_test(unknown_members_are_ignored),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
