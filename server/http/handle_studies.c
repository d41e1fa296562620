/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/problem_doc.h"
#include "api/text.h"
#include "server/digest.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/routes.h"
#include "server/http/submit.h"
#include "server/studies.h"

/* Studies: accept a design or a cohort, follow it, take its results, stop it. */

enum { LIST_USUAL = 50, NAME_BYTES = ISCHIA_SUBJECT_BYTES, WORD_BYTES = 32 };

/* -------------------------------------------------------------------------------- replies */

/* The study as it is now; false when ret is the answer already. */
static bool find_study(struct call *call, struct store_study *ret_study, struct http_response *ret)
{
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    memset(ret_study, 0, sizeof *ret_study);
    if (store_study_get(call->service->store, &call->id, ret_study, &answer, &err) != ISCHIA_OK)
        reply_failure(call->request, ret, &err);
    else if (answer != STORE_DONE)
        reply_no_study(call, ret);
    else
        return true;
    return false;
}

/* Everything that can change about it. */
static void put_etag(const struct store_study *study, struct http_response *ret)
{
    const int64_t *n = study->count;
    (void)snprintf(ret->etag, sizeof ret->etag, "\"s%lld-%lld-%lld-%lld-%lld\"",
                   (long long)n[QUEUE_QUEUED], (long long)n[QUEUE_RUNNING],
                   (long long)n[QUEUE_SUCCEEDED], (long long)n[QUEUE_FAILED],
                   (long long)n[QUEUE_CANCELLED]);
    http_header_static(ret, "Cache-Control", "no-cache, private");
}

static void send_study(struct call *call, int status, struct http_response *ret)
{
    struct store_study study;
    struct json_out out;
    struct ischia_error err;
    char *text = NULL;
    size_t size = 0;
    if (!find_study(call, &study, ret)) return;
    put_etag(&study, ret);
    if (call->request->method != HTTP_POST && reply_not_modified(call->request, ret)) {
        store_study_finish(&study);
        return;
    }
    json_out_init(&out, 2);
    json_open_object(&out, NULL);
    studies_write(&out, &study);
    json_close_object(&out);
    store_study_finish(&study);
    if (json_out_take(&out, &text, &size, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return;
    }
    ret->status = status;
    http_body(ret, "application/json", text, size);
}

/* -------------------------------------------------------------------------------- accept */

struct cohort_query {
    char name[NAME_BYTES], model[WORD_BYTES], resolution[WORD_BYTES];
};

static bool is_csv(const struct call *call)
{
    const char *type = http_request_header(call->request, "Content-Type");
    return type != NULL && query_media_type_is(type, "text/csv");
}

/* A text of the query; false: ret is the refusal. */
static bool find_text(struct call *call, const char *key, char *value, size_t size,
                      struct http_response *ret)
{
    if (query_find(call->request->query, key, value, size) != QUERY_BAD) return true;
    reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_QUERY_TEXT,
                  WORDS(word_text("key", key)));
    return false;
}

/* What a CSV file has no place for. A design says it itself. */
static bool read_query(struct call *call, struct cohort_query *q, struct http_response *ret)
{
    const bool good = find_text(call, "name", q->name, sizeof q->name, ret) &&
                      find_text(call, "model", q->model, sizeof q->model, ret) &&
                      find_text(call, "resolution", q->resolution, sizeof q->resolution, ret);
    if (!good) return false;
    const bool given = q->name[0] != '\0' || q->model[0] != '\0' || q->resolution[0] != '\0';
    const bool misplaced = given && !is_csv(call);
    if (!misplaced && (q->name[0] == '\0' || text_is_pseudonym(q->name))) return true;
    reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST,
                  misplaced ? WORD_DAEMON_REFUSAL_STUDY_QUERY : WORD_DAEMON_REFUSAL_STUDY_NAME,
                  NULL);
    return false;
}

static const char *or_null(const char *text) { return text[0] == '\0' ? NULL : text; }

