/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "tests/unit/samples.h"

#include "api/problem_doc.h"

static struct ischia_error err;

static char *write_problem(const struct problem *problem)
{
    char *text = NULL;
    assert_int_equal(problem_doc_text(&text, problem, &err), ISCHIA_OK);
    return text;
}

static void kinds_are_complete_and_distinct(void **state)
{
    (void)state;
    for (int i = 0; i < PROBLEM_KIND_COUNT; i++) {
        assert_non_null(problem_kinds[i].type);
        assert_non_null(problem_kinds[i].title);
        assert_true(problem_kinds[i].status >= 400 && problem_kinds[i].status <= 599);
        for (int j = 0; j < i; j++)
            assert_string_not_equal(problem_kinds[i].type, problem_kinds[j].type);
    }
}

static void members_without_a_value_are_left_out(void **state)
{
    struct problem problem;
    (void)state;
    problem_init(&problem, PROBLEM_NOT_FOUND, "%s", "");
    char *text = write_problem(&problem);
    assert_string_equal(
        text,
        "{\"type\":\"/docs#problem-not-found\",\"title\":\"Nothing is here\",\"status\":404}");
    free(text);
}

static void faults_are_errors(void **state)
{
    struct doc_faults faults;
    struct problem problem, back;
    (void)state;
    doc_faults_init(&faults);
    doc_faults_add(&faults, "/muM", "out_of_range", "muM is %d kPa; accepted 0.5 to 30 kPa", 80);
    problem_from_faults(&problem, &faults);
    (void)snprintf(problem.instance, sizeof problem.instance, "/v1/assessments");
    char *text = write_problem(&problem);
    assert_string_equal(
        text,
        "{\"type\":\"/docs#problem-invalid\",\"title\":\"The input is not "
        "acceptable\",\"status\":422,"
        "\"detail\":\"1 value is not acceptable\",\"instance\":\"/v1/assessments\",\"errors\":[{"
        "\"pointer\":\"/muM\",\"code\":\"out_of_range\",\"detail\":\"muM is 80 kPa; accepted 0.5 "
        "to "
        "30 kPa\"}]}");
    assert_int_equal(problem_doc_read(&back, text, strlen(text), &err), ISCHIA_OK);
    assert_int_equal(back.kind, PROBLEM_INVALID);
    assert_int_equal(back.faults.count, 1);
    assert_string_equal(back.faults.item[0].pointer, "/muM");
    assert_string_equal(back.instance, "/v1/assessments");
    free(text);
}

static void a_failed_solve_says_how_far_it_came(void **state)
{
    const struct ischia_request request = sample_request();
    const struct ischia_result failure = sample_failure();
    struct problem problem, back;
    (void)state;
    problem_from_result(&problem, &request.values, &failure);
    assert_string_equal(problem.detail,
                        "No equilibrium was found beyond 129 N of 258 N: steps down to 1e-6 N");
    assert_string_equal(problem.reason, "diverged_step");
    assert_true(problem.last_converged_fraction == 0.5);
    char *text = write_problem(&problem);
    assert_int_equal(problem_doc_read(&back, text, strlen(text), &err), ISCHIA_OK);
    assert_true(back.last_converged_fraction == 0.5);
    assert_string_equal(back.reason, "diverged_step");
    free(text);
}

/* It reached all of the force: nothing may read as if it had stopped before. */
static void a_result_that_failed_its_checks_says_so(void **state)
{
    const struct ischia_request request = sample_request();
    struct ischia_result failure = sample_failure();
    struct problem problem;
    (void)state;
    failure.numerics.reason = ISCHIA_DIVERGED_CHECKS;
    failure.numerics.last_converged_F_N = 258;
    (void)snprintf(failure.numerics.detail, sizeof failure.numerics.detail, "det F is -0.1");
    problem_from_result(&problem, &request.values, &failure);
    assert_string_equal(problem.detail, "The whole force of 258 N was reached, but what was "
                                        "computed failed its checks: det F is -0.1");
    assert_string_equal(problem.reason, "diverged_checks");
    assert_true(problem.last_converged_fraction == 1);
    failure.numerics.detail[0] = '\0';
    problem_from_result(&problem, &request.values, &failure);
    assert_string_equal(problem.detail, "The whole force of 258 N was reached, but what was "
                                        "computed failed its checks.");
}

static void codes_have_kinds(void **state)
{
    const struct ischia_error limit = {.code = ISCHIA_E_LIMIT, .message = "too much"};
    struct problem problem;
    (void)state;
    problem_from_error(&problem, &limit);
    assert_int_equal(problem.kind, PROBLEM_TOO_LARGE);
    assert_string_equal(problem.detail, "too much");
    assert_int_equal(problem_kind_of(ISCHIA_E_INPUT), PROBLEM_NOT_JSON);
    assert_int_equal(problem_kind_of(ISCHIA_E_MEMORY), PROBLEM_OUT_OF_MEMORY);
    assert_int_equal(problem_kind_of(ISCHIA_CODE_COUNT), PROBLEM_INTERNAL);
}

static void other_documents_are_refused(void **state)
{
    static const char *const bad[] = {
        "{}",
        "[]",
        "{\"type\":7}",
        "{\"type\":\"about:blank\",\"title\":\"x\",\"status\":400}",
        "{\"type\":\"/docs#problem-invalid\",\"title\":\"x\",\"status\":422,\"errors\":[7]}",
        "{\"type\":\"/docs#problem-invalid\",\"title\":\"x\",\"status\":422,\"errors\":[{}]}",
        "{\"type\":\"/docs#problem-invalid\",\"title\":\"x\",\"status\":422,\"detail\":7}",
    };
    struct problem problem;
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(problem_doc_read(&problem, bad[i], strlen(bad[i]), &err), ISCHIA_E_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kinds_are_complete_and_distinct),
        cmocka_unit_test(members_without_a_value_are_left_out),
        cmocka_unit_test(faults_are_errors),
        cmocka_unit_test(a_failed_solve_says_how_far_it_came),
        cmocka_unit_test(a_result_that_failed_its_checks_says_so),
        cmocka_unit_test(codes_have_kinds),
        cmocka_unit_test(other_documents_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
