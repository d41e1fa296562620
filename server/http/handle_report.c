/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/problem_doc.h"
#include "api/result_doc.h"
#include "api/risk.h"
#include "server/http/page.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/report.h"
#include "server/http/routes.h"

/*
 * GET …/report: one side on one A4 page, for printing and for pages without JavaScript. Before the
 * end it says so, with a button that asks again and waits ("?wait=N"): a page that reloads by
 * itself would take the place from under a screen reader.
 */

enum { WAIT_MAX_S = 60 };

/* ---------------------------------------------------------------------------- tables */

static void put_cell(struct text_out *out, const char *markup, const char *text)
{
    page_put(out, markup);
    page_escape(out, text);
    page_put(out, "</td>");
}

__attribute__((format(printf, 2, 3))) static void put_number(struct text_out *out,
                                                             const char *format, ...)
{
    char value[128];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(value, sizeof value, format, arguments);
    va_end(arguments);
    put_cell(out, "<td class=\"n\">", value);
}

static void begin_table(struct text_out *out, const char *caption)
{
    page_put(out, "<table>\n<caption>");
    page_escape(out, caption);
    page_put(out, "</caption>\n");
}

static void begin_row(struct text_out *out, const char *name)
{
    page_put(out, "<tr><th scope=\"row\">");
    page_escape(out, name);
    page_put(out, "</th>");
}

static void put_column(struct text_out *out, const char *name)
{
    page_put(out, "<th scope=\"col\" class=\"n\">");
    page_escape(out, name);
    page_put(out, "</th>");
}

static void put_inputs(struct text_out *out, const struct ischia_request *request)
{
    begin_table(out, "Inputs");
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        begin_row(out, ischia_params[i].name);
        put_cell(out, "<td>", ischia_params[i].key);
        put_number(out, "%g", request->values.param[i]);
        put_cell(out, "<td>", ischia_params[i].unit);
        page_put(out, "</tr>\n");
    }
    page_put(out, "</table>\n");
}

static void put_strains(struct text_out *out, const struct ischia_result *r)
{
    char above[32], depth[48];
    (void)snprintf(depth, sizeof depth, "axis, %.1f mm below the bone", r->strain.eps_max_depth_mm);
    begin_table(out, "Strain in the muscle");
    begin_row(out, "eps_max");
    put_cell(out, "<td>", "engineering");
    put_number(out, "%.3f \u00b1 %.3f", r->strain.eps_max, r->numerics.eps_max_error);
    put_cell(out, "<td>", depth);
    page_put(out, "</tr>\n");
    const struct {
        const char *name, *measure;
        double value, threshold;
    } rows[] = {
        {"E_shear", "Green\u2013Lagrange", r->strain.E_shear_max, ISCHIA_E_SHEAR_THRESHOLD},
        {"E_comp", "Green\u2013Lagrange", r->strain.E_comp_max, ISCHIA_E_COMP_THRESHOLD},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        (void)snprintf(above, sizeof above, "largest; threshold %.2f", rows[i].threshold);
        begin_row(out, rows[i].name);
        put_cell(out, "<td>", rows[i].measure);
        put_number(out, "%.3f", rows[i].value);
        put_cell(out, "<td>", above);
        page_put(out, "</tr>\n");
    }
    page_put(out, "</table>\n");
}

static void put_seat(struct text_out *out, const struct ischia_seat *seat)
{
    const struct {
        const char *name, *unit;
        int decimals;
        double value;
    } rows[] = {
        {"travel", "mm", 1, seat->displacement_mm},
        {"contact area", "mm\u00b2", 0, seat->contact_area_mm2},
        {"mean pressure", "kPa", 1, seat->mean_pressure_kPa},
        {"peak pressure", "kPa", 1, seat->peak_pressure_kPa},
    };
    begin_table(out, "Seat");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin_row(out, rows[i].name);
        put_number(out, "%.*f", rows[i].decimals, rows[i].value);
        put_cell(out, "<td>", rows[i].unit);
        page_put(out, "</tr>\n");
    }
    page_put(out, "</table>\n");
}

