/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/problem_doc.h"

#include <assert.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "api/fields.h"

const struct problem_info problem_kinds[PROBLEM_KIND_COUNT] = {
    [PROBLEM_NOT_JSON] = {"/docs#problem-not-json", WORD_DAEMON_PROBLEM_NOT_JSON, 400},
    [PROBLEM_BAD_REQUEST] = {"/docs#problem-bad-request", WORD_DAEMON_PROBLEM_BAD_REQUEST, 400},
    [PROBLEM_UNAUTHORIZED] = {"/docs#problem-unauthorized", WORD_DAEMON_PROBLEM_UNAUTHORIZED, 401},
    [PROBLEM_FORBIDDEN] = {"/docs#problem-forbidden", WORD_DAEMON_PROBLEM_FORBIDDEN, 403},
    [PROBLEM_NOT_FOUND] = {"/docs#problem-not-found", WORD_DAEMON_PROBLEM_NOT_FOUND, 404},
    [PROBLEM_METHOD] = {"/docs#problem-method", WORD_DAEMON_PROBLEM_METHOD, 405},
    [PROBLEM_NOT_ACCEPTABLE] = {"/docs#problem-not-acceptable", WORD_DAEMON_PROBLEM_NOT_ACCEPTABLE,
                                406},
    [PROBLEM_TIMEOUT] = {"/docs#problem-timeout", WORD_DAEMON_PROBLEM_TIMEOUT, 408},
    [PROBLEM_CONFLICT] = {"/docs#problem-conflict", WORD_DAEMON_PROBLEM_CONFLICT, 409},
    [PROBLEM_PRECONDITION] = {"/docs#problem-precondition", WORD_DAEMON_PROBLEM_PRECONDITION, 412},
    [PROBLEM_TOO_LARGE] = {"/docs#problem-too-large", WORD_DAEMON_PROBLEM_TOO_LARGE, 413},
    [PROBLEM_MEDIA_TYPE_WRONG] = {"/docs#problem-media-type", WORD_DAEMON_PROBLEM_MEDIA_TYPE, 415},
    [PROBLEM_INVALID] = {"/docs#problem-invalid", WORD_DAEMON_PROBLEM_INVALID, 422},
    [PROBLEM_IDEMPOTENCY] = {"/docs#problem-idempotency", WORD_DAEMON_PROBLEM_IDEMPOTENCY, 422},
    [PROBLEM_QUEUE_FULL] = {"/docs#problem-queue-full", WORD_DAEMON_PROBLEM_QUEUE_FULL, 429},
    [PROBLEM_RATE] = {"/docs#problem-rate", WORD_DAEMON_PROBLEM_RATE, 429},
    [PROBLEM_HEADERS_TOO_LARGE] = {"/docs#problem-headers-too-large",
                                   WORD_DAEMON_PROBLEM_HEADERS_TOO_LARGE, 431},
    [PROBLEM_INTERNAL] = {"/docs#problem-internal", WORD_DAEMON_PROBLEM_INTERNAL, 500},
    [PROBLEM_UNAVAILABLE] = {"/docs#problem-unavailable", WORD_DAEMON_PROBLEM_UNAVAILABLE, 503},
    [PROBLEM_STORAGE] = {"/docs#problem-storage", WORD_DAEMON_PROBLEM_STORAGE, 507},
    [PROBLEM_NOT_CONVERGED] = {"/docs#problem-not-converged", WORD_DAEMON_PROBLEM_NOT_CONVERGED,
                               422},
    [PROBLEM_OUT_OF_MEMORY] = {"/docs#problem-out-of-memory", WORD_DAEMON_PROBLEM_OUT_OF_MEMORY,
                               503},
    [PROBLEM_TIME_LIMIT] = {"/docs#problem-time-limit", WORD_DAEMON_PROBLEM_TIME_LIMIT, 504},
    [PROBLEM_WORKER_DIED] = {"/docs#problem-worker-died", WORD_DAEMON_PROBLEM_WORKER_DIED, 500},
};

/* ---- making one ---- */