static enum ischia_code read_body(struct call *call, const struct cohort_query *q,
                                  struct studies_new *study, struct doc_faults *faults,
                                  struct ischia_error *err)
{
    const struct http_request *http = call->request;
    const size_t points_max = (size_t)call->service->config.study_limit;
    const struct case_doc_defaults defaults = {or_null(q->resolution), or_null(q->model)};
    if (!is_csv(call))
        return studies_read_design(study, http->body, http->body_size, points_max, faults, err);
    return studies_read_cohort(study, http->body, http->body_size,
                               q->name[0] == '\0' ? "cohort" : q->name, &defaults, points_max,
                               faults, err);
}

/* False: ret is the refusal. */
static bool read_study(struct call *call, struct studies_new *study, struct http_response *ret)
{
    struct cohort_query q;
    struct doc_faults faults;
    struct problem problem;
    struct ischia_error err;
    doc_faults_init(&faults);
    faults.language = reply_language(call->request);
    memset(study, 0, sizeof *study);
    if (!read_query(call, &q, ret)) return false;
    const enum ischia_code code = read_body(call, &q, study, &faults, &err);
    if (code == ISCHIA_OK && faults.count == 0) return true;
    if (code != ISCHIA_OK)
        problem_from_error(&problem, &err);
    else
        problem_from_faults(&problem, &faults);
    reply_problem(call->request, &problem, ret);
    return false;
}

static bool is_accepted(struct call *call, const struct store_study_accepted *accepted,
                        struct http_response *ret)
{
    if (accepted->acceptance == STORE_KEY_CONFLICT) {
        reply_refusal(call->request, ret, PROBLEM_IDEMPOTENCY, WORD_DAEMON_REFUSAL_KEY_CONFLICT,
                      NULL);
        return false;
    }
    if (accepted->acceptance != STORE_FULL) return true;
    http_header_static(ret, "Retry-After", "300");
    reply_refusal(call->request, ret, PROBLEM_QUEUE_FULL, WORD_DAEMON_REFUSAL_STUDY_FULL,
                  WORDS(word_count("n", accepted->waiting),
                        word_count("max", call->service->config.study_limit)));
    return false;
}

static void accept(struct call *call, struct studies_new *study, const char *key,
                   struct http_response *ret)
{
    struct store_study_accepted accepted = {0};
    struct ischia_error err;
    const struct digest_part body[] = {{call->request->body, call->request->body_size},
                                       digest_text(call->request->query)};
    study->what.client = call->who.id;
    study->what.idempotency_key = key;
    study->what.waiting_max = call->service->config.study_limit;
    digest_parts(body, sizeof body / sizeof body[0], study->what.body_digest);
    studies_put_keys(study, call->service->queue);
    if (queue_accept_study(call->service->queue, &study->what, &accepted, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return;
    }
    if (!is_accepted(call, &accepted, ret)) return;
    call->id = accepted.id;
    uuid_format(&call->id, call->id_text);
    http_header(ret, "Location", "/v1/studies/%s", call->id_text);
    send_study(call, 202, ret);
}

void handle_study_submit(struct call *call, struct http_response *ret)
{
    struct studies_new study = {0};
    const char *key = NULL;
    if (submit_read_key(call, &key, ret) && read_study(call, &study, ret))
        accept(call, &study, key, ret);
    studies_new_finish(&study);
}

/* ---------------------------------------------------------------------------- read, list */

void handle_study_get(struct call *call, struct http_response *ret) { send_study(call, 200, ret); }

struct page {
    struct json_out out;
    int limit, shown;
    int64_t last_seq; /* of the last one shown */
    bool more;
};

static bool write_study(void *context, const struct store_study *study)
{
    struct page *page = context;
    page->more = page->shown == page->limit; /* one more than the limit is asked for */
    if (page->more) return false;
    json_open_object(&page->out, NULL);
    studies_write(&page->out, study);
    json_close_object(&page->out);
    page->last_seq = study->seq;
    page->shown++;
    return true;
}

static bool read_page_query(struct call *call, long long *ret_limit, long long *ret_cursor,
                            struct http_response *ret)
{
    enum { MOST = STORE_LIST_LIMIT_MAX - 1 };
    char limit[16], cursor[24];
    const enum query_answer l = query_find(call->request->query, "limit", limit, sizeof limit);
    const enum query_answer c = query_find(call->request->query, "cursor", cursor, sizeof cursor);
    const bool good = l != QUERY_BAD && c != QUERY_BAD &&
                      (l == QUERY_ABSENT || query_whole_number(limit, 1, MOST, ret_limit)) &&
                      (c == QUERY_ABSENT || query_whole_number(cursor, 1, INT64_MAX, ret_cursor));
    if (!good)
        reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_STUDY_LIST,
                      WORDS(word_count("max", MOST)));
    return good;
}