static void put_largest(struct text_out *out, const struct ischia_case *c,
                        const struct ischia_cluster_set *set)
{
    const double tip_mm =
        c->option[ISCHIA_SKIN_THICKNESS] + c->param[ISCHIA_EF] + c->param[ISCHIA_EM];
    if (set->has_largest)
        put_number(out, "%.0f mm\u00b3, %.1f mm", set->largest.volume_mm3,
                   tip_mm - set->largest.centroid_mm[2]);
    else
        put_cell(out, "<td class=\"n\">", "none");
}

static void put_first_force(struct text_out *out, enum ischia_criterion k,
                            const struct ischia_result *r)
{
    const double force_N =
        k == ISCHIA_OVER_SHEAR ? r->threshold_force_shear_N : r->threshold_force_compression_N;
    if (k == ISCHIA_OVER_BOTH)
        page_put(out, "<td></td>");
    else if (isnan(force_N))
        put_cell(out, "<td class=\"n\">", "not reached");
    else
        put_number(out, "%.0f N", force_N);
}

static void put_clusters(struct text_out *out, const struct ischia_case *c,
                         const struct ischia_result *r)
{
    static const struct {
        const char *name;
        double threshold; /* 0: none of its own */
    } criteria[ISCHIA_CRITERION_COUNT] = {
        [ISCHIA_OVER_SHEAR] = {"Shear", ISCHIA_E_SHEAR_THRESHOLD},
        [ISCHIA_OVER_COMPRESSION] = {"Compression", ISCHIA_E_COMP_THRESHOLD},
        [ISCHIA_OVER_BOTH] = {"Both at once", 0},
    };
    char first[40], name[40];
    (void)snprintf(first, sizeof first, "First at (F = %g N)", c->param[ISCHIA_F]);
    begin_table(out, "Muscle over the thresholds (Green\u2013Lagrange; unloaded volume, the whole "
                     "side)");
    page_put(out, "<thead><tr><th scope=\"col\">Criterion</th>");
    const char *const columns[] = {"Volume, mm\u00b3", "of the muscle", "Bodies",
                                   "Largest, under the bone", first};
    for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++) put_column(out, columns[i]);
    page_put(out, "</tr></thead>\n");
    for (int k = 0; k < ISCHIA_CRITERION_COUNT; k++) {
        const struct ischia_cluster_set *set = &r->clusters[k];
        (void)snprintf(name, sizeof name, criteria[k].threshold > 0 ? "%s over %.2f" : "%s",
                       criteria[k].name, criteria[k].threshold);
        begin_row(out, name);
        put_number(out, "%.0f", set->volume_mm3);
        put_number(out, "%.1f %%",
                   r->muscle_volume_mm3 > 0 ? 100 * set->volume_mm3 / r->muscle_volume_mm3 : 0);
        put_number(out, "%d", set->count);
        put_largest(out, c, set);
        put_first_force(out, (enum ischia_criterion)k, r);
        page_put(out, "</tr>\n");
    }
    page_put(out, "</table>\n");
}

/* ----------------------------------------------------------------------------- words */

static void put_headline(struct text_out *out, const char *class, const char *text)
{
    page_put(out, "<p class=\"headline ");
    page_escape(out, class);
    page_put(out, "\">");
    page_escape(out, text);
    page_put(out, "</p>\n");
}

static void put_item(struct text_out *out, const char *class, const char *text)
{
    page_put(out, "<li class=\"");
    page_escape(out, class);
    page_put(out, "\">");
    page_escape(out, text);
    page_put(out, "</li>\n");
}

static void put_title(struct text_out *out, const struct ischia_request *request)
{
    page_put(out, "<header>\n<h1>Tissue strain report");
    if (request->side != ISCHIA_SIDE_NONE)
        page_format(out, " \u00b7 %s side", ischia_side_names[request->side]);
    page_put(out, "</h1>\n<p>");
    page_format(out, "%s%s", request->subject[0] != '\0' ? "Subject " : "", request->subject);
    if (request->label[0] != '\0') page_format(out, " \u00b7 %s", request->label);
    if (request->measured_at[0] != '\0')
        page_format(out, " \u00b7 measured %s", request->measured_at);
    page_put(out, "</p>\n</header>\n");
}

