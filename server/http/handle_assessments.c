/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/problem_doc.h"
#include "server/http/page.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/routes.h"
#include "server/http/submit.h"
#include "server/metrics.h"

/*
 * One assessment: submit, read, cancel, erase.
 *
 * A submission waits for the commit that makes it durable without holding a thread (the store calls
 * back), and then, if the client prefers, for the end of the solve.
 */

static double seconds_since(int64_t begun_us)
{
    return (double)(metrics_now_us() - begun_us) / 1e6;
}

static void put_etag(struct call *call, const struct store_assessment *row, double fraction,
                     struct http_response *ret)
{
    (void)call;
    (void)snprintf(ret->etag, sizeof ret->etag, "\"%lld-%d\"", (long long)row->change_seq,
                   (int)(fraction * 1000));
    http_header_static(ret, "Cache-Control", "no-cache, private");
}

/* ------------------------------------------------------------------------------ read */

static void send_document(struct document *document, struct http_response *ret)
{
    ret->type = "application/json";
    ret->bytes = document->text;
    ret->size = document->size;
    ret->release = document_release;
    ret->owner = document;
    ret->compressible = true;
}

/* Renders the row; a final one is kept for the next reader. */
static enum ischia_code render(struct call *call, const struct store_assessment *row,
                               double fraction, struct http_response *ret, struct ischia_error *err)
{
    struct json_out out;
    char *text = NULL;
    size_t size = 0;
    json_out_init(&out, 2);
    json_open_object(&out, NULL);
    const enum ischia_code code = documents_write(&out, row, fraction, err);
    if (code != ISCHIA_OK) {
        json_out_finish(&out);
        return code;
    }
    json_close_object(&out);
    TRY(json_out_take(&out, &text, &size, err));
    struct document *kept =
        queue_is_final(row->state)
            ? documents_keep(call->service->documents, &row->id, row->change_seq, text, size)
            : NULL;
    if (kept == NULL) {
        http_body(ret, "application/json", text, size);
        return ISCHIA_OK;
    }
    free(text);
    send_document(kept, ret);
    return ISCHIA_OK;
}

static void read_and_render(struct call *call, double fraction, struct http_response *ret)
{
    struct store_assessment row;
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    memset(&row, 0, sizeof row);
    enum ischia_code code = store_get(call->service->store, &call->id, &row, &answer, &err);
    if (code == ISCHIA_OK && answer != STORE_DONE) {
        reply_no_assessment(call, ret);
        return;
    }
    if (code == ISCHIA_OK) {
        put_etag(call, &row, fraction, ret);
        code = render(call, &row, fraction, ret, &err);
        store_assessment_finish(&row);
    }
    if (code != ISCHIA_OK) reply_failure(call->request, ret, &err);
}

/* The document as it is now, or 304. `row` is what store_peek said. */
static void send_row(struct call *call, const struct store_assessment *row, int status,
                     struct http_response *ret)
{
    double fraction = row->state == QUEUE_SUCCEEDED ? 1 : 0;
    if (!queue_is_final(row->state))
        (void)events_fraction(call->service->events, &call->id, &fraction);
    put_etag(call, row, fraction, ret);
    if (status == 200 && reply_not_modified(call->request, ret)) return;
    struct document *kept = documents_find(call->service->documents, &call->id, row->change_seq);
    if (kept != NULL) {
        send_document(kept, ret);
    } else {
        ret->header_count--; /* read_and_render says it again, of the row that it reads */
        read_and_render(call, fraction, ret);
    }
    if (ret->status == 200) ret->status = status;
}

