/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/csv.h"
#include "api/json.h"
#include "api/problem_doc.h"
#include "api/result_csv.h"
#include "api/result_doc.h"
#include "api/uncertainty_csv.h"
#include "api/uncertainty_doc.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/routes.h"
#include "server/metrics.h"

/* Lists: assessments, newest first, as JSON or CSV; and the log of changes. */

enum { LIMIT_USUAL = 50, CHANGES_USUAL = 100, SUBJECT_BYTES = ISCHIA_SUBJECT_BYTES };

/* ---------------------------------------------------------------------------- query */

struct list_query {
    char subject[SUBJECT_BYTES], side[16], status[16], limit[16], cursor[STORE_CURSOR_BYTES];
    struct store_filter filter;
    struct doc_faults faults;
};

static void find_text(struct call *call, struct list_query *q, const char *key, char *ret,
                      size_t size)
{
    if (query_find(call->request->query, key, ret, size) == QUERY_BAD)
        doc_faults_say(&q->faults, key, "malformed", WORD_DAEMON_REFUSAL_QUERY_TEXT,
                       WORDS(word_text("key", key)));
}

static void read_side(struct list_query *q)
{
    if (q->side[0] == '\0') return;
    q->filter.side = q->side;
    if (strcmp(q->side, "left") != 0 && strcmp(q->side, "right") != 0)
        doc_faults_say(&q->faults, "side", "not_allowed", WORD_DAEMON_REFUSAL_QUERY_SIDE, NULL);
}

static void read_status(struct list_query *q)
{
    if (q->status[0] == '\0') return;
    q->filter.by_state = true;
    if (!queue_state_from_name(q->status, &q->filter.state))
        doc_faults_say(&q->faults, "status", "not_allowed", WORD_DAEMON_REFUSAL_QUERY_STATUS, NULL);
}

static void read_limit(struct list_query *q)
{
    long long limit = LIMIT_USUAL;
    if (q->limit[0] != '\0' && !query_whole_number(q->limit, 1, STORE_LIST_LIMIT_MAX, &limit))
        doc_faults_say(&q->faults, "limit", "out_of_range", WORD_DAEMON_REFUSAL_QUERY_LIMIT,
                       WORDS(word_count("max", STORE_LIST_LIMIT_MAX)));
    q->filter.limit = (int)limit;
}

static void read_subject(struct list_query *q)
{
    if (q->subject[0] == '\0') return;
    q->filter.subject = q->subject;
    if (!text_is_pseudonym(q->subject))
        doc_faults_say(&q->faults, "subject", "malformed", WORD_DAEMON_REFUSAL_QUERY_SUBJECT, NULL);
}

static bool read_list_query(struct call *call, struct list_query *q, struct http_response *ret)
{
    struct problem problem;
    memset(&q->filter, 0, sizeof q->filter);
    doc_faults_init(&q->faults);
    q->faults.language = reply_language(call->request);
    find_text(call, q, "subject", q->subject, sizeof q->subject);
    find_text(call, q, "side", q->side, sizeof q->side);
    find_text(call, q, "status", q->status, sizeof q->status);
    find_text(call, q, "limit", q->limit, sizeof q->limit);
    find_text(call, q, "cursor", q->cursor, sizeof q->cursor);
    read_subject(q);
    read_side(q);
    read_status(q);
    read_limit(q);
    q->filter.cursor = q->cursor[0] == '\0' ? NULL : q->cursor;
    q->filter.with_results = true;
    if (q->faults.count == 0) return true;
    problem_say(&problem, PROBLEM_BAD_REQUEST, q->faults.language, WORD_DAEMON_REFUSAL_QUERY, NULL);
    problem.faults = q->faults;
    reply_problem(call->request, &problem, ret);
    return false;
}

/* ------------------------------------------------------------------------------ JSON */

struct json_page {
    struct json_out out;
    struct events *events;
    enum ischia_code code;
    struct ischia_error err;
};

static bool write_row(void *context, const struct store_assessment *row)
{
    struct json_page *page = context;
    double fraction = 0;
    if (!queue_is_final(row->state)) (void)events_fraction(page->events, &row->id, &fraction);
    json_open_object(&page->out, NULL);
    page->code = documents_write(&page->out, row, fraction, &page->err);
    json_close_object(&page->out);
    return page->code == ISCHIA_OK;
}

static enum ischia_code write_json(struct call *call, const struct list_query *q,
                                   struct json_page *page, char cursor[STORE_CURSOR_BYTES])
{
    json_open_object(&page->out, NULL);
    json_open_array(&page->out, "items");
    TRY(store_list(call->service->store, &q->filter, write_row, page, cursor, &page->err));
    TRY(page->code);
    json_close_array(&page->out);
    json_put_string(&page->out, "next_cursor", cursor[0] == '\0' ? NULL : cursor);
    json_close_object(&page->out);
    return ISCHIA_OK;
}

