/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "server/http/fhir_http.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/report.h"
#include "server/http/routes.h"
#include "server/http/submit.h"
#include "server/intake.h"

/*
 * POST /fhir/$assess: the same queue as /v1, answered when the solve has ended, or at once with an
 * address to ask at (Prefer: respond-async, FHIR's asynchronous pattern).
 */

enum { ANSWER_WITHIN_S = 60 };

static bool wants_async(const struct call *call)
{
    const char *prefer = http_request_header(call->request, "Prefer");
    return prefer != NULL && strstr(prefer, "respond-async") != NULL;
}

/* ------------------------------------------------------------------------------ answers */

static void put_collection(struct json_out *out, const char *base, const struct record *record,
                           const char *html)
{
    json_open_object(out, NULL);
    json_put_string(out, "resourceType", "Bundle");
    json_put_string(out, "type", "collection");
    json_put_string(out, "timestamp", record->finished_at);
    json_open_array(out, "entry");
    fhir_put_entries(out, base, record, html);
    json_close_array(out);
    json_close_object(out);
}

static void send_collection(struct call *call, const struct store_assessment *row,
                            struct http_response *ret)
{
    struct ischia_error err;
    struct json_out out;
    char base[FHIR_BASE_BYTES], *html = NULL;
    struct record *record = malloc(sizeof *record);
    fhir_base(call, base);
    enum ischia_code code = record == NULL ? FAIL(&err, ISCHIA_E_MEMORY, "no memory for a record")
                                           : intake_record(record, row, &err);
    if (code == ISCHIA_OK) code = report_attachment(&html, row, &err);
    json_out_init(&out, fhir_indent(call));
    http_header_static(ret, "Cache-Control", "no-store");
    if (code == ISCHIA_OK) {
        put_collection(&out, base, record, html);
        http_header(ret, "Location", "%s/RiskAssessment/%s", base, call->id_text);
        fhir_send(call, 200, &out, ret);
    } else {
        reply_failure(call->request, ret, &err);
    }
    json_out_finish(&out);
    free(html);
    free(record);
}

/* Ended without a result: the problem, as an OperationOutcome. */
static void send_problem(struct call *call, const struct store_assessment *row,
                         struct http_response *ret)
{
    struct problem problem;
    if (row->problem_json == NULL ||
        problem_doc_read(&problem, row->problem_json, strlen(row->problem_json), NULL) != ISCHIA_OK)
        problem_init(&problem, PROBLEM_CONFLICT, "The assessment was cancelled.");
    reply_problem(call->request, &problem, ret);
}

static void send_ended(struct call *call, const struct store_assessment *row,
                       struct http_response *ret)
{
    if (row->state == QUEUE_SUCCEEDED)
        send_collection(call, row, ret);
    else
        send_problem(call, row, ret);
}

/* Still under way: where to ask, and how far it is. */
static void send_pending(struct call *call, const struct store_assessment *row,
                         struct http_response *ret)
{
    struct json_out out;
    char base[FHIR_BASE_BYTES];
    double fraction = 0;
    (void)events_fraction(call->service->events, &call->id, &fraction);
    fhir_base(call, base);
    http_header(ret, "Content-Location", "%s/async/%s", base, call->id_text);
    http_header(ret, "X-Progress", "%s, %.0f %%", queue_state_names[row->state], 100 * fraction);
    http_header_static(ret, "Retry-After", "1");
    http_header_static(ret, "Cache-Control", "no-store");
    json_out_init(&out, fhir_indent(call));
    json_open_object(&out, NULL);
    json_put_string(&out, "resourceType", "OperationOutcome");
    json_open_array(&out, "issue");
    json_open_object(&out, NULL);
    json_put_string(&out, "severity", "information");
    json_put_string(&out, "code", "informational");
    json_put_string(&out, "diagnostics",
                    "The assessment is under way; Content-Location says where to ask.");
    json_close_object(&out);
    json_close_array(&out);
    json_close_object(&out);
    fhir_send(call, 202, &out, ret);
}

/* ----------------------------------------------------------------------------- $assess */

/* False: ret is the refusal. */
static bool read_input(struct call *call, struct fhir_input *input, struct http_response *ret)
{
    struct doc_faults faults;
    struct problem problem;
    struct ischia_error err;
    doc_faults_init(&faults);
    const enum ischia_code code =
        fhir_read_assess(input, call->request->body, call->request->body_size, &faults, &err);
    if (code == ISCHIA_OK && faults.count == 0) return true;
    if (code != ISCHIA_OK)
        problem_from_error(&problem, &err);
    else
        problem_from_faults(&problem, &faults);
    reply_problem(call->request, &problem, ret);
    return false;
}

static void begin(struct call *call, struct http_response *ret)
{
    struct fhir_input input;
    const char *key = NULL;
    call->deadline_ms = submit_wait_deadline(call);
    if (wants_async(call))
        call->deadline_ms = 0;
    else if (call->deadline_ms == 0)
        call->deadline_ms = call->request->begun_ms + ANSWER_WITHIN_S * 1000;
    if (submit_read_key(call, &key, ret) && read_input(call, &input, ret))
        submit_enqueue(call, &input.request, &input.origin, key, ret);
}

static void finish(struct call *call, struct http_response *ret)
{
    struct store_assessment row;
    if (!submit_take_accepted(call, ret) || !fhir_get_row(call, &row, ret)) return;
    if (call_still_waits(call, queue_is_final(row.state))) {
        call_wait(call, ret);
    } else if (queue_is_final(row.state) && !wants_async(call)) {
        send_ended(call, &row, ret);
    } else {
        if (wants_async(call)) http_header_static(ret, "Preference-Applied", "respond-async");
        send_pending(call, &row, ret);
    }
    store_assessment_finish(&row);
}

void handle_fhir_assess(struct call *call, struct http_response *ret)
{
    if (call->deferred == NULL)
        begin(call, ret);
    else if (submit_is_committed(call, ret))
        finish(call, ret);
}

void handle_fhir_async(struct call *call, struct http_response *ret)
{
    struct store_assessment row;
    if (!fhir_get_row(call, &row, ret)) return;
    if (queue_is_final(row.state))
        send_ended(call, &row, ret);
    else
        send_pending(call, &row, ret);
    store_assessment_finish(&row);
}

/* A client that wants the answer no more. */
void handle_fhir_cancel(struct call *call, struct http_response *ret)
{
    struct ischia_error err;
    enum store_answer answer = STORE_NOT_FOUND;
    enum queue_state was = QUEUE_QUEUED;
    if (call->id_text[0] != '\0' &&
        queue_cancel(call->service->queue, &call->id, &was, &answer, &err) != ISCHIA_OK)
        reply_failure(call->request, ret, &err);
    else if (answer == STORE_NOT_FOUND)
        reply_no_assessment(call, ret);
    else if (answer == STORE_CONFLICT && was != QUEUE_CANCELLED)
        reply_refusal_english(call->request, ret, PROBLEM_CONFLICT,
                              "This assessment has ended: %s.", queue_state_names[was]);
    else
        ret->status = 202;
}
