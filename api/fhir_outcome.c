/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <string.h>

#include "api/fhir.h"

/* FHIR's issue types (http://hl7.org/fhir/issue-type) for our kinds of problems. */
static const char *const issue_of_kind[PROBLEM_KIND_COUNT] = {
    [PROBLEM_NOT_JSON] = "structure",
    [PROBLEM_BAD_REQUEST] = "invalid",
    [PROBLEM_UNAUTHORIZED] = "login",
    [PROBLEM_FORBIDDEN] = "forbidden",
    [PROBLEM_NOT_FOUND] = "not-found",
    [PROBLEM_METHOD] = "not-supported",
    [PROBLEM_NOT_ACCEPTABLE] = "not-supported",
    [PROBLEM_TIMEOUT] = "timeout",
    [PROBLEM_CONFLICT] = "conflict",
    [PROBLEM_PRECONDITION] = "incomplete",
    [PROBLEM_TOO_LARGE] = "too-long",
    [PROBLEM_MEDIA_TYPE_WRONG] = "not-supported",
    [PROBLEM_INVALID] = "invalid",
    [PROBLEM_IDEMPOTENCY] = "conflict",
    [PROBLEM_QUEUE_FULL] = "throttled",
    [PROBLEM_RATE] = "throttled",
    [PROBLEM_HEADERS_TOO_LARGE] = "too-long",
    [PROBLEM_INTERNAL] = "exception",
    [PROBLEM_UNAVAILABLE] = "transient",
    [PROBLEM_STORAGE] = "no-store",
    [PROBLEM_NOT_CONVERGED] = "processing",
    [PROBLEM_OUT_OF_MEMORY] = "transient",
    [PROBLEM_TIME_LIMIT] = "timeout",
    [PROBLEM_WORKER_DIED] = "exception",
};

/* The codes of api/faults.h. */
static const struct {
    const char *fault, *issue;
} issue_of_fault[] = {
    {"missing", "required"},     {"unknown", "not-found"},         {"duplicate", "duplicate"},
    {"wrong_type", "structure"}, {"not_finite", "value"},          {"too_many", "too-costly"},
    {"out_of_range", "value"},   {"inconsistent", "invariant"},    {"not_allowed", "code-invalid"},
    {"malformed", "value"},      {"unsupported", "not-supported"},
};

static const char *issue_type(const char *fault)
{
    for (size_t i = 0; i < sizeof issue_of_fault / sizeof issue_of_fault[0]; i++)
        if (strcmp(issue_of_fault[i].fault, fault) == 0) return issue_of_fault[i].issue;
    return "invalid";
}

static void put_issue(struct json_out *out, const char *type, const char *text,
                      const char *diagnostics, const char *expression)
{
    json_open_object(out, NULL);
    json_put_string(out, "severity", "error");
    json_put_string(out, "code", type);
    json_open_object(out, "details");
    json_put_string(out, "text", text);
    json_close_object(out);
    if (diagnostics[0] != '\0') json_put_string(out, "diagnostics", diagnostics);
    if (expression[0] != '\0') {
        json_open_array(out, "expression");
        json_put_string(out, NULL, expression);
        json_close_array(out);
    }
    json_close_object(out);
}

void fhir_put_outcome(struct json_out *out, const struct problem *problem)
{
    const struct doc_faults *faults = &problem->faults;
    json_put_string(out, "resourceType", "OperationOutcome");
    json_open_array(out, "issue");
    if (faults->count == 0)
        put_issue(out, issue_of_kind[problem->kind],
                  words_get(LANGUAGE_EN, problem_kinds[problem->kind].title), problem->detail, "");
    for (size_t i = 0; i < faults->count; i++)
        put_issue(out, issue_type(faults->item[i].code),
                  words_get(LANGUAGE_EN, problem_kinds[problem->kind].title),
                  faults->item[i].detail, faults->item[i].pointer);
    json_close_array(out);
}

enum ischia_code fhir_outcome_text(char **ret_text, const struct problem *problem,
                                   struct ischia_error *err)
{
    struct json_out out;
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    fhir_put_outcome(&out, problem);
    json_close_object(&out);
    return json_out_take(&out, ret_text, NULL, err);
}
