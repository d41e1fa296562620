/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A study's document, and its results so far as CSV and as JSON. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/csv.h"
#include "api/json.h"
#include "api/problem_doc.h"
#include "api/result_csv.h"
#include "api/result_doc.h"
#include "api/study_response.h"
#include "server/http/documents.h"
#include "server/studies.h"

static const struct json_limits list_limits = {1024 * 1024, 4, 4096};

/* ----------------------------------------------------------------------------- document */

const char *studies_status(const struct store_study *study)
{
    if (study->cancelled) return "cancelled";
    if (study->finished_ms != 0) return "finished";
    return study->started_ms != 0 ? "running" : "queued";
}

static int64_t total_of(const struct store_study *study)
{
    int64_t total = study->refused;
    for (int i = 0; i < QUEUE_STATE_COUNT; i++) total += study->count[i];
    return total;
}

static void write_points(struct json_out *out, const struct store_study *study)
{
    json_open_object(out, "points");
    json_put_integer(out, "total", total_of(study));
    for (int i = 0; i < QUEUE_STATE_COUNT; i++)
        json_put_integer(out, queue_state_names[i], study->count[i]);
    json_put_integer(out, "refused", study->refused);
    json_close_object(out);
}

static void write_time(struct json_out *out, const char *key, int64_t unix_ms)
{
    char text[DOCUMENTS_TIME_BYTES];
    documents_time(unix_ms, text);
    json_put_string(out, key, text[0] == '\0' ? NULL : text);
}

static void write_links(struct json_out *out, const char *id)
{
    char address[96];
    (void)snprintf(address, sizeof address, "/v1/studies/%s", id);
    json_open_object(out, "links");
    json_put_string(out, "self", address);
    (void)snprintf(address, sizeof address, "/v1/studies/%s/results", id);
    json_put_string(out, "results", address);
    json_close_object(out);
}

void studies_write(struct json_out *out, const struct store_study *study)
{
    char id[UUID_TEXT_BYTES];
    const int64_t left = study->count[QUEUE_QUEUED] + study->count[QUEUE_RUNNING];
    const int64_t total = total_of(study);
    uuid_format(&study->id, id);
    json_put_string(out, "id", id);
    json_put_string(out, "kind", study->responses_json == NULL ? "cohort" : "design");
    json_put_string(out, "name", study->name);
    json_put_string(out, "status", studies_status(study));
    write_time(out, "created_at", study->created_ms);
    write_time(out, "started_at", study->started_ms);
    write_time(out, "finished_at", study->finished_ms);
    json_put_number(out, "progress", total == 0 ? 1 : (double)(total - left) / (double)total);
    write_points(out, study);
    write_links(out, id);
}

/* -------------------------------------------------------------------------------- a point */

enum { REASON_BYTES = 640 };

/* What the store has of a point, read. */
struct point {
    const struct store_study_point *row;
    struct ischia_result result;   /* when succeeded */
    struct problem problem;        /* when failed or refused */
    struct ischia_request request; /* unless refused */
};

struct listing {
    const struct store_study *study;
    int response_count; /* of a design */
    int response[STUDY_RESPONSES_MAX];
    struct text_out csv;
    struct json_out json;
    struct point point;
    enum ischia_code code;
    struct ischia_error err;
};

static enum ischia_code read_case(struct point *point, struct ischia_error *err)
{
    struct doc_faults faults;
    const char *text = point->row->case_json;
    doc_faults_init(&faults);
    if (text == NULL) return ISCHIA_OK;
    TRY(case_doc_read(&point->request, text, strlen(text), &json_limits_stored, &faults, err));
    CHECK(faults.count == 0, err, ISCHIA_E_INPUT, "a stored case is not acceptable: %s",
          faults.item[0].detail);
    return ISCHIA_OK;
}

static enum ischia_code read_point(struct point *point, const struct store_study_point *row,
                                   struct ischia_error *err)
{
    const char *text = row->outcome_json;
    point->row = row;
    TRY(read_case(point, err));
    if (text == NULL) return ISCHIA_OK;
    if (row->state == QUEUE_SUCCEEDED)
        return result_doc_read(&point->result, NULL, text, strlen(text), &json_limits_stored, err);
    return problem_doc_read(&point->problem, text, strlen(text), err);
}

static const char *status_of(const struct point *point)
{
    return point->row->refused ? "refused" : queue_state_names[point->row->state];
}

