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
#include "server/http/reply.h"
#include "server/http/report.h"
#include "server/http/routes.h"

/*
 * GET …/report: one side on one A4 page, for printing and for pages without JavaScript. While the
 * assessment is not finished it says so and asks for itself again.
 */

enum { REFRESH_S = 2 };

static void put_row(struct text_out *out, const char *name, const char *value)
{
    page_put(out, "<tr><th scope=\"row\">");
    page_escape(out, name);
    page_put(out, "</th><td>");
    page_escape(out, value);
    page_put(out, "</td></tr>\n");
}

__attribute__((format(printf, 3, 4))) static void
put_row_format(struct text_out *out, const char *name, const char *format, ...)
{
    char value[256];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(value, sizeof value, format, arguments);
    va_end(arguments);
    put_row(out, name, value);
}

static void put_optional(struct text_out *out, const char *name, const char *value)
{
    if (value[0] != '\0') put_row(out, name, value);
}

static void put_identity(struct text_out *out, const struct store_assessment *row,
                         const struct ischia_request *request)
{
    char id[UUID_TEXT_BYTES], finished[DOCUMENTS_TIME_BYTES];
    uuid_format(&row->id, id);
    documents_time(row->finished_ms, finished);
    page_put(out, "<table class=\"identity\">\n<caption>Who, which side, when</caption>\n");
    put_optional(out, "Subject", request->subject);
    put_row(out, "Side",
            request->side == ISCHIA_SIDE_NONE ? "not given" : ischia_side_names[request->side]);
    put_optional(out, "Measured", request->measured_at);
    put_optional(out, "Label", request->label);
    put_optional(out, "Solved", finished);
    put_row(out, "Assessment", id);
    page_put(out, "</table>\n");
}

static void put_inputs(struct text_out *out, const struct ischia_request *request)
{
    page_put(out, "<table class=\"inputs\">\n<caption>Measured</caption>\n");
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        put_row_format(out, ischia_params[i].key, "%g %s", request->values.param[i],
                       ischia_params[i].unit);
    page_put(out, "</table>\n");
}

static void put_force(struct text_out *out, const char *name, double force_N)
{
    if (isnan(force_N))
        put_row(out, name, "not reached");
    else
        put_row_format(out, name, "%.0f N", force_N);
}

static void put_strains(struct text_out *out, const struct ischia_result *r)
{
    page_put(out, "<table>\n<caption>Strain in the muscle</caption>\n");
    put_row_format(out, "eps_max: engineering shear strain on the axis", "%.3f \u00b1 %.3f",
                   r->strain.eps_max, r->numerics.eps_max_error);
    put_row_format(out, "its depth below the bone, unloaded", "%.1f mm",
                   r->strain.eps_max_depth_mm);
    put_row_format(out, "E_shear: largest Green\u2013Lagrange shear strain",
                   "%.3f (threshold %.2f)", r->strain.E_shear_max, ISCHIA_E_SHEAR_THRESHOLD);
    put_row_format(out, "E_comp: largest Green\u2013Lagrange compression", "%.3f (threshold %.2f)",
                   r->strain.E_comp_max, ISCHIA_E_COMP_THRESHOLD);
    page_put(out, "</table>\n");
}

static void put_clusters(struct text_out *out, const struct ischia_result *r)
{
    static const char *const names[ISCHIA_CRITERION_COUNT] = {
        [ISCHIA_OVER_SHEAR] = "over the shear threshold",
        [ISCHIA_OVER_COMPRESSION] = "over the compression threshold",
        [ISCHIA_OVER_BOTH] = "over both",
    };
    page_put(out, "<table>\n<caption>Muscle over the thresholds (unloaded volume, whole side)"
                  "</caption>\n");
    for (int k = 0; k < ISCHIA_CRITERION_COUNT; k++) {
        const double share =
            r->muscle_volume_mm3 > 0 ? 100 * r->clusters[k].volume_mm3 / r->muscle_volume_mm3 : 0;
        put_row_format(out, names[k], "%.0f mm\u00b3 (%.1f %% of the muscle), %d bodies",
                       r->clusters[k].volume_mm3, share, r->clusters[k].count);
    }
    put_force(out, "shear threshold first crossed at", r->threshold_force_shear_N);
    put_force(out, "compression threshold first crossed at", r->threshold_force_compression_N);
    page_put(out, "</table>\n");
}

static void put_seat(struct text_out *out, const struct ischia_result *r)
{
    page_put(out, "<table>\n<caption>Seat</caption>\n");
    put_row_format(out, "travel", "%.1f mm", r->seat.displacement_mm);
    put_row_format(out, "contact area", "%.0f mm\u00b2", r->seat.contact_area_mm2);
    put_row_format(out, "mean pressure", "%.1f kPa", r->seat.mean_pressure_kPa);
    put_row_format(out, "peak pressure", "%.1f kPa", r->seat.peak_pressure_kPa);
    page_put(out, "</table>\n");
}

static void put_words(struct text_out *out, const struct ischia_case *c,
                      const struct ischia_result *r)
{
    struct risk risk;
    risk_assess(&risk, c, r);
    page_put(out, "<p class=\"headline band-");
    page_escape(out, risk_bands[risk.band].name);
    page_put(out, "\">");
    page_escape(out, risk_bands[risk.band].headline);
    page_put(out, "</p>\n<ul>\n");
    for (int i = 0; i < risk.reason_count; i++) {
        page_put(out, "<li>");
        page_escape(out, risk.reason[i]);
        page_put(out, "</li>\n");
    }
    page_put(out, "</ul>\n");
}

