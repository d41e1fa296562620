/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/studies.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/case_words.h"
#include "api/cohort_rows.h"
#include "api/json.h"
#include "api/problem_doc.h"
#include "api/study_plan.h"
#include "server/intake.h"
#include "server/queue.h"

/* ------------------------------------------------------------------------------- points */

void studies_new_finish(struct studies_new *study)
{
    for (size_t i = 0; i < study->what.count; i++) {
        free((void *)(uintptr_t)study->point[i].cells_json);
        free((void *)(uintptr_t)study->point[i].case_json);
        free((void *)(uintptr_t)study->point[i].problem_json);
    }
    free(study->point);
    free(study->columns_json);
    free(study->responses_json);
    memset(study, 0, sizeof *study);
}

static enum ischia_code make_room(struct studies_new *study, struct ischia_error *err)
{
    if (study->what.count < study->room) return ISCHIA_OK;
    const size_t room = study->room == 0 ? 64 : 2 * study->room;
    struct store_study_point_new *larger = realloc(study->point, room * sizeof *larger);
    CHECK(larger != NULL, err, ISCHIA_E_MEMORY, "no memory for the points of a study");
    study->point = larger;
    study->room = room;
    return ISCHIA_OK;
}

/* Takes over cells_json. request: NULL when the point is refused, and problem then says why. */
static enum ischia_code add_point(struct studies_new *study, char *cells_json,
                                  const struct ischia_request *request,
                                  const struct problem *problem, struct ischia_error *err)
{
    struct store_study_point_new point = {.cells_json = cells_json};
    char *text = NULL;
    enum ischia_code code = make_room(study, err);
    if (code == ISCHIA_OK)
        code = request != NULL ? intake_case_text(request, &text, err)
                               : problem_doc_text(&text, problem, err);
    if (code != ISCHIA_OK) {
        free(cells_json);
        return code;
    }
    *(request != NULL ? &point.case_json : &point.problem_json) = text;
    study->point[study->what.count++] = point;
    study->what.point = study->point;
    return ISCHIA_OK;
}

void studies_put_keys(struct studies_new *study, const struct queue *queue)
{
    for (size_t i = 0; i < study->what.count; i++)
        if (study->point[i].case_json != NULL)
            queue_case_key(queue, study->point[i].case_json, study->point[i].case_key);
}

/* ------------------------------------------------------------------------------- designs */

/* The first `count` fields of a line of plain fields, as a JSON array of texts. */
static enum ischia_code cells_of_line(struct text_out *line, int count, char **ret,
                                      struct ischia_error *err)
{
    struct json_out out;
    char *text = NULL, *rest;
    TRY(text_out_take(line, &text, NULL, err));
    json_out_init(&out, 0);
    json_open_array(&out, NULL);
    rest = text;
    for (int i = 0; i < count; i++) json_put_string(&out, NULL, strsep(&rest, ","));
    json_close_array(&out);
    free(text);
    return json_out_take(&out, ret, NULL, err);
}

static int input_columns(const struct study_plan *plan)
{
    int count = 1 + ISCHIA_PARAM_COUNT;
    for (int f = 0; f < plan->design.factor_count; f++) count += plan->design.factor[f].is_option;
    return count;
}

static enum ischia_code add_design_point(struct studies_new *study, const struct study_plan *plan,
                                         size_t row, struct ischia_error *err)
{
    struct ischia_request request;
    struct ischia_case_fault faults[ISCHIA_CASE_FAULTS_MAX];
    struct ischia_fault words = {0};
    struct problem problem;
    struct text_out line;
    char *cells = NULL;
    ischia_request_init(&request);
    memcpy(request.preset, plan->preset, sizeof request.preset);
    request.values = design_case(&plan->design, &plan->points, row);
    text_out_init(&line);
    study_plan_put_inputs(&line, plan, row);
    TRY(cells_of_line(&line, input_columns(plan), &cells, err));
    if (ischia_case_faults(&request.values, faults) == 0)
        return add_point(study, cells, &request, NULL, err);
    case_fault_words(&words, LANGUAGE_EN, &request.values, &faults[0]);
    problem_init(&problem, PROBLEM_INVALID, "%s", words.detail);
    (void)snprintf(problem.reason, sizeof problem.reason, "%s", words.code);
    return add_point(study, cells, NULL, &problem, err);
}