static bool has_result(const struct point *point) { return point->row->state == QUEUE_SUCCEEDED; }
static bool has_problem(const struct point *point) { return point->row->state == QUEUE_FAILED; }

/* As the command line words it: one printable line. */
static const char *reason_of(const struct point *point, char buffer[REASON_BYTES])
{
    char words[REASON_BYTES];
    const char *word = point->problem.reason, *detail = point->problem.detail;
    if (!has_problem(point)) return "";
    (void)snprintf(words, sizeof words, "%s%s%s", word,
                   word[0] != '\0' && detail[0] != '\0' ? ": " : "", detail);
    return text_printable(words, buffer, REASON_BYTES);
}

/* NaN: there is none. */
static double value_of(const struct point *point, int response)
{
    if (has_result(point)) return study_response_value(response, &point->result);
    if (has_problem(point) && !point->row->refused &&
        strcmp(study_responses[response].name, "last_converged_F_N") == 0)
        return point->problem.last_converged_fraction * point->request.values.param[ISCHIA_F];
    return (double)NAN;
}

/* ------------------------------------------------------------------------------------ CSV */

/* A JSON array of texts as fields of a line. */
static enum ischia_code put_cells(struct text_out *csv, const char *cells_json,
                                  struct ischia_error *err)
{
    struct doc_faults faults;
    struct json *cells;
    bool first = true;
    doc_faults_init(&faults);
    TRY(json_parse(&cells, cells_json, strlen(cells_json), &list_limits, &faults, err));
    for (const struct json *c = json_first(cells); c != NULL; c = json_next(c), first = false)
        csv_put_text(csv, json_type_of(c) == JSON_STRING ? json_string(c) : "", first);
    json_destroy(cells);
    return ISCHIA_OK;
}

static void put_values(struct listing *listing)
{
    char buffer[REASON_BYTES];
    struct text_out *csv = &listing->csv;
    const struct point *point = &listing->point;
    if (listing->study->responses_json == NULL) {
        result_csv_put(csv, status_of(point), reason_of(point, buffer),
                       has_result(point) ? &point->result : NULL, false);
        return;
    }
    csv_put_text(csv, status_of(point), false);
    csv_put_text(csv,
                 has_result(point) ? ischia_reason_name(point->result.numerics.reason)
                                   : reason_of(point, buffer),
                 false);
    for (int i = 0; i < listing->response_count; i++)
        csv_put_number(csv, value_of(point, listing->response[i]), false);
}

static bool write_csv_row(void *context, const struct store_study_point *row)
{
    struct listing *listing = context;
    listing->code = read_point(&listing->point, row, &listing->err);
    if (listing->code == ISCHIA_OK)
        listing->code = put_cells(&listing->csv, row->cells_json, &listing->err);
    if (listing->code != ISCHIA_OK) return false;
    put_values(listing);
    csv_end_row(&listing->csv);
    return true;
}

static enum ischia_code put_header(struct listing *listing, struct ischia_error *err)
{
    struct text_out *csv = &listing->csv;
    TRY(put_cells(csv, listing->study->columns_json, err));
    if (listing->study->responses_json == NULL) {
        result_csv_put_header(csv, false);
    } else {
        csv_put_text(csv, "status", false);
        csv_put_text(csv, "reason", false);
        for (int i = 0; i < listing->response_count; i++)
            csv_put_text(csv, study_responses[listing->response[i]].name, false);
    }
    csv_end_row(csv);
    return ISCHIA_OK;
}

/* ----------------------------------------------------------------------------------- JSON */

static void write_values(struct listing *listing)
{
    struct json_out *out = &listing->json;
    if (!has_result(&listing->point)) {
        json_put_null(out, "results");
        return;
    }
    json_open_object(out, "results");
    for (int i = 0; i < listing->response_count; i++)
        json_put_number_or_null(out, study_responses[listing->response[i]].name,
                                value_of(&listing->point, listing->response[i]));
    json_close_object(out);
}

static void write_inputs(struct listing *listing)
{
    const struct point *point = &listing->point;
    struct json_out *out = &listing->json;
    if (point->row->refused) {
        json_put_null(out, "parameters");
        return;
    }
    json_open_object(out, "parameters");
    case_doc_write_parameters(out, &point->request.values);
    json_close_object(out);
    case_doc_write_options(out, &point->request);
}