static void put_notes(struct text_out *out, const struct ischia_case *c)
{
    struct ischia_fault warnings[ISCHIA_PARAM_COUNT];
    const size_t count = ischia_case_warnings(c, warnings);
    page_put(out, "<h2>What this does not say</h2>\n<ul>\n");
    for (size_t i = 0; i < count; i++) {
        page_put(out, "<li class=\"warning\">");
        page_escape(out, warnings[i].detail);
        page_put(out, "</li>\n");
    }
    for (int i = 0; i < RISK_CAVEAT_COUNT; i++) {
        page_put(out, "<li>");
        page_escape(out, risk_caveats[i]);
        page_put(out, "</li>\n");
    }
    page_put(out, "</ul>\n<p class=\"signature\">Date, signature:</p>\n<footer>");
    page_format(out, "Ischia %s, model %s version %d", ISCHIA_VERSION, ISCHIA_MODEL_NAME,
                ISCHIA_MODEL_VERSION);
    page_put(out, "</footer>\n");
}

static void put_figure(struct text_out *out, const struct store_assessment *row)
{
    char id[UUID_TEXT_BYTES];
    uuid_format(&row->id, id);
    page_put(out, "<figure><img alt=\"Section through the loaded tissue, coloured by "
                  "shear strain, with the threshold's contour\" src=\"/v1/assessments/");
    page_put(out, id);
    page_put(out,
             "/section.svg\"><figcaption>Symmetry section under load, Green\u2013Lagrange shear "
             "strain.</figcaption></figure>\n");
}

static enum ischia_code put_result(struct text_out *out, const struct store_assessment *row,
                                   const struct ischia_request *request, bool attached,
                                   struct ischia_error *err)
{
    struct ischia_result r;
    TRY(result_doc_read(&r, NULL, row->result_json, strlen(row->result_json), &json_limits_stored,
                        err));
    put_words(out, &request->values, &r);
    page_put(out, "<div class=\"columns\">\n<div>\n");
    put_identity(out, row, request);
    put_inputs(out, request);
    put_seat(out, &r);
    page_put(out, "</div>\n<div>\n");
    put_strains(out, &r);
    put_clusters(out, &r);
    page_put(out, "</div>\n</div>\n");
    if (!attached) put_figure(out, row);
    put_notes(out, &request->values);
    return ISCHIA_OK;
}

static void put_failure(struct text_out *out, const struct store_assessment *row)
{
    struct problem problem;
    page_put(out, "<p class=\"headline\">There is no result.</p>\n<p>");
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
    page_put(out, "<p class=\"headline\">");
    page_put(out, row->state == QUEUE_RUNNING ? "Being solved." : "Waiting for a solver.");
    page_put(out, "</p>\n<p>This page asks again every two seconds.</p>\n"
                  "<form method=\"post\" action=\"/v1/assessments/");
    page_put(out, id);
    page_put(out, "/cancel\"><button type=\"submit\">Cancel</button></form>\n");
}

static enum ischia_code put_report(struct text_out *out, const struct store_assessment *row,
                                   struct ischia_error *err)
{
    struct ischia_request request;
    TRY(documents_request(&request, row, err));
    page_begin(out, "Ischia: report", queue_is_final(row->state) ? 0 : REFRESH_S);
    page_put(out, "<h1>Tissue under one ischium</h1>\n");
    if (row->state == QUEUE_SUCCEEDED) {
        TRY(put_result(out, row, &request, false, err));
    } else {
        if (queue_is_final(row->state))
            put_failure(out, row);
        else
            put_waiting(out, row);
        put_identity(out, row, &request);
        put_inputs(out, &request);
    }
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
             "report</title></head>\n<body>\n<h1>Tissue under one ischium</h1>\n");
    if (row->state == QUEUE_SUCCEEDED) {
        code = put_result(&out, row, &request, true, err);
    } else {
        put_failure(&out, row);
        put_identity(&out, row, &request);
        put_inputs(&out, &request);
    }
    page_put(&out, "</body></html>\n");
    if (code == ISCHIA_OK) return text_out_take(&out, ret, NULL, err);
    text_out_finish(&out);
    return code;
}

void handle_report(struct call *call, struct http_response *ret)
{
    struct store_assessment row;
    struct text_out out;
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    memset(&row, 0, sizeof row);
    text_out_init(&out);
    enum ischia_code code = store_get(call->service->store, &call->id, &row, &answer, &err);
    if (code == ISCHIA_OK && answer != STORE_DONE) {
        reply_no_assessment(call, ret);
        return;
    }
    if (code == ISCHIA_OK) {
        code = put_report(&out, &row, &err);
        store_assessment_finish(&row);
    }
    http_header_static(ret, "Cache-Control", "no-store");
    if (code == ISCHIA_OK) {
        reply_text(call->request, ret, 200, "text/html; charset=utf-8", &out);
    } else {
        text_out_finish(&out);
        reply_failure(call->request, ret, &err);
    }
}