static enum ischia_code put_columns(struct studies_new *study, const struct study_plan *plan,
                                    struct ischia_error *err)
{
    struct text_out header;
    struct json_out out;
    text_out_init(&header);
    study_plan_put_header(&header, plan);
    TRY(cells_of_line(&header, input_columns(plan), &study->columns_json, err));
    json_out_init(&out, 0);
    json_open_array(&out, NULL);
    for (int r = 0; r < plan->response_count; r++)
        json_put_string(&out, NULL, study_responses[plan->response[r]].name);
    json_close_array(&out);
    TRY(json_out_take(&out, &study->responses_json, NULL, err));
    study->what.columns_json = study->columns_json;
    study->what.responses_json = study->responses_json;
    return ISCHIA_OK;
}

static enum ischia_code take_plan(struct studies_new *study, const struct study_plan *plan,
                                  struct ischia_error *err)
{
    (void)snprintf(study->name, sizeof study->name, "%s", plan->name);
    study->what.name = study->name;
    TRY(put_columns(study, plan, err));
    for (size_t row = 0; row < plan->points.count; row++)
        TRY(add_design_point(study, plan, row, err));
    return ISCHIA_OK;
}

enum ischia_code studies_read_design(struct studies_new *ret, const char *json, size_t length,
                                     size_t points_max, struct doc_faults *faults,
                                     struct ischia_error *err)
{
    const struct case_doc_defaults defaults = {NULL, NULL};
    struct study_plan plan;
    memset(ret, 0, sizeof *ret);
    TRY(study_plan_read(&plan, json, length, &defaults, points_max, faults, err));
    if (faults->count > 0) return ISCHIA_OK;
    const enum ischia_code code = take_plan(ret, &plan, err);
    study_plan_finish(&plan);
    return code;
}

/* ------------------------------------------------------------------------------- cohorts */

struct cohort {
    struct studies_new *study;
    struct cohort_columns columns;
    const struct case_doc_defaults *defaults;
    size_t points_max;
    struct csv_reader reader;
    struct csv_row row;
};

/* The row's fields, as many as the header has. */
static enum ischia_code cells_of_row(const struct csv_row *row, int count, char **ret,
                                     struct ischia_error *err)
{
    struct json_out out;
    json_out_init(&out, 0);
    json_open_array(&out, NULL);
    for (int i = 0; i < count; i++)
        json_put_string(&out, NULL, i < row->count ? row->field[i] : "");
    json_close_array(&out);
    return json_out_take(&out, ret, NULL, err);
}

static void join_faults(struct problem *ret, const struct doc_faults *faults)
{
    problem_init(ret, PROBLEM_INVALID, "%s", "");
    for (size_t i = 0; i < faults->count; i++) {
        const size_t used = strlen(ret->detail);
        (void)snprintf(ret->detail + used, sizeof ret->detail - used, "%s%s", i > 0 ? "; " : "",
                       faults->item[i].detail);
    }
}

static enum ischia_code add_cohort_row(struct cohort *k, struct ischia_error *err)
{
    struct ischia_request request;
    struct doc_faults faults;
    struct problem problem;
    char *cells = NULL, *echo = NULL;
    doc_faults_init(&faults);
    ischia_request_init(&request);
    TRY(cohort_row_read(&k->columns, k->defaults, &k->row, &echo, &request, &faults, err));
    free(echo);
    TRY(cells_of_row(&k->row, k->columns.count, &cells, err));
    if (faults.count == 0) return add_point(k->study, cells, &request, NULL, err);
    join_faults(&problem, &faults);
    return add_point(k->study, cells, NULL, &problem, err);
}