static bool write_json_row(void *context, const struct store_study_point *row)
{
    struct listing *listing = context;
    struct json_out *out = &listing->json;
    listing->code = read_point(&listing->point, row, &listing->err);
    if (listing->code != ISCHIA_OK) return false;
    json_open_object(out, NULL);
    json_put_integer(out, "row", row->line);
    json_put_string(out, "status", status_of(&listing->point));
    json_put_raw(out, "cells", row->cells_json);
    write_inputs(listing);
    write_values(listing);
    if (has_problem(&listing->point))
        json_put_raw(out, "problem", row->outcome_json);
    else
        json_put_null(out, "problem");
    json_close_object(out);
    return true;
}

static enum ischia_code write_json(struct listing *listing, struct store *store,
                                   struct ischia_error *err)
{
    struct json_out *out = &listing->json;
    char id[UUID_TEXT_BYTES];
    uuid_format(&listing->study->id, id);
    json_open_object(out, NULL);
    json_put_string(out, "id", id);
    json_put_string(out, "name", listing->study->name);
    json_put_string(out, "status", studies_status(listing->study));
    json_put_raw(out, "columns", listing->study->columns_json);
    json_open_array(out, "items");
    TRY(store_study_points(store, &listing->study->id, write_json_row, listing, err));
    json_close_array(out);
    json_close_object(out);
    return ISCHIA_OK;
}

/* ------------------------------------------------------------------------------ the whole */

/* The results to show: those that were asked for; of a cohort all. */
static enum ischia_code find_responses(struct listing *listing, struct ischia_error *err)
{
    const char *text = listing->study->responses_json;
    struct doc_faults faults;
    struct json *names;
    if (text == NULL) {
        for (int i = 0; i < study_response_count; i++) listing->response[i] = i;
        listing->response_count = study_response_count;
        return ISCHIA_OK;
    }
    doc_faults_init(&faults);
    TRY(json_parse(&names, text, strlen(text), &list_limits, &faults, err));
    for (const struct json *n = json_first(names); n != NULL; n = json_next(n)) {
        const int found = study_response_find(json_type_of(n) == JSON_STRING ? json_string(n) : "");
        if (found >= 0 && listing->response_count < STUDY_RESPONSES_MAX)
            listing->response[listing->response_count++] = found;
    }
    json_destroy(names);
    return ISCHIA_OK;
}

static enum ischia_code list_csv(struct listing *listing, struct store *store,
                                 struct ischia_error *err)
{
    TRY(find_responses(listing, err));
    TRY(put_header(listing, err));
    return store_study_points(store, &listing->study->id, write_csv_row, listing, err);
}

static enum ischia_code list_json(struct listing *listing, struct store *store,
                                  struct ischia_error *err)
{
    TRY(find_responses(listing, err));
    return write_json(listing, store, err);
}

/* NULL: no memory. */
static struct listing *listing_create(const struct store_study *study)
{
    struct listing *listing = calloc(1, sizeof *listing);
    if (listing == NULL) return NULL;
    listing->study = study;
    listing->code = ISCHIA_OK;
    text_out_init(&listing->csv);
    json_out_init(&listing->json, 0);
    return listing;
}

static void listing_destroy(struct listing *listing)
{
    text_out_finish(&listing->csv);
    json_out_finish(&listing->json);
    free(listing);
}

/* A row that could not be read is the failure of the whole. */
static enum ischia_code code_of(const struct listing *listing, enum ischia_code code,
                                struct ischia_error *err)
{
    if (code != ISCHIA_OK || listing->code == ISCHIA_OK) return code;
    return FAIL(err, listing->code, "%s", listing->err.message);
}

enum ischia_code studies_results_csv(struct store *store, const struct store_study *study,
                                     char **ret, size_t *ret_size, struct ischia_error *err)
{
    struct listing *listing = listing_create(study);
    CHECK(listing != NULL, err, ISCHIA_E_MEMORY, "no memory for results");
    enum ischia_code code = code_of(listing, list_csv(listing, store, err), err);
    if (code == ISCHIA_OK) code = text_out_take(&listing->csv, ret, ret_size, err);
    listing_destroy(listing);
    return code;
}

enum ischia_code studies_results_json(struct store *store, const struct store_study *study,
                                      char **ret, size_t *ret_size, struct ischia_error *err)
{
    struct listing *listing = listing_create(study);
    CHECK(listing != NULL, err, ISCHIA_E_MEMORY, "no memory for results");
    enum ischia_code code = code_of(listing, list_json(listing, store, err), err);
    if (code == ISCHIA_OK) code = json_out_take(&listing->json, ret, ret_size, err);
    listing_destroy(listing);
    return code;
}