/* The next page's address, as RFC 8288 has it; the subject stays out of headers and logs. */
static void put_next(const struct list_query *q, const char *cursor, struct http_response *ret)
{
    if (cursor[0] == '\0') return;
    if (q->filter.subject == NULL)
        http_header(ret, "Link", "</v1/assessments?limit=%d&cursor=%s%s%s%s%s>; rel=\"next\"",
                    q->filter.limit, cursor, q->side[0] == '\0' ? "" : "&side=", q->side,
                    q->status[0] == '\0' ? "" : "&status=", q->status);
    http_header(ret, "X-Next-Cursor", "%s", cursor);
}

static void send_json(struct call *call, const struct list_query *q, struct http_response *ret)
{
    struct json_page page = {.events = call->service->events, .code = ISCHIA_OK};
    char cursor[STORE_CURSOR_BYTES] = "", *text = NULL;
    size_t size = 0;
    json_out_init(&page.out, 0);
    enum ischia_code code = write_json(call, q, &page, cursor);
    if (code == ISCHIA_OK)
        code = json_out_take(&page.out, &text, &size, &page.err);
    else
        json_out_finish(&page.out);
    if (code == ISCHIA_OK) {
        put_next(q, cursor, ret);
        http_body(ret, "application/json", text, size);
    } else if (code == ISCHIA_E_INPUT && q->filter.cursor != NULL) {
        reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_QUERY_CURSOR,
                      NULL);
    } else {
        reply_failure(call->request, ret, &page.err);
    }
}

/* ------------------------------------------------------------------------------- CSV */

static const char *const csv_head[] = {"id",   "created_at", "finished_at", "subject",
                                       "side", "label",      "measured_at", "resolution"};
enum { CSV_HEAD_COUNT = sizeof csv_head / sizeof csv_head[0] };

struct csv_page {
    struct text_out out;
    enum ischia_code code;
    struct ischia_error err;
};

static void put_csv_header(struct text_out *out)
{
    for (int i = 0; i < CSV_HEAD_COUNT; i++) csv_put_text(out, csv_head[i], i == 0);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) csv_put_text(out, ischia_params[i].key, false);
    result_csv_put_header(out, false);
    uncertainty_csv_put_header(out);
    csv_end_row(out);
}

/* The detail of a problem document, "" when there is none. */
static void problem_detail(const char *json, struct problem *ret)
{
    ret->detail[0] = '\0';
    if (json != NULL && problem_doc_read(ret, json, strlen(json), NULL) != ISCHIA_OK)
        ret->detail[0] = '\0';
}

static void put_csv_result(struct csv_page *page, const struct store_assessment *row)
{
    struct ischia_result result;
    struct problem problem;
    const struct ischia_result *shown = NULL;
    problem_detail(row->problem_json, &problem);
    if (row->result_json != NULL) {
        page->code = result_doc_read(&result, NULL, row->result_json, strlen(row->result_json),
                                     &json_limits_stored, &page->err);
        if (page->code == ISCHIA_OK) shown = &result;
    }
    result_csv_put(&page->out, queue_state_names[row->state], problem.detail, shown, false);
}

static void put_csv_interval(struct csv_page *page, const struct store_assessment *row)
{
    struct ischia_uncertainty u;
    bool present = false;
    if (row->result_json != NULL && page->code == ISCHIA_OK)
        page->code = uncertainty_doc_read(&u, &present, row->result_json, strlen(row->result_json),
                                          &page->err);
    uncertainty_csv_put(&page->out, present ? &u : NULL);
}

static bool write_csv_row(void *context, const struct store_assessment *row)
{
    struct csv_page *page = context;
    struct ischia_request request;
    char id[UUID_TEXT_BYTES], created[DOCUMENTS_TIME_BYTES], finished[DOCUMENTS_TIME_BYTES];
    page->code = documents_request(&request, row, &page->err);
    if (page->code != ISCHIA_OK) return false;
    uuid_format(&row->id, id);
    documents_time(row->created_ms, created);
    documents_time(row->finished_ms, finished);
    const char *const head[CSV_HEAD_COUNT] = {id,
                                              created,
                                              finished,
                                              request.subject,
                                              ischia_side_names[request.side],
                                              request.label,
                                              request.measured_at,
                                              ischia_resolution_names[request.values.resolution]};
    for (int i = 0; i < CSV_HEAD_COUNT; i++)
        (head[i] == request.label ? csv_put_typed : csv_put_text)(&page->out, head[i], i == 0);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        csv_put_number(&page->out, request.values.param[i], false);
    put_csv_result(page, row);
    put_csv_interval(page, row);
    csv_end_row(&page->out);
    return page->code == ISCHIA_OK;
}

