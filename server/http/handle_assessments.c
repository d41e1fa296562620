/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/problem_doc.h"
#include "server/digest.h"
#include "server/http/page.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/routes.h"
#include "server/metrics.h"

/*
 * One assessment: submit, read, cancel, erase.
 *
 * A submission waits for the commit that makes it durable without holding a thread (the store calls
 * back), and then, if the client prefers, for the end of the solve.
 */

enum { WAIT_MAX_S = 60, IDEMPOTENCY_KEY_BYTES = 256, STOP_WAIT_MS = 10000 };
static const int64_t for_ever_ms = INT64_MAX / 4;

static double seconds_since(int64_t begun_us)
{
    return (double)(metrics_now_us() - begun_us) / 1e6;
}

static int64_t wait_deadline(const struct call *call)
{
    const int seconds = query_prefer_wait(http_request_header(call->request, "Prefer"), WAIT_MAX_S);
    return seconds < 0 ? 0 : call->request->begun_ms + (int64_t)seconds * 1000;
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
        call->deadline_ms = wait_deadline(call);
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

/* What a worker is given, and what makes two requests the same: nothing about the person. */
static enum ischia_code case_text(const struct ischia_request *request, char **ret,
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
    const size_t count = ischia_case_warnings(&request->values, warnings);
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

static void on_accepted(void *context, enum ischia_code code, const struct store_accepted *accepted,
                        const struct ischia_error *err)
{
    struct deferred *deferred = context;
    deferred->code = code;
    if (code == ISCHIA_OK)
        deferred->accepted = *accepted;
    else
        deferred->err = *err;
    deferred_complete(deferred);
}

static enum ischia_code enqueue(struct call *call, const struct ischia_request *request,
                                const char *key, struct ischia_error *err)
{
    char *case_json = NULL, *warnings_json = NULL;
    struct store_new what = {
        .subject = text_or_null(request->subject),
        .side = request->side == ISCHIA_SIDE_NONE ? NULL : ischia_side_names[request->side],
        .label = text_or_null(request->label),
        .measured_at = text_or_null(request->measured_at),
        .priority = QUEUE_CLINIC,
        .client = call->who.id,
        .idempotency_key = key,
        .queued_max = atomic_load_explicit(&call->service->queue_limit, memory_order_relaxed),
    };
    const struct digest_part body = {call->request->body, call->request->body_size};
    digest_parts(&body, 1, what.body_digest);
    enum ischia_code code = case_text(request, &case_json, err);
    if (code == ISCHIA_OK) code = warnings_text(request, &warnings_json, err);
    what.case_json = case_json;
    what.warnings_json = warnings_json;
    struct deferred *deferred = code == ISCHIA_OK ? deferred_create(call) : NULL;
    if (code == ISCHIA_OK && deferred == NULL)
        code = FAIL(err, ISCHIA_E_MEMORY, "no memory for a request");
    if (code == ISCHIA_OK) {
        code = queue_accept_later(call->service->queue, &what, on_accepted, deferred, err);
        if (code != ISCHIA_OK) { /* the callback will not come: give up its share */
            http_release(deferred->exchange);
            deferred_drop(deferred);
        }
    }
    free(case_json);
    free(warnings_json);
    return code;
}

/* Printable ASCII, as RFC 9110 would have any header be; "" is none. */
static bool read_key(struct call *call, const char **ret_key, struct http_response *ret)
{
    const char *key = http_request_header(call->request, "Idempotency-Key");
    *ret_key = key;
    if (key == NULL) return true;
    const size_t length = strlen(key);
    bool good = length > 0 && length < IDEMPOTENCY_KEY_BYTES;
    for (size_t i = 0; i < length; i++) good = good && key[i] > 0x20 && key[i] < 0x7f;
    if (good) return true;
    reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST,
                  "Idempotency-Key has 1 to %d printable ASCII characters without blanks.",
                  IDEMPOTENCY_KEY_BYTES - 1);
    return false;
}

static void begin_submit(struct call *call, struct http_response *ret)
{
    struct ischia_request request;
    struct ischia_error err;
    const char *key = NULL;
    call->deadline_ms = wait_deadline(call);
    if (!read_key(call, &key, ret) || !read_request(call, &request, ret)) return;
    if (enqueue(call, &request, key, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return;
    }
    ret->action = HTTP_WAIT; /* for the commit, however long the disk takes */
    ret->wake_at_ms = for_ever_ms;
}

static void refuse_acceptance(struct call *call, const struct store_accepted *accepted,
                              struct http_response *ret)
{
    if (accepted->acceptance == STORE_KEY_CONFLICT) {
        reply_refusal(call->request, ret, PROBLEM_IDEMPOTENCY,
                      "This Idempotency-Key came with another body before; use a new one.");
        return;
    }
    http_header_static(ret, "Retry-After", "30");
    reply_refusal(call->request, ret, PROBLEM_QUEUE_FULL,
                  "%d assessments are waiting, which is the limit; nothing was stored.",
                  accepted->queued);
}

/* Queued durably: 303 to a form, 201 with the finished document, else 202. */
static void send_accepted(struct call *call, const struct store_assessment *row,
                          struct http_response *ret)
{
    const bool finished = queue_is_final(row->state);
    if (is_form(call)) {
        ret->status = 303;
        http_header(ret, "Location", "/v1/assessments/%s/report", call->id_text);
        return;
    }
    http_header(ret, "Location", "/v1/assessments/%s", call->id_text);
    if (call->deadline_ms > 0) http_header_static(ret, "Preference-Applied", "wait");
    send_row(call, row, finished && call->deadline_ms > 0 ? 201 : 202, ret);
}

static void finish_submit(struct call *call, struct http_response *ret)
{
    const struct deferred *deferred = call->deferred;
    struct store_assessment row;
    if (deferred->code != ISCHIA_OK) {
        reply_failure(call->request, ret, &deferred->err);
        return;
    }
    const enum store_acceptance acceptance = deferred->accepted.acceptance;
    if (acceptance == STORE_KEY_CONFLICT || acceptance == STORE_FULL) {
        refuse_acceptance(call, &deferred->accepted, ret);
        return;
    }
    if (call->id_text[0] == '\0') {
        call->id = deferred->accepted.id;
        uuid_format(&call->id, call->id_text);
        metrics_count(METRIC_ASSESSMENTS_ACCEPTED);
        metrics_store(STORE_ACCEPTS, (double)(http_now_ms() - call->request->begun_ms) / 1e3);
        if (call->deadline_ms > 0) (void)call_subscribe(call);
    }
    if (!peek(call, &row, ret)) return;
    if (call_still_waits(call, queue_is_final(row.state)))
        call_wait(call, ret);
    else
        send_accepted(call, &row, ret);
}

void handle_submit(struct call *call, struct http_response *ret)
{
    if (call->deferred == NULL) {
        begin_submit(call, ret);
    } else if (atomic_load(&call->deferred->done)) {
        finish_submit(call, ret);
    } else if (http_is_stopping(call->service->http) &&
               http_now_ms() > call->request->begun_ms + STOP_WAIT_MS) {
        ret->action = HTTP_DROP; /* the disk hangs: neither yes nor no would be true */
    } else {
        ret->action = HTTP_WAIT;
        ret->wake_at_ms = for_ever_ms;
    }
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
        http_header(ret, "Location", "/v1/assessments/%s/report", call->id_text);
    } else if (answer == STORE_CONFLICT && was != QUEUE_CANCELLED)
        reply_refusal(call->request, ret, PROBLEM_CONFLICT, "This assessment has ended: %s.",
                      queue_state_names[was]);
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
        reply_refusal(call->request, ret, PROBLEM_CONFLICT,
                      "This assessment is being solved; cancel it first.");
        return;
    }
    documents_forget(call->service->documents, &call->id);
    ret->status = 204;
}