static void put_words(struct text_out *out, const struct ischia_case *c,
                      const struct ischia_result *r)
{
    struct risk risk;
    risk_assess(&risk, c, r);
    put_headline(out, risk_bands[risk.band].name, risk_bands[risk.band].headline);
    page_put(out, "<ul>\n");
    for (int i = 0; i < risk.reason_count; i++) put_item(out, "reason", risk.reason[i]);
    page_put(out, "</ul>\n");
}

static void put_notes(struct text_out *out, const struct ischia_case *c)
{
    struct ischia_fault warnings[ISCHIA_PARAM_COUNT];
    const size_t count = ischia_case_warnings(c, warnings);
    page_put(out, "<section>\n<h2>What this does not say</h2>\n<ul>\n");
    for (size_t i = 0; i < count; i++) put_item(out, "warning", warnings[i].detail);
    for (int i = 0; i < RISK_CAVEAT_COUNT; i++) put_item(out, "caveat", risk_caveats[i]);
    put_item(out, "caveat",
             "eps_max is engineering strain, the thresholds are on "
             "Green\u2013Lagrange strain: never compare one with the other.");
    page_put(out, "</ul>\n</section>\n");
}

/* What made it, which assessment it is, when, and room for a name. */
static void put_end(struct text_out *out, const struct store_assessment *row, bool with_signature)
{
    char id[UUID_TEXT_BYTES], created[DOCUMENTS_TIME_BYTES], finished[DOCUMENTS_TIME_BYTES];
    uuid_format(&row->id, id);
    documents_time(row->created_ms, created);
    documents_time(row->finished_ms, finished);
    page_put(out, "<footer>\n<p>");
    page_format(out, "Ischia %s \u00b7 model %s %d \u00b7 assessment %s \u00b7 created %s",
                ISCHIA_VERSION, ISCHIA_MODEL_NAME, ISCHIA_MODEL_VERSION, id, created);
    if (finished[0] != '\0') page_format(out, " \u00b7 ended %s", finished);
    page_put(out, "</p>\n");
    if (with_signature) page_put(out, "<p class=\"signature\">Name, date, signature</p>\n");
    page_put(out, "</footer>\n");
}

/* ---------------------------------------------------------------------------- states */

static void put_figure(struct text_out *out, const struct store_assessment *row)
{
    char id[UUID_TEXT_BYTES];
    uuid_format(&row->id, id);
    page_put(out, "<figure><figcaption>Section, loaded, coloured by Green\u2013Lagrange shear "
                  "strain</figcaption><img alt=\"Section through the loaded tissue, coloured by "
                  "shear strain, with the threshold's contour\" src=\"/v1/assessments/");
    page_put(out, id);
    page_put(out, "/section.svg\"></figure>\n");
}

/* attached: the text travels alone, without the picture that this service draws. */
static enum ischia_code put_result(struct text_out *out, const struct store_assessment *row,
                                   const struct ischia_request *request, bool attached,
                                   struct ischia_error *err)
{
    struct ischia_result r;
    TRY(result_doc_read(&r, NULL, row->result_json, strlen(row->result_json), &json_limits_stored,
                        err));
    put_words(out, &request->values, &r);
    page_put(out, "<div class=\"columns\">\n<div>\n");
    put_inputs(out, request);
    page_put(out, "</div>\n<div>\n");
    put_strains(out, &r);
    put_seat(out, &r.seat);
    page_put(out, "</div>\n</div>\n");
    put_clusters(out, &request->values, &r);
    if (!attached) put_figure(out, row);
    put_notes(out, &request->values);
    put_end(out, row, true);
    return ISCHIA_OK;
}

static void put_failure(struct text_out *out, const struct store_assessment *row)
{
    struct problem problem;
    put_headline(out, queue_state_names[row->state], "There is no result.");
    page_put(out, "<p>");
    if (row->problem_json != NULL &&
        problem_doc_read(&problem, row->problem_json, strlen(row->problem_json), NULL) == ISCHIA_OK)
        page_escape(out, problem.detail);
    else
        page_format(out, "The assessment ended as %s.", queue_state_names[row->state]);
    page_put(out, "</p>\n");
}

