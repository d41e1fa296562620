/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/intake.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/case_words.h"
#include "api/fhir.h"
#include "api/problem_doc.h"
#include "api/result_doc.h"
#include "api/uncertainty_doc.h"
#include "server/digest.h"
#include "server/http/documents.h"

/* ------------------------------------------------------------------------------- subject */

static void digest_subject(const char *kind, const char *a, const char *b,
                           char ret[ISCHIA_SUBJECT_BYTES])
{
    enum { DIGITS = 32 };
    const struct digest_part parts[] = {digest_text(kind), digest_text(a), digest_text(b)};
    unsigned char digest[DIGEST_BYTES];
    char hex[DIGEST_HEX_BYTES];
    digest_parts(parts, sizeof parts / sizeof parts[0], digest);
    digest_hex(digest, hex);
    (void)snprintf(ret, ISCHIA_SUBJECT_BYTES, "x-%.*s", DIGITS, hex);
}

void intake_subject(const struct origin *origin, char ret[ISCHIA_SUBJECT_BYTES])
{
    const char *id = NULL;
    ret[0] = '\0';
    if (fhir_is_local_patient(origin->reference, &id) || text_is_pseudonym(origin->pid))
        (void)snprintf(ret, ISCHIA_SUBJECT_BYTES, "%.64s", id != NULL ? id : origin->pid);
    else if (origin->reference[0] != '\0')
        digest_subject("reference", origin->reference, "", ret);
    else if (origin->identifier_value[0] != '\0')
        digest_subject("identifier", origin->identifier_system, origin->identifier_value, ret);
    else if (origin->pid[0] != '\0')
        digest_subject("pid", origin->pid, "", ret);
}

/* -------------------------------------------------------------------------------- intake */

enum ischia_code intake_case_text(const struct ischia_request *request, char **ret,
                                  struct ischia_error *err)
{
    struct ischia_request bare = *request;
    struct json_out out;
    bare.subject[0] = bare.label[0] = bare.measured_at[0] = '\0';
    bare.side = ISCHIA_SIDE_NONE;
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    case_doc_write(&out, &bare);
    json_close_object(&out);
    return json_out_take(&out, ret, NULL, err);
}

static enum ischia_code warnings_text(const struct ischia_request *request, char **ret,
                                      struct ischia_error *err)
{
    struct ischia_fault warnings[ISCHIA_PARAM_COUNT];
    struct json_out out;
    const size_t count = case_warnings(&request->values, LANGUAGE_EN, warnings);
    json_out_init(&out, 0);
    json_open_array(&out, NULL);
    for (size_t i = 0; i < count; i++) {
        json_open_object(&out, NULL);
        json_put_string(&out, "code", warnings[i].code);
        json_put_string(&out, "pointer", warnings[i].pointer);
        json_put_string(&out, "detail", warnings[i].detail);
        json_close_object(&out);
    }
    json_close_array(&out);
    return json_out_take(&out, ret, NULL, err);
}

static const char *text_or_null(const char *text) { return text[0] == '\0' ? NULL : text; }

static void point_at_texts(struct intake *intake)
{
    const struct ischia_request *request = &intake->request;
    struct store_new *what = &intake->what;
    what->subject = text_or_null(request->subject);
    what->side = request->side == ISCHIA_SIDE_NONE ? NULL : ischia_side_names[request->side];
    what->label = text_or_null(request->label);
    what->measured_at = text_or_null(request->measured_at);
    what->case_json = intake->case_json;
    what->warnings_json = intake->warnings_json;
    what->origin_json = intake->origin_json;
    what->reference = text_or_null(intake->origin.reference);
    what->priority = QUEUE_CLINIC;
}

enum ischia_code intake_init(struct intake *ret, const struct ischia_request *request,
                             const struct origin *origin, struct ischia_error *err)
{
    memset(ret, 0, sizeof *ret);
    ret->request = *request;
    if (origin != NULL) ret->origin = *origin;
    if (ret->request.subject[0] == '\0') intake_subject(&ret->origin, ret->request.subject);
    enum ischia_code code = intake_case_text(&ret->request, &ret->case_json, err);
    if (code == ISCHIA_OK) code = warnings_text(&ret->request, &ret->warnings_json, err);
    if (code == ISCHIA_OK && origin_is_given(&ret->origin))
        code = origin_text(&ret->origin_json, &ret->origin, err);
    if (code != ISCHIA_OK)
        intake_finish(ret);
    else
        point_at_texts(ret);
    return code;
}

void intake_finish(struct intake *intake)
{
    free(intake->case_json);
    free(intake->warnings_json);
    free(intake->origin_json);
    memset(intake, 0, sizeof *intake);
}

/* -------------------------------------------------------------------------------- record */

static const enum assessment_status status_of[QUEUE_STATE_COUNT] = {
    [QUEUE_QUEUED] = ASSESSMENT_QUEUED,       [QUEUE_RUNNING] = ASSESSMENT_RUNNING,
    [QUEUE_SUCCEEDED] = ASSESSMENT_SUCCEEDED, [QUEUE_FAILED] = ASSESSMENT_FAILED,
    [QUEUE_CANCELLED] = ASSESSMENT_CANCELLED,
};

static void read_times(struct record *ret, const struct store_assessment *row)
{
    const int64_t last = row->started_ms > row->finished_ms ? row->started_ms : row->finished_ms;
    documents_time(row->created_ms, ret->created_at);
    documents_time(row->finished_ms, ret->finished_at);
    documents_time(last > row->created_ms ? last : row->created_ms, ret->updated_at);
}

static void read_problem(struct record *ret, const struct store_assessment *row)
{
    struct problem problem;
    if (ret->status == ASSESSMENT_CANCELLED)
        (void)snprintf(ret->problem, sizeof ret->problem, "The assessment was cancelled.");
    if (ret->status != ASSESSMENT_FAILED) return;
    (void)snprintf(ret->problem, sizeof ret->problem, "The solve failed.");
    if (row->problem_json != NULL &&
        problem_doc_read(&problem, row->problem_json, strlen(row->problem_json), NULL) == ISCHIA_OK)
        (void)snprintf(ret->problem, sizeof ret->problem, "%s", problem.detail);
}

enum ischia_code intake_record(struct record *ret, const struct store_assessment *row,
                               struct ischia_error *err)
{
    memset(ret, 0, sizeof *ret);
    uuid_format(&row->id, ret->id);
    ret->version = (long long)row->change_seq;
    ret->status = status_of[row->state];
    read_times(ret, row);
    read_problem(ret, row);
    TRY(documents_request(&ret->request, row, err));
    if (row->origin_json != NULL) TRY(origin_read(&ret->origin, row->origin_json, err));
    if (ret->status != ASSESSMENT_SUCCEEDED) return ISCHIA_OK;
    CHECK(row->result_json != NULL, err, ISCHIA_E_STATE, "the result was not read");
    TRY(result_doc_read(&ret->result, NULL, row->result_json, strlen(row->result_json),
                        &json_limits_stored, err));
    TRY(uncertainty_doc_read(&ret->uncertainty, &ret->has_uncertainty, row->result_json,
                             strlen(row->result_json), err));
    risk_assess(&ret->risk, &ret->request.values, &ret->result, LANGUAGE_EN);
    return ISCHIA_OK;
}