/* A row that is not CSV still gets its line in the results. */
static enum ischia_code add_unreadable_row(struct cohort *k, const struct ischia_error *why,
                                           struct ischia_error *err)
{
    const struct csv_row none = {0};
    struct problem problem;
    char *cells = NULL;
    TRY(cells_of_row(&none, k->columns.count, &cells, err));
    problem_init(&problem, PROBLEM_INVALID, "%s", why->message);
    return add_point(k->study, cells, NULL, &problem, err);
}

static enum ischia_code read_rows(struct cohort *k, struct doc_faults *faults,
                                  struct ischia_error *err)
{
    for (bool end = false;;) {
        struct ischia_error why;
        const enum ischia_code code = csv_read(&k->reader, &k->row, &end, &why);
        if (code == ISCHIA_OK && end) return ISCHIA_OK;
        if (k->study->what.count == k->points_max) {
            doc_faults_say(faults, "", "out_of_range", WORD_DAEMON_REFUSAL_STUDY_ROWS,
                           WORDS(word_count("max", (long long)k->points_max)));
            return ISCHIA_OK;
        }
        if (code == ISCHIA_OK)
            TRY(add_cohort_row(k, err));
        else if (code == ISCHIA_E_INPUT || code == ISCHIA_E_LIMIT)
            TRY(add_unreadable_row(k, &why, err));
        else
            return FAIL(err, code, "%s", why.message);
    }
}

static enum ischia_code read_cohort(struct cohort *k, struct doc_faults *faults,
                                    struct ischia_error *err)
{
    bool end = false;
    TRY(csv_read(&k->reader, &k->row, &end, err));
    CHECK(!end, err, ISCHIA_E_INPUT, "there are no rows; the first one names the columns");
    struct ischia_error why = {0};
    const enum ischia_code code =
        cohort_columns_init(&k->columns, &k->row, COHORT_SD_KEPT, faults, &why);
    if (faults->count > 0) return ISCHIA_OK;
    if (code != ISCHIA_OK) return FAIL(err, code, "%s", why.message);
    TRY(cells_of_row(&k->row, k->columns.count, &k->study->columns_json, err));
    k->study->what.columns_json = k->study->columns_json;
    return read_rows(k, faults, err);
}

/* Defaults that every row would be refused for are a fault once. */
static void check_defaults(const struct case_doc_defaults *defaults, struct doc_faults *faults)
{
    struct ischia_request request;
    struct case_doc_fields fields;
    case_doc_fields_init(&fields, &request, faults);
    case_doc_fields_set_defaults(&fields, defaults);
}

enum ischia_code studies_read_cohort(struct studies_new *ret, const char *csv, size_t length,
                                     const char *name, const struct case_doc_defaults *defaults,
                                     size_t points_max, struct doc_faults *faults,
                                     struct ischia_error *err)
{
    memset(ret, 0, sizeof *ret);
    (void)snprintf(ret->name, sizeof ret->name, "%s", name);
    ret->what.name = ret->name;
    check_defaults(defaults, faults);
    if (faults->count > 0) return ISCHIA_OK;
    CHECK(length > 0, err, ISCHIA_E_INPUT, "there are no rows; the first one names the columns");
    struct cohort *k = calloc(1, sizeof *k);
    FILE *in = fmemopen((void *)(uintptr_t)csv, length, "r");
    enum ischia_code code = ISCHIA_OK;
    if (k == NULL || in == NULL) {
        code = FAIL(err, ISCHIA_E_MEMORY, "no memory for a cohort");
    } else {
        k->study = ret;
        k->defaults = defaults;
        k->points_max = points_max;
        csv_reader_init(&k->reader, in);
        code = read_cohort(k, faults, err);
        cohort_columns_finish(&k->columns);
    }
    if (in != NULL) (void)fclose(in);
    free(k);
    return code;
}