static void put_waiting(struct text_out *out, const struct store_assessment *row)
{
    char id[UUID_TEXT_BYTES];
    uuid_format(&row->id, id);
    put_headline(out, queue_state_names[row->state],
                 row->state == QUEUE_RUNNING ? "Being solved." : "Waiting for a solver.");
    page_put(out, "<div class=\"actions\">\n<form method=\"get\" action=\"/v1/assessments/");
    page_put(out, id);
    page_put(out, "/report\"><button type=\"submit\" name=\"wait\" value=\"60\">Wait for the "
                  "result</button></form>\n<form method=\"post\" action=\"/v1/assessments/");
    page_put(out, id);
    page_put(out, "/cancel\"><button type=\"submit\">Cancel</button></form>\n</div>\n");
}

static enum ischia_code put_report(struct text_out *out, const struct store_assessment *row,
                                   struct ischia_error *err)
{
    struct ischia_request request;
    TRY(documents_request(&request, row, err));
    page_begin(out, "Ischia: report");
    page_put(out, "<article class=\"report\">\n");
    put_title(out, &request);
    if (row->state == QUEUE_SUCCEEDED) {
        TRY(put_result(out, row, &request, false, err));
    } else {
        if (queue_is_final(row->state))
            put_failure(out, row);
        else
            put_waiting(out, row);
        put_inputs(out, &request);
        put_end(out, row, false);
    }
    page_put(out, "</article>\n");
    page_end(out);
    return ISCHIA_OK;
}

enum ischia_code report_attachment(char **ret, const struct store_assessment *row,
                                   struct ischia_error *err)
{
    struct ischia_request request;
    struct text_out out;
    enum ischia_code code = ISCHIA_OK;
    TRY(documents_request(&request, row, err));
    text_out_init(&out);
    page_put(&out,
             "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Ischia: "
             "report</title></head>\n<body>\n");
    put_title(&out, &request);
    if (row->state == QUEUE_SUCCEEDED) {
        code = put_result(&out, row, &request, true, err);
    } else {
        put_failure(&out, row);
        put_inputs(&out, &request);
        put_end(&out, row, false);
    }
    page_put(&out, "</body></html>\n");
    if (code == ISCHIA_OK) return text_out_take(&out, ret, NULL, err);
    text_out_finish(&out);
    return code;
}

static void send_report(struct call *call, const struct store_assessment *row,
                        struct http_response *ret)
{
    struct text_out out;
    struct ischia_error err;
    text_out_init(&out);
    http_header_static(ret, "Cache-Control", "no-store");
    if (put_report(&out, row, &err) == ISCHIA_OK) {
        reply_text(call->request, ret, 200, "text/html; charset=utf-8", &out);
    } else {
        text_out_finish(&out);
        reply_failure(call->request, ret, &err);
    }
}

/* ----------------------------------------------------------------------------- route */

/* Sets call->deadline_ms to the end of "?wait=N". False: ret is the refusal. */
static bool read_wait(struct call *call, struct http_response *ret)
{
    char text[8];
    long long seconds = 0;
    const enum query_answer found = query_find(call->request->query, "wait", text, sizeof text);
    if (found == QUERY_BAD ||
        (found == QUERY_FOUND && !query_whole_number(text, 0, WAIT_MAX_S, &seconds))) {
        reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, "wait is 0 to %d seconds.",
                      WAIT_MAX_S);
        return false;
    }
    if (seconds > 0) call->deadline_ms = call->request->begun_ms + seconds * 1000;
    return true;
}

void handle_report(struct call *call, struct http_response *ret)
{
    struct store_assessment row;
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    if (call->request->woken == 0) {
        if (!read_wait(call, ret)) return;
        /* Before the look into the store: what happens in between is then not missed. */
        if (call->deadline_ms > 0) (void)call_subscribe(call);
    }
    memset(&row, 0, sizeof row);
    if (store_get(call->service->store, &call->id, &row, &answer, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
    } else if (answer != STORE_DONE) {
        reply_no_assessment(call, ret);
    } else {
        if (call_still_waits(call, queue_is_final(row.state)))
            call_wait(call, ret);
        else
            send_report(call, &row, ret);
        store_assessment_finish(&row);
    }
}