static void clear(struct problem *problem, enum problem_kind kind)
{
    *problem = (struct problem){.kind = kind, .last_converged_fraction = (double)NAN};
    doc_faults_init(&problem->faults);
}

void problem_init(struct problem *ret, enum problem_kind kind, const char *format, ...)
{
    va_list arguments;
    clear(ret, kind);
    va_start(arguments, format);
    (void)vsnprintf(ret->detail, sizeof ret->detail, format, arguments);
    va_end(arguments);
}

void problem_say(struct problem *ret, enum problem_kind kind, enum language language,
                 enum word word, const struct word_value *values)
{
    clear(ret, kind);
    ret->language = language;
    (void)words_fill(ret->detail, sizeof ret->detail, language, word, values);
}

enum problem_kind problem_kind_of(enum ischia_code code)
{
    static const enum problem_kind kinds[ISCHIA_CODE_COUNT] = {
        [ISCHIA_OK] = PROBLEM_INTERNAL,
        [ISCHIA_E_INPUT] = PROBLEM_NOT_JSON,
        [ISCHIA_E_MEMORY] = PROBLEM_OUT_OF_MEMORY,
        [ISCHIA_E_IO] = PROBLEM_INTERNAL,
        [ISCHIA_E_NUMERIC] = PROBLEM_INTERNAL,
        [ISCHIA_E_CANCELLED] = PROBLEM_CONFLICT,
        [ISCHIA_E_LIMIT] = PROBLEM_TOO_LARGE,
        [ISCHIA_E_STATE] = PROBLEM_CONFLICT,
    };
    return (unsigned)code < ISCHIA_CODE_COUNT ? kinds[code] : PROBLEM_INTERNAL;
}

void problem_from_error(struct problem *ret, const struct ischia_error *err)
{
    problem_init(ret, problem_kind_of(err->code), "%s", err->message);
}

/* Where the load path ended. One that came all the way and failed its checks found an equilibrium
 * for the whole force: to name the force it came to would read as if it had not. */
static void put_end_of_path(struct problem *ret, const struct ischia_numerics *n, double F_N)
{
    const char *mark = n->detail[0] != '\0' ? ": " : ".";
    if (n->reason == ISCHIA_DIVERGED_CHECKS)
        problem_init(ret, PROBLEM_NOT_CONVERGED,
                     "The whole force of %.4g N was reached, but what was computed failed its "
                     "checks%s%s",
                     F_N, mark, n->detail);
    else
        problem_init(ret, PROBLEM_NOT_CONVERGED,
                     "No equilibrium was found beyond %.4g N of %.4g N%s%s", n->last_converged_F_N,
                     F_N, mark, n->detail);
}

void problem_from_result(struct problem *ret, const struct ischia_case *c,
                         const struct ischia_result *result)
{
    const struct ischia_numerics *n = &result->numerics;
    const double F_N = c->param[ISCHIA_F];
    assert(!ischia_result_converged(result));
    put_end_of_path(ret, n, F_N);
    (void)snprintf(ret->reason, sizeof ret->reason, "%s", ischia_reason_name(n->reason));
    ret->last_converged_fraction = n->last_converged_F_N / F_N;
}

void problem_from_faults(struct problem *ret, const struct doc_faults *faults)
{
    const size_t count = faults->count + faults->dropped;
    const enum word word = faults->dropped > 0 ? WORD_DAEMON_PROBLEM_FAULTS_LISTED
                           : count == 1        ? WORD_DAEMON_PROBLEM_FAULT
                                               : WORD_DAEMON_PROBLEM_FAULTS;
    problem_say(
        ret, PROBLEM_INVALID, faults->language, word,
        WORDS(word_count("n", (long long)count), word_count("listed", (long long)faults->count)));
    ret->faults = *faults;
}

/* ---- the document ---- */

static const struct problem_info *info_of(const void *base)
{
    return &problem_kinds[((const struct problem *)base)->kind];
}

static void write_type(struct json_out *out, const char *key, const void *base)
{
    json_put_string(out, key, info_of(base)->type);
}

