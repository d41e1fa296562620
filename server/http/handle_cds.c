/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "api/cds.h"
#include "server/http/fhir_http.h"
#include "server/http/reply.h"
#include "server/http/routes.h"
#include "server/intake.h"

/*
 * CDS Hooks 2.0. A hook shows what the store has and nothing else: it never starts a solve, so its
 * answer takes as long as two look-ups.
 */

static void send(struct call *call, struct json_out *out, struct http_response *ret)
{
    http_header_static(ret, "Cache-Control", "no-store");
    fhir_send(call, 200, out, ret);
}

void handle_cds_discovery(struct call *call, struct http_response *ret)
{
    struct json_out out;
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    cds_put_discovery(&out);
    json_close_object(&out);
    send(call, &out, ret);
}

/* --------------------------------------------------------------------------- the hooks */

struct found {
    struct record *record; /* NULL: none */
    enum ischia_code code;
    struct ischia_error *err;
};

static bool keep_record(void *context, const struct store_assessment *row)
{
    struct found *found = context;
    found->record = malloc(sizeof *found->record);
    found->code = found->record == NULL ? FAIL(found->err, ISCHIA_E_MEMORY, "no memory for a card")
                                        : intake_record(found->record, row, found->err);
    return false;
}

/* The person's last succeeded assessment (of this side; NULL: any); *ret is NULL when there is
 * none, else the caller's to free. */
static enum ischia_code find_last(struct call *call, const char *patient, const char *side,
                                  struct record **ret, struct ischia_error *err)
{
    char cursor[STORE_CURSOR_BYTES];
    struct found found = {.code = ISCHIA_OK, .err = err};
    const struct store_alternative person = {
        .kind = STORE_OF_PERSON, .subject = patient + strlen("Patient/"), .reference = patient};
    const struct store_filter filter = {
        .side = side,
        .by_state = true,
        .state = QUEUE_SUCCEEDED,
        .alternative = &person,
        .alternative_count = 1,
        .limit = 1,
        .with_results = true,
    };
    TRY(store_list(call->service->store, &filter, keep_record, &found, cursor, err));
    *ret = found.record;
    return found.code;
}

static const char *other_side(const struct record *record)
{
    static const char *const others[ISCHIA_SIDE_COUNT] = {NULL, "right", "left"};
    return record == NULL ? NULL : others[record->request.side];
}

static void send_cards(struct call *call, const struct cds_request *request,
                       struct http_response *ret)
{
    struct ischia_error err;
    struct json_out out;
    struct record *last = NULL, *other = NULL;
    char origin[FHIR_BASE_BYTES];
    enum ischia_code code = find_last(call, request->patient, NULL, &last, &err);
    if (code == ISCHIA_OK && other_side(last) != NULL)
        code = find_last(call, request->patient, other_side(last), &other, &err);
    fhir_origin(call, origin);
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    json_open_array(&out, "cards");
    if (code == ISCHIA_OK && last != NULL)
        cds_put_card(&out, last, other, request->measured_at, origin);
    json_close_array(&out);
    json_close_object(&out);
    if (code == ISCHIA_OK)
        send(call, &out, ret);
    else
        reply_failure(call->request, ret, &err);
    json_out_finish(&out);
    free(last);
    free(other);
}

/* A body that is no use: 400, with all that is wrong with it. */
static void refuse(struct call *call, enum ischia_code code, const struct ischia_error *err,
                   const struct doc_faults *faults, struct http_response *ret)
{
    struct problem problem;
    if (code != ISCHIA_OK) {
        problem_from_error(&problem, err);
    } else {
        problem_init(&problem, PROBLEM_BAD_REQUEST, "The request does not fit CDS Hooks 2.0.");
        problem.faults = *faults;
    }
    reply_problem(call->request, &problem, ret);
}

static enum cds_service service_of(const struct route *route)
{
    return strstr(route->path, cds_services[CDS_ORDER_SELECT].id) != NULL ? CDS_ORDER_SELECT
                                                                          : CDS_PATIENT_VIEW;
}

void handle_cds_hook(struct call *call, struct http_response *ret)
{
    struct cds_request request;
    struct doc_faults faults;
    struct ischia_error err;
    doc_faults_init(&faults);
    const enum ischia_code code = cds_read(&request, service_of(call->route), call->request->body,
                                           call->request->body_size, &faults, &err);
    if (code != ISCHIA_OK || faults.count > 0)
        refuse(call, code, &err, &faults, ret);
    else if (request.has_observations)
        send_cards(call, &request, ret);
    else
        reply_refusal_english(
            call->request, ret, PROBLEM_PRECONDITION,
            "The prefetch 'observations' is missing; this service asks no other server.");
}

/* ---------------------------------------------------------------------------- feedback */

/* Feedback belongs to an assessment that is there: it is erased with it. */
static bool find_cards(struct call *call, struct store_feedback *rows,
                       const struct cds_feedback *items, size_t count, struct http_response *ret)
{
    for (size_t i = 0; i < count; i++) {
        struct store_assessment row;
        struct ischia_error err;
        enum store_answer answer = STORE_NOT_FOUND;
        memset(&row, 0, sizeof row);
        rows[i] = (struct store_feedback){.service = cds_services[service_of(call->route)].id,
                                          .document = items[i].document};
        if (uuid_parse(items[i].card, &rows[i].card) &&
            store_peek(call->service->store, &rows[i].card, &row, &answer, &err) != ISCHIA_OK) {
            reply_failure(call->request, ret, &err);
            return false;
        }
        if (answer == STORE_DONE) continue;
        reply_refusal_english(call->request, ret, PROBLEM_NOT_FOUND,
                              "There is no card with this uuid.");
        return false;
    }
    return true;
}

static void store_items(struct call *call, const struct cds_feedback *items, size_t count,
                        struct http_response *ret)
{
    struct ischia_error err;
    enum ischia_code code = ISCHIA_OK;
    struct store_feedback *rows = calloc(count, sizeof *rows);
    if (rows == NULL)
        code = FAIL(&err, ISCHIA_E_MEMORY, "no memory for feedback");
    else if (find_cards(call, rows, items, count, ret))
        code = store_feedback_add(call->service->store, rows, count, &err);
    if (code != ISCHIA_OK) reply_failure(call->request, ret, &err);
    free(rows);
}

void handle_cds_feedback(struct call *call, struct http_response *ret)
{
    struct doc_faults faults;
    struct ischia_error err = {.code = ISCHIA_E_MEMORY, .message = "no memory for feedback"};
    size_t count = 0;
    struct cds_feedback *items = calloc(CDS_FEEDBACK_MAX, sizeof *items);
    doc_faults_init(&faults);
    const enum ischia_code code = items == NULL
                                      ? ISCHIA_E_MEMORY
                                      : cds_read_feedback(items, &count, call->request->body,
                                                          call->request->body_size, &faults, &err);
    if (code != ISCHIA_OK || faults.count > 0)
        refuse(call, code, &err, &faults, ret);
    else
        store_items(call, items, count, ret);
    if (items != NULL) cds_feedback_finish(items, count);
    free(items);
}
