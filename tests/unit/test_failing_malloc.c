/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Every document with its 1st, 2nd, 3rd ... allocation failing, until one run gets through: each
 * run before ends with ISCHIA_E_MEMORY, leaves its outputs alone and leaks nothing. cJSON's
 * allocations are among them.
 */
#include "tests/unit/samples.h"

#include "api/assessment_doc.h"
#include "api/parameters_doc.h"
#include "api/problem_doc.h"
#include "api/result_doc.h"
#include "tests/double/failing_malloc.h"

static char untouched[1];
static char *text;
static struct ischia_error err;

static enum ischia_code free_text(enum ischia_code code)
{
    if (code == ISCHIA_OK)
        free(text);
    else
        assert_ptr_equal(text, untouched);
    text = untouched;
    return code;
}

static enum ischia_code read_case(void)
{
    static const char json[] =
        "{\"R1\":7,\"R2\":22,\"skin\":{\"mu\":67},\"label\":\"\\u00b5\",\"x\":[1,[2]]}";
    struct ischia_request request;
    struct doc_faults faults;
    doc_faults_init(&faults);
    return case_doc_read(&request, json, sizeof json - 1, &json_limits_request, &faults, &err);
}

static enum ischia_code read_form(void)
{
    struct ischia_request request;
    struct doc_faults faults;
    doc_faults_init(&faults);
    return case_doc_read_form(&request, "R1=7&R2=22", 10, 100, &faults, &err);
}

static enum ischia_code write_result(void)
{
    const struct ischia_request request = sample_request();
    const struct ischia_result result = sample_result();
    return free_text(result_doc_text(&text, &request.values, &result, NULL, 2, &err));
}

static enum ischia_code read_result(void)
{
    static char json[8192];
    struct ischia_result result = sample_result();
    if (json[0] == '\0') { /* written once, with nothing failing */
        char *written;
        const struct ischia_request request = sample_request();
        failing_malloc_disarm();
        assert_int_equal(result_doc_text(&written, &request.values, &result, NULL, 0, &err),
                         ISCHIA_OK);
        (void)snprintf(json, sizeof json, "%s", written);
        free(written);
        failing_malloc_arm(1, false);
    }
    result.load_curve_count = 77;
    const enum ischia_code code =
        result_doc_read(&result, NULL, json, strlen(json), &json_limits_stored, &err);
    assert_int_equal(result.load_curve_count, code == ISCHIA_OK ? 2 : 77);
    return code;
}

static enum ischia_code write_problem(void)
{
    struct problem problem;
    problem_init(&problem, PROBLEM_INTERNAL, "%0300d", 7);
    return free_text(problem_doc_text(&text, &problem, &err));
}

static enum ischia_code read_problem(void)
{
    static const char json[] =
        "{\"type\":\"/docs#problem-internal\",\"title\":\"x\",\"status\":500,"
        "\"errors\":[{\"pointer\":\"\",\"code\":\"c\",\"detail\":\"d\"}]}";
    struct problem problem;
    return problem_doc_read(&problem, json, sizeof json - 1, &err);
}

static enum ischia_code write_assessment(void)
{
    const struct assessment a = {.id = "x", .created_at = "y", .request = sample_request()};
    return free_text(assessment_doc_text(&text, &a, 0, &err));
}

static enum ischia_code write_parameters(void)
{
    return free_text(parameters_doc_text(&text, LANGUAGE_EN, 2, &err));
}

static void survive(enum ischia_code (*call)(void), long at_least)
{
    long nth = 1;
    text = untouched;
    for (;; nth++) {
        const long live = failing_malloc_live();
        failing_malloc_arm(nth, nth % 2 == 0);
        const enum ischia_code code = call();
        const bool happened = failing_malloc_happened();
        failing_malloc_disarm();
        assert_int_equal(failing_malloc_live(), live);
        if (!happened) {
            assert_int_equal(code, ISCHIA_OK);
            break;
        }
        assert_int_equal(code, ISCHIA_E_MEMORY);
        assert_int_equal(err.code, ISCHIA_E_MEMORY);
    }
    assert_true(nth > at_least); /* so many allocations were made to fail */
}

static void every_document_survives(void **state)
{
    (void)state;
    survive(read_case, 10);
    survive(read_form, 1);
    survive(write_result, 3);
    survive(read_result, 50);
    survive(write_problem, 1);
    survive(read_problem, 8);
    survive(write_assessment, 1);
    survive(write_parameters, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_document_survives)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