static bool read_type(const struct json *value, void *base)
{
    if (json_type_of(value) != JSON_STRING) return false;
    for (int kind = 0; kind < PROBLEM_KIND_COUNT; kind++)
        if (strcmp(problem_kinds[kind].type, json_string(value)) == 0) {
            ((struct problem *)base)->kind = (enum problem_kind)kind;
            return true;
        }
    return false;
}

static void write_title(struct json_out *out, const char *key, const void *base)
{
    const struct problem *problem = base;
    json_put_string(out, key, words_get(problem->language, info_of(base)->title));
}

static void write_status(struct json_out *out, const char *key, const void *base)
{
    json_put_integer(out, key, info_of(base)->status);
}

#define TEXT(kind_, type, member)                                                                  \
    {                                                                                              \
        .key = #member, .kind = (kind_), .offset = offsetof(struct type, member),                  \
        .size = sizeof((struct type *)0)->member                                                   \
    }
#define END                                                                                        \
    {                                                                                              \
        .key = NULL                                                                                \
    }

static const struct field fault_fields[] = {
    TEXT(FIELD_TEXT, ischia_fault, pointer),
    TEXT(FIELD_TEXT, ischia_fault, code),
    TEXT(FIELD_TEXT, ischia_fault, detail),
    END,
};

static void write_errors(struct json_out *out, const char *key, const void *base)
{
    const struct doc_faults *faults = &((const struct problem *)base)->faults;
    if (faults->count == 0) return;
    json_open_array(out, key);
    for (size_t i = 0; i < faults->count; i++) {
        json_open_object(out, NULL);
        fields_write(out, fault_fields, &faults->item[i]);
        json_close_object(out);
    }
    json_close_array(out);
}

static bool read_errors(const struct json *value, void *base)
{
    struct doc_faults *faults = &((struct problem *)base)->faults, inner;
    if (json_type_of(value) != JSON_ARRAY || json_count(value) > DOC_FAULTS_MAX) return false;
    doc_faults_init(&inner);
    for (const struct json *m = json_first(value); m != NULL; m = json_next(m)) {
        if (json_type_of(m) != JSON_OBJECT) return false;
        fields_read(m, fault_fields, &faults->item[faults->count++], "", &inner);
    }
    return inner.count == 0;
}

static const struct field problem_fields[] = {
    {.key = "type", .kind = FIELD_CUSTOM, .custom_write = write_type, .custom_read = read_type},
    {.key = "title", .kind = FIELD_CUSTOM, .custom_write = write_title},
    {.key = "status", .kind = FIELD_CUSTOM, .custom_write = write_status},
    TEXT(FIELD_TEXT_OR_NONE, problem, detail),
    TEXT(FIELD_TEXT_OR_NONE, problem, instance),
    TEXT(FIELD_TEXT_OR_NONE, problem, reason),
    {.key = "last_converged_fraction",
     .kind = FIELD_NUMBER_OR_NONE,
     .offset = offsetof(struct problem, last_converged_fraction)},
    {.key = "errors",
     .kind = FIELD_CUSTOM,
     .custom_write = write_errors,
     .custom_read = read_errors,
     .optional = true},
    END,
};

void problem_doc_write(struct json_out *out, const struct problem *problem)
{
    fields_write(out, problem_fields, problem);
}

enum ischia_code problem_doc_text(char **ret_text, const struct problem *problem,
                                  struct ischia_error *err)
{
    struct json_out out;
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    problem_doc_write(&out, problem);
    json_close_object(&out);
    return json_out_take(&out, ret_text, NULL, err);
}

enum ischia_code problem_doc_read(struct problem *ret, const char *json, size_t length,
                                  struct ischia_error *err)
{
    struct problem problem;
    struct doc_faults faults;
    struct json *root;
    clear(&problem, PROBLEM_INTERNAL);
    doc_faults_init(&faults);
    TRY(json_parse(&root, json, length, &json_limits_stored, &faults, err));
    fields_read(root, problem_fields, &problem, "", &faults);
    json_destroy(root);
    CHECK(faults.count == 0, err, ISCHIA_E_INPUT, "not a problem document: %s: %s",
          faults.item[0].pointer, faults.item[0].detail);
    *ret = problem;
    return ISCHIA_OK;
}