static bool peek(struct call *call, struct store_assessment *ret_row, struct http_response *ret)
{
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    const int64_t begun_us = metrics_now_us();
    memset(ret_row, 0, sizeof *ret_row);
    if (store_peek(call->service->store, &call->id, ret_row, &answer, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return false;
    }
    metrics_store(STORE_READS, seconds_since(begun_us));
    if (answer == STORE_DONE) return true;
    documents_forget(call->service->documents, &call->id);
    reply_no_assessment(call, ret);
    return false;
}

void handle_get(struct call *call, struct http_response *ret)
{
    struct store_assessment row;
    if (call->request->woken == 0) {
        call->deadline_ms = submit_wait_deadline(call);
        /* Before the look into the store: what happens in between is then not missed. */
        if (call->deadline_ms > 0) (void)call_subscribe(call);
    }
    if (!peek(call, &row, ret)) return;
    if (call_still_waits(call, queue_is_final(row.state)))
        call_wait(call, ret);
    else
        send_row(call, &row, 200, ret);
}

/* ---------------------------------------------------------------------------- submit */

static bool is_form(const struct call *call)
{
    const char *type = http_request_header(call->request, "Content-Type");
    return type != NULL && query_media_type_is(type, "application/x-www-form-urlencoded");
}

/* Reads the body either way. False: ret is the refusal. */
static bool read_request(struct call *call, struct ischia_request *request,
                         struct http_response *ret)
{
    struct doc_faults faults;
    struct problem problem;
    struct ischia_error err;
    const struct http_request *http = call->request;
    doc_faults_init(&faults);
    faults.language = reply_language(http);
    ischia_request_init(request);
    const enum ischia_code code = is_form(call)
                                      ? case_doc_read_form(request, http->body, http->body_size,
                                                           call->route->body_max, &faults, &err)
                                      : case_doc_read(request, http->body, http->body_size,
                                                      &json_limits_request, &faults, &err);
    if (code == ISCHIA_OK && faults.count == 0) return true;
    if (is_form(call) && call->accepted == 1 && code != ISCHIA_E_MEMORY) {
        page_form(call, http->body, http->body_size, &faults, ret);
        return false;
    }
    if (code != ISCHIA_OK)
        problem_from_error(&problem, &err);
    else
        problem_from_faults(&problem, &faults);
    reply_problem(http, &problem, ret);
    return false;
}

static void begin_submit(struct call *call, struct http_response *ret)
{
    struct ischia_request request;
    const char *key = NULL;
    call->deadline_ms = submit_wait_deadline(call);
    if (!submit_read_key(call, &key, ret) || !read_request(call, &request, ret)) return;
    submit_enqueue(call, &request, NULL, key, ret);
}

/* Queued durably: 303 to a form, 201 with the finished document, else 202. */
static void send_accepted(struct call *call, const struct store_assessment *row,
                          struct http_response *ret)
{
    const bool finished = queue_is_final(row->state);
    if (is_form(call)) {
        ret->status = 303;
        http_header(ret, "Location", "/v1/assessments/%s/report%s", call->id_text,
                    call->lang_query);
        return;
    }
    http_header(ret, "Location", "/v1/assessments/%s", call->id_text);
    if (call->deadline_ms > 0) http_header_static(ret, "Preference-Applied", "wait");
    send_row(call, row, finished && call->deadline_ms > 0 ? 201 : 202, ret);
}

static void finish_submit(struct call *call, struct http_response *ret)
{
    struct store_assessment row;
    if (!submit_take_accepted(call, ret) || !peek(call, &row, ret)) return;
    if (call_still_waits(call, queue_is_final(row.state)))
        call_wait(call, ret);
    else
        send_accepted(call, &row, ret);
}

void handle_submit(struct call *call, struct http_response *ret)
{
    if (call->deferred == NULL)
        begin_submit(call, ret);
    else if (submit_is_committed(call, ret))
        finish_submit(call, ret);
}

/* --------------------------------------------------------------------- cancel, erase */

void handle_cancel(struct call *call, struct http_response *ret)
{
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    enum queue_state was = QUEUE_QUEUED;
    if (queue_cancel(call->service->queue, &call->id, &was, &answer, &err) != ISCHIA_OK)
        reply_failure(call->request, ret, &err);
    else if (answer == STORE_NOT_FOUND)
        reply_no_assessment(call, ret);
    else if (is_form(call)) { /* the plain report's button: the report says how it ended */
        ret->status = 303;
        http_header(ret, "Location", "/v1/assessments/%s/report%s", call->id_text,
                    call->lang_query);
    } else if (answer == STORE_CONFLICT && was != QUEUE_CANCELLED)
        reply_refusal(call->request, ret, PROBLEM_CONFLICT, WORD_DAEMON_REFUSAL_ENDED,
                      WORDS(word_text("status", reply_state(reply_language(call->request), was))));
    else
        read_and_render(call, 0, ret); /* cancelling twice is no fault */
}

void handle_erase(struct call *call, struct http_response *ret)
{
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    if (store_erase(call->service->store, &call->id, &answer, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return;
    }
    if (answer == STORE_NOT_FOUND) {
        reply_no_assessment(call, ret);
        return;
    }
    if (answer == STORE_CONFLICT) {
        reply_refusal(call->request, ret, PROBLEM_CONFLICT, WORD_DAEMON_REFUSAL_RUNNING, NULL);
        return;
    }
    documents_forget(call->service->documents, &call->id);
    events_erased(call->service->events, &call->id);
    ret->status = 204;
}