void handle_study_list(struct call *call, struct http_response *ret)
{
    struct page page = {.shown = 0};
    struct ischia_error err;
    char *text = NULL, next[24];
    size_t size = 0;
    long long limit = LIST_USUAL, cursor = 0;
    if (!read_page_query(call, &limit, &cursor, ret)) return;
    page.limit = (int)limit;
    json_out_init(&page.out, 2);
    json_open_object(&page.out, NULL);
    json_open_array(&page.out, "items");
    enum ischia_code code =
        store_study_list(call->service->store, cursor, page.limit + 1, write_study, &page, &err);
    json_close_array(&page.out);
    (void)snprintf(next, sizeof next, "%lld", (long long)page.last_seq);
    json_put_string(&page.out, "next_cursor", page.more ? next : NULL);
    json_close_object(&page.out);
    if (code == ISCHIA_OK)
        code = json_out_take(&page.out, &text, &size, &err);
    else
        json_out_finish(&page.out);
    http_header_static(ret, "Cache-Control", "no-store");
    if (code == ISCHIA_OK)
        http_body(ret, "application/json", text, size);
    else
        reply_failure(call->request, ret, &err);
}

void handle_study_results(struct call *call, struct http_response *ret)
{
    struct store_study study;
    struct ischia_error err;
    char *text = NULL;
    size_t size = 0;
    const bool csv = call->accepted == 1;
    if (!find_study(call, &study, ret)) return;
    const enum ischia_code code =
        csv ? studies_results_csv(call->service->store, &study, &text, &size, &err)
            : studies_results_json(call->service->store, &study, &text, &size, &err);
    store_study_finish(&study);
    if (code != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return;
    }
    http_header_static(ret, "Cache-Control", "no-store");
    http_body(ret, csv ? "text/csv; charset=utf-8; header=present" : "application/json", text,
              size);
    ret->compressible = true;
}

/* -------------------------------------------------------------------------- cancel, erase */

void handle_study_cancel(struct call *call, struct http_response *ret)
{
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    if (queue_cancel_study(call->service->queue, &call->id, &answer, &err) != ISCHIA_OK)
        reply_failure(call->request, ret, &err);
    else if (answer == STORE_NOT_FOUND)
        reply_no_study(call, ret);
    else if (answer == STORE_CONFLICT)
        reply_refusal(call->request, ret, PROBLEM_CONFLICT, WORD_DAEMON_REFUSAL_STUDY_ENDED, NULL);
    else
        send_study(call, 200, ret); /* cancelling twice is no fault */
}

void handle_study_erase(struct call *call, struct http_response *ret)
{
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    if (store_study_erase(call->service->store, &call->id, &answer, &err) != ISCHIA_OK)
        reply_failure(call->request, ret, &err);
    else if (answer == STORE_NOT_FOUND)
        reply_no_study(call, ret);
    else if (answer == STORE_CONFLICT)
        reply_refusal(call->request, ret, PROBLEM_CONFLICT, WORD_DAEMON_REFUSAL_STUDY_RUNNING,
                      NULL);
    else
        ret->status = 204;
}