static void send_csv(struct call *call, const struct list_query *q, struct http_response *ret)
{
    struct csv_page page = {.code = ISCHIA_OK};
    char cursor[STORE_CURSOR_BYTES] = "";
    text_out_init(&page.out);
    put_csv_header(&page.out);
    enum ischia_code code =
        store_list(call->service->store, &q->filter, write_csv_row, &page, cursor, &page.err);
    if (code == ISCHIA_OK) code = page.code;
    if (code == ISCHIA_OK) {
        put_next(q, cursor, ret);
        http_header_static(ret, "Content-Disposition", "attachment; filename=\"assessments.csv\"");
        reply_text(call->request, ret, 200, "text/csv; charset=utf-8; header=present", &page.out);
    } else {
        text_out_finish(&page.out);
        if (code == ISCHIA_E_INPUT && q->filter.cursor != NULL)
            reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_QUERY_CURSOR,
                          NULL);
        else
            reply_failure(call->request, ret, &page.err);
    }
}

void handle_list(struct call *call, struct http_response *ret)
{
    struct list_query q;
    const int64_t begun_us = metrics_now_us();
    if (!read_list_query(call, &q, ret)) return;
    http_header_static(ret, "Cache-Control", "no-store");
    http_header_static(ret, "Vary", "Accept");
    if (call->accepted == 1)
        send_csv(call, &q, ret);
    else
        send_json(call, &q, ret);
    metrics_store(STORE_LISTS, (double)(metrics_now_us() - begun_us) / 1e6);
}

/* --------------------------------------------------------------------------- changes */

struct changes_page {
    struct json_out out;
    int64_t last_seq; /* of the items; 0: none yet */
};

static bool write_change(void *context, const struct store_change *change)
{
    struct changes_page *page = context;
    struct json_out *out = &page->out;
    page->last_seq = change->seq;
    char id[UUID_TEXT_BYTES], at[DOCUMENTS_TIME_BYTES];
    uuid_format(&change->id, id);
    documents_time(change->at_ms, at);
    json_open_object(out, NULL);
    json_put_integer(out, "seq", change->seq);
    json_put_string(out, "change", store_change_names[change->kind]);
    json_put_string(out, "id", id);
    json_put_string(out, "at", at);
    json_close_object(out);
    return true;
}

static bool read_changes_query(struct call *call, long long *ret_since, long long *ret_limit,
                               struct http_response *ret)
{
    char since[24], limit[16];
    const enum query_answer s = query_find(call->request->query, "since", since, sizeof since);
    const enum query_answer l = query_find(call->request->query, "limit", limit, sizeof limit);
    const bool good =
        s != QUERY_BAD && l != QUERY_BAD &&
        (s == QUERY_ABSENT || query_whole_number(since, 0, INT64_MAX, ret_since)) &&
        (l == QUERY_ABSENT || query_whole_number(limit, 1, STORE_LIST_LIMIT_MAX, ret_limit));
    if (!good)
        reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_QUERY_SINCE,
                      WORDS(word_count("max", STORE_LIST_LIMIT_MAX)));
    return good;
}

void handle_changes(struct call *call, struct http_response *ret)
{
    struct changes_page page = {.last_seq = 0};
    struct ischia_error err;
    char *text = NULL;
    size_t size = 0;
    int64_t newest = 0;
    long long since = 0, limit = CHANGES_USUAL;
    if (!read_changes_query(call, &since, &limit, ret)) return;
    struct json_out *out = &page.out;
    json_out_init(out, 0);
    json_open_object(out, NULL);
    json_open_array(out, "items");
    enum ischia_code code =
        store_changes(call->service->store, since, (int)limit, write_change, &page, &newest, &err);
    json_close_array(out);
    /* Where to go on from: there may be more than the page has room for. */
    json_put_integer(out, "last_seq", page.last_seq > 0 ? page.last_seq : newest);
    json_put_integer(out, "newest_seq", newest);
    json_close_object(out);
    if (code == ISCHIA_OK)
        code = json_out_take(out, &text, &size, &err);
    else
        json_out_finish(out);
    http_header_static(ret, "Cache-Control", "no-store");
    if (code == ISCHIA_OK)
        http_body(ret, "application/json", text, size);
    else
        reply_failure(call->request, ret, &err);
}
