/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/case_words.h"
#include "api/problem_doc.h"
#include "api/result_doc.h"
#include "api/risk.h"
#include "api/uncertainty_doc.h"
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

/* One report on its way out. */
struct report {
    struct text_out *out;
    enum language language;
    const struct store_assessment *row;
    const char *lang_query; /* "?lang=fr" when the address asked for it, else ""            */
    bool attached;          /* travels alone: refers to nothing of this service              */
};

static const char *say(const struct report *r, enum word word)
{
    return words_get(r->language, word);
}

/* ---------------------------------------------------------------------------- tables */

static void put_cell(const struct report *r, const char *markup, const char *text)
{
    page_put(r->out, markup);
    page_escape(r->out, text);
    page_put(r->out, "</td>");
}

static void put_text(const struct report *r, const char *text) { put_cell(r, "<td>", text); }

static void put_number(const struct report *r, const char *text)
{
    put_cell(r, "<td class=\"n\">", text);
}

static void put_fixed(const struct report *r, double number, int decimals)
{
    char value[WORDS_NUMBER_BYTES];
    put_number(r, words_fixed(value, r->language, number, decimals));
}

/* A cell with a sentence of numbers. */
static void put_filled(const struct report *r, const char *markup, enum word word,
                       const struct word_value *values)
{
    char text[160];
    put_cell(r, markup, words_fill(text, sizeof text, r->language, word, values));
}

static void begin_table(const struct report *r, enum word caption)
{
    page_put(r->out, "<table>\n<caption>");
    page_word(r->out, r->language, caption);
    page_put(r->out, "</caption>\n");
}

static void begin_row(const struct report *r, const char *name)
{
    page_put(r->out, "<tr><th scope=\"row\">");
    page_escape(r->out, name);
    page_put(r->out, "</th>");
}

static void end_row(const struct report *r) { page_put(r->out, "</tr>\n"); }

static void end_table(const struct report *r) { page_put(r->out, "</table>\n"); }

static void put_inputs(const struct report *r, const struct ischia_request *request)
{
    char value[WORDS_NUMBER_BYTES];
    begin_table(r, WORD_REPORT_INPUTS);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        begin_row(r, say(r, param_words[i].name));
        put_text(r, ischia_params[i].key);
        put_number(r, words_number(value, r->language, request->values.param[i], 6));
        put_text(r, ischia_params[i].unit);
        end_row(r);
    }
    end_table(r);
}

static void put_eps_max(const struct report *r, const struct ischia_result *result)
{
    char value[WORDS_NUMBER_BYTES], error[WORDS_NUMBER_BYTES], both[2 * WORDS_NUMBER_BYTES + 8];
    (void)words_fixed(value, r->language, result->strain.eps_max, 3);
    (void)words_fixed(error, r->language, result->numerics.eps_max_error, 3);
    (void)snprintf(both, sizeof both, "%s \u00b1 %s", value, error);
    begin_row(r, say(r, WORD_CURVE_COL_EPS));
    put_text(r, say(r, WORD_REPORT_ENGINEERING));
    put_number(r, both);
    put_filled(r, "<td>", WORD_DAEMON_REPORT_AXIS,
               WORDS(word_fixed("depth", result->strain.eps_max_depth_mm, 1)));
    end_row(r);
}

static void put_strains(const struct report *r, const struct ischia_result *result)
{
    const struct {
        enum word name;
        double value, threshold;
    } rows[] = {
        {WORD_CURVE_COL_SHEAR, result->strain.E_shear_max, ISCHIA_E_SHEAR_THRESHOLD},
        {WORD_CURVE_COL_COMP, result->strain.E_comp_max, ISCHIA_E_COMP_THRESHOLD},
    };
    begin_table(r, WORD_REPORT_STRAIN);
    put_eps_max(r, result);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin_row(r, say(r, rows[i].name));
        put_text(r, say(r, WORD_REPORT_GREEN_LAGRANGE));
        put_fixed(r, rows[i].value, 3);
        put_filled(r, "<td>", WORD_DAEMON_REPORT_LARGEST,
                   WORDS(word_fixed("threshold", rows[i].threshold, 2)));
        end_row(r);
    }
    end_table(r);
}

static void put_seat(const struct report *r, const struct ischia_seat *seat)
{
    const struct {
        double value;
        const char *unit;
        enum word name;
        int decimals;
    } rows[] = {
        {seat->displacement_mm, "mm", WORD_DAEMON_REPORT_TRAVEL, 1},
        {seat->contact_area_mm2, "mm\u00b2", WORD_DAEMON_REPORT_AREA, 0},
        {seat->mean_pressure_kPa, "kPa", WORD_DAEMON_REPORT_MEAN_PRESSURE, 1},
        {seat->peak_pressure_kPa, "kPa", WORD_DAEMON_REPORT_PEAK_PRESSURE, 1},
    };
    begin_table(r, WORD_VIEW_SEAT);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin_row(r, say(r, rows[i].name));
        put_fixed(r, rows[i].value, rows[i].decimals);
        put_text(r, rows[i].unit);
        end_row(r);
    }
    end_table(r);
}

static void put_largest(const struct report *r, const struct ischia_case *c,
                        const struct ischia_cluster_set *set)
{
    const double tip_mm =
        c->option[ISCHIA_SKIN_THICKNESS] + c->param[ISCHIA_EF] + c->param[ISCHIA_EM];
    const double depth_mm = tip_mm - set->largest.centroid_mm[2];
    if (set->has_largest)
        put_filled(r, "<td class=\"n long\">",
                   depth_mm < 0 ? WORD_REPORT_LARGEST_ABOVE : WORD_DAEMON_REPORT_WHERE,
                   WORDS(word_fixed("volume", set->largest.volume_mm3, 0),
                         word_fixed("depth", fabs(depth_mm), 1)));
    else
        put_number(r, say(r, WORD_DAEMON_REPORT_NONE));
}

static void put_first_force(const struct report *r, enum ischia_criterion k,
                            const struct ischia_result *result)
{
    char text[WORDS_NUMBER_BYTES], cell[WORDS_NUMBER_BYTES + 8];
    const double force_N = k == ISCHIA_OVER_SHEAR ? result->threshold_force_shear_N
                                                  : result->threshold_force_compression_N;
    if (k == ISCHIA_OVER_BOTH) {
        page_put(r->out, "<td></td>");
    } else if (isnan(force_N)) {
        put_number(r, say(r, WORD_NUMBERS_NEVER));
    } else {
        (void)snprintf(cell, sizeof cell, "%s N", words_fixed(text, r->language, force_N, 0));
        put_number(r, cell);
    }
}

static void put_column(const struct report *r, const char *class, const char *name)
{
    page_put(r->out, "<th scope=\"col\"");
    page_put(r->out, class);
    page_put(r->out, ">");
    page_escape(r->out, name);
    page_put(r->out, "</th>");
}

static void put_cluster_head(const struct report *r, double F_N)
{
    static const enum word columns[] = {WORD_REPORT_VOLUME, WORD_REPORT_SHARE, WORD_REPORT_COUNT,
                                        WORD_REPORT_LARGEST};
    char first[64];
    page_put(r->out, "<thead><tr>");
    put_column(r, "", say(r, WORD_REPORT_CRITERION));
    for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++)
        put_column(r, " class=\"n\"", say(r, columns[i]));
    put_column(r, " class=\"n\"",
               words_fill(first, sizeof first, r->language, WORD_DAEMON_REPORT_FIRST_AT,
                          WORDS(word_number("F", F_N, 6))));
    page_put(r->out, "</tr></thead>\n");
}

static void put_clusters(const struct report *r, const struct ischia_case *c,
                         const struct ischia_result *result)
{
    static const struct {
        enum word name;
        double threshold;
    } criteria[ISCHIA_CRITERION_COUNT] = {
        [ISCHIA_OVER_SHEAR] = {WORD_GLANCE_SHEAR, ISCHIA_E_SHEAR_THRESHOLD},
        [ISCHIA_OVER_COMPRESSION] = {WORD_GLANCE_COMPRESSION, ISCHIA_E_COMP_THRESHOLD},
        [ISCHIA_OVER_BOTH] = {WORD_GLANCE_BOTH, 0},
    };
    char name[64];
    const double muscle_mm3 = result->muscle_volume_mm3;
    begin_table(r, WORD_DAEMON_REPORT_CLUSTERS);
    put_cluster_head(r, c->param[ISCHIA_F]);
    for (int k = 0; k < ISCHIA_CRITERION_COUNT; k++) {
        const struct ischia_cluster_set *set = &result->clusters[k];
        begin_row(r, words_fill(name, sizeof name, r->language, criteria[k].name,
                                WORDS(word_fixed("threshold", criteria[k].threshold, 2))));
        put_fixed(r, set->volume_mm3, 0);
        put_filled(r, "<td class=\"n\">", WORD_DAEMON_REPORT_PERCENT,
                   WORDS(word_fixed("percent",
                                    muscle_mm3 > 0 ? 100 * set->volume_mm3 / muscle_mm3 : 0, 1)));
        put_fixed(r, set->count, 0);
        put_largest(r, c, set);
        put_first_force(r, (enum ischia_criterion)k, result);
        end_row(r);
    }
    end_table(r);
}

/* ---------------------------------------------------------------------- uncertainty */

static const char *not_reached_or(const struct report *r, double number, int decimals,
                                  char text[WORDS_NUMBER_BYTES])
{
    if (isnan(number)) return say(r, WORD_NUMBERS_NEVER);
    return words_fixed(text, r->language, number, decimals);
}

static void put_interval(const struct report *r, enum word name, const char *unit, int decimals,
                         const double quantile[UNCERTAINTY_QUANTILES])
{
    static const int shown[] = {2, 0, UNCERTAINTY_QUANTILES - 1}; /* median, 5 %, 95 % */
    char text[WORDS_NUMBER_BYTES];
    if (isnan(quantile[0])) return;
    begin_row(r, say(r, name));
    for (size_t i = 0; i < sizeof shown / sizeof shown[0]; i++)
        put_number(r, not_reached_or(r, quantile[shown[i]], decimals, text));
    put_text(r, unit);
    end_row(r);
}

static void put_interval_head(const struct report *r)
{
    static const char *const columns[] = {"50\u202f%", "5\u202f%", "95\u202f%", ""};
    page_put(r->out, "<thead><tr>");
    put_column(r, "", "");
    for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++)
        put_column(r, " class=\"n\"", columns[i]);
    page_put(r->out, "</tr></thead>\n");
}

static void put_intervals(const struct report *r, const struct ischia_uncertainty *u)
{
    static const struct {
        enum word name;
        const char *unit;
        int decimals;
        enum uncertain_quantity quantity;
    } rows[] = {
        {WORD_CURVE_COL_EPS, "", 3, UNCERTAIN_EPS_MAX},
        {WORD_NUMBERS_V_SHEAR, "mm\u00b3", 0, UNCERTAIN_VOLUME_SHEAR},
        {WORD_NUMBERS_V_COMP, "mm\u00b3", 0, UNCERTAIN_VOLUME_COMPRESSION},
        {WORD_NUMBERS_F_SHEAR, "N", 0, UNCERTAIN_FORCE_SHEAR},
    };
    char caption[160];
    page_put(r->out, "<table>\n<caption>");
    page_escape(r->out,
                words_fill(caption, sizeof caption, r->language, WORD_DAEMON_UNCERTAIN_REPORT,
                           WORDS(word_count("n", u->samples))));
    page_put(r->out, "</caption>\n");
    put_interval_head(r);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        put_interval(r, rows[i].name, rows[i].unit, rows[i].decimals,
                     u->quantile[rows[i].quantity]);
    end_table(r);
}

static void put_percent(const struct report *r, double share, char ret[WORDS_NUMBER_BYTES + 8])
{
    char number[WORDS_NUMBER_BYTES];
    (void)snprintf(ret, WORDS_NUMBER_BYTES + 8, "%s\u202f%%",
                   words_fixed(number, r->language, 100 * share, 0));
}

/* Inputs by name, and with a percentage each: a share of the spread, or of the samples outside. */
static const char *list_inputs(const struct report *r, const double *share, double least,
                               bool with_share, char *text, size_t size)
{
    size_t used = 0;
    text[0] = '\0';
    for (int i = 0; i < ISCHIA_PARAM_COUNT && used < size; i++) {
        char percent[WORDS_NUMBER_BYTES + 8];
        if (!(share[i] >= least)) continue;
        put_percent(r, share[i], percent);
        used += (size_t)snprintf(text + used, size - used, "%s%s%s%s", used > 0 ? ", " : "",
                                 ischia_params[i].key, with_share ? " " : "",
                                 with_share ? percent : "");
    }
    return text;
}

static void put_shares(const struct report *r, const struct ischia_uncertainty *u)
{
    char shear[WORDS_NUMBER_BYTES + 8], compression[WORDS_NUMBER_BYTES + 8];
    if (isnan(u->share_shear) || isnan(u->share_compression)) return;
    put_percent(r, u->share_shear, shear);
    put_percent(r, u->share_compression, compression);
    page_fill(r->out, r->language, WORD_UNCERTAIN_SHARE,
              WORDS(word_text("shear", shear), word_text("compression", compression)));
    page_put(r->out, " ");
}

static void put_certainty(const struct report *r, const struct ischia_uncertainty *u)
{
    char list[160];
    page_put(r->out, "<p>");
    put_shares(r, u);
    page_fill(r->out, r->language, WORD_UNCERTAIN_MODEL_FORM,
              WORDS(word_number("error", ISCHIA_MODEL_FORM_EPS_MAX, 6)));
    if (list_inputs(r, u->total, 0.05, true, list, sizeof list)[0] != '\0') {
        page_put(r->out, " ");
        page_fill(r->out, r->language, WORD_DAEMON_UNCERTAIN_BETTER,
                  WORDS(word_text("list", list)));
    }
    page_put(r->out, "</p>\n");
}

static void put_no_interval(const struct report *r, const struct ischia_uncertainty *u)
{
    static const enum word why[UNCERTAINTY_STATUS_COUNT] = {
        [UNCERTAINTY_NO_EMULATOR] = WORD_UNCERTAIN_NONE_NO_EMULATOR,
        [UNCERTAINTY_OTHER_MODEL] = WORD_UNCERTAIN_NONE_OTHER_MODEL,
        [UNCERTAINTY_OUTSIDE] = WORD_UNCERTAIN_NONE_OUTSIDE_TRAINING,
    };
    /* Without a sample the measurement itself is outside. */
    const bool itself = u->status == UNCERTAINTY_OUTSIDE && u->samples == 0;
    char list[160];
    page_put(r->out, "<p>");
    page_word(r->out, r->language, WORD_DAEMON_UNCERTAIN_NONE);
    page_put(r->out, ": ");
    page_fill(
        r->out, r->language, itself ? WORD_UNCERTAIN_NONE_OUTSIDE_ITSELF : why[u->status],
        WORDS(word_text("keys", list_inputs(r, u->outside, 1e-9, !itself, list, sizeof list))));
    page_put(r->out, "</p>\n");
}

static void put_any(const struct report *r, const struct ischia_uncertainty *u)
{
    page_put(r->out, "<div class=\"uncertain\">\n");
    if (u->trial) {
        page_put(r->out, "<p>");
        page_word(r->out, r->language, WORD_UNCERTAIN_TRIAL);
        page_put(r->out, "</p>\n");
    }
    if (u->status == UNCERTAINTY_GIVEN) {
        put_intervals(r, u);
        put_certainty(r, u);
    } else {
        put_no_interval(r, u);
    }
    page_put(r->out, "</div>\n");
}

/* Nothing for a result whose inputs were taken as exact. */
static enum ischia_code put_uncertainty(const struct report *r, struct ischia_error *err)
{
    struct ischia_uncertainty u;
    bool present = false;
    TRY(uncertainty_doc_read(&u, &present, r->row->result_json, strlen(r->row->result_json), err));
    if (present) put_any(r, &u);
    return ISCHIA_OK;
}

/* ----------------------------------------------------------------------------- words */

static void put_headline(const struct report *r, const char *class, enum word word)
{
    page_put(r->out, "<p class=\"headline ");
    page_escape(r->out, class);
    page_put(r->out, "\">");
    page_word(r->out, r->language, word);
    page_put(r->out, "</p>\n");
}

static void put_item(const struct report *r, const char *class, const char *text)
{
    page_put(r->out, "<li class=\"");
    page_escape(r->out, class);
    page_put(r->out, "\">");
    page_escape(r->out, text);
    page_put(r->out, "</li>\n");
}

static void put_title(const struct report *r, const struct ischia_request *request)
{
    static const enum word sides[ISCHIA_SIDE_COUNT] = {
        [ISCHIA_SIDE_LEFT] = WORD_DAEMON_REPORT_LEFT,
        [ISCHIA_SIDE_RIGHT] = WORD_DAEMON_REPORT_RIGHT,
    };
    page_put(r->out, "<header>\n<h1>");
    page_word(r->out, r->language, WORD_REPORT_TITLE);
    if (request->side != ISCHIA_SIDE_NONE)
        page_format(r->out, " \u00b7 %s", say(r, sides[request->side]));
    page_put(r->out, "</h1>\n<p>");
    if (request->subject[0] != '\0')
        page_fill(r->out, r->language, WORD_RESULT_SUBJECT,
                  WORDS(word_text("subject", request->subject)));
    if (request->label[0] != '\0') page_format(r->out, " \u00b7 %s", request->label);
    if (request->measured_at[0] != '\0') {
        page_put(r->out, " \u00b7 ");
        page_fill(r->out, r->language, WORD_RESULT_MEASURED,
                  WORDS(word_text("time", request->measured_at)));
    }
    page_put(r->out, "</p>\n</header>\n");
}

static void put_words(const struct report *r, const struct ischia_case *c,
                      const struct ischia_result *result)
{
    struct risk risk;
    risk_assess(&risk, c, result, r->language);
    put_headline(r, risk_bands[risk.band].name, risk_bands[risk.band].headline);
    page_put(r->out, "<ul>\n");
    for (int i = 0; i < risk.reason_count; i++) put_item(r, "reason", risk.reason[i]);
    page_put(r->out, "</ul>\n");
}

static void put_notes(const struct report *r, const struct ischia_case *c)
{
    struct ischia_fault warnings[ISCHIA_PARAM_COUNT];
    const size_t count = case_warnings(c, r->language, warnings);
    page_put(r->out, "<section>\n<h2>");
    page_word(r->out, r->language, WORD_CAVEAT_TITLE);
    page_put(r->out, "</h2>\n<ul>\n");
    for (size_t i = 0; i < count; i++) put_item(r, "warning", warnings[i].detail);
    for (int i = 0; i < RISK_CAVEAT_COUNT; i++) put_item(r, "caveat", say(r, risk_caveats[i]));
    put_item(r, "caveat", say(r, WORD_CAVEAT_MEASURES));
    page_put(r->out, "</ul>\n</section>\n");
}

/* "skin.thickness 2 mm, model.friction 0": every option that has another value than the default. */
static const char *list_options(const struct report *r, const struct ischia_case *c, char *text,
                                size_t size)
{
    size_t used = 0;
    text[0] = '\0';
    for (int i = 0; i < ISCHIA_OPTION_COUNT && used < size; i++) {
        const struct ischia_option_info *info = &ischia_options[i];
        char number[WORDS_NUMBER_BYTES], unit[16];
        if (c->option[i] == info->default_value) continue;
        used += (size_t)snprintf(
            text + used, size - used, "%s%s.%s %s%s", used > 0 ? ", " : "", info->group, info->key,
            words_number(number, r->language, c->option[i], 6), case_spaced_unit(info->unit, unit));
    }
    return text;
}

/* The mesh, always; the options where they are not the default. */
static void put_settings(const struct report *r, const struct ischia_case *c)
{
    static const enum word resolutions[ISCHIA_RESOLUTION_COUNT] = {
        [ISCHIA_STANDARD] = WORD_FORM_RESOLUTION_STANDARD,
        [ISCHIA_FINE] = WORD_FORM_RESOLUTION_FINE,
        [ISCHIA_COARSE] = WORD_FORM_RESOLUTION_COARSE,
    };
    char list[320];
    page_format(r->out, " \u00b7 %s: %s", say(r, WORD_FORM_RESOLUTION),
                say(r, resolutions[c->resolution]));
    if (list_options(r, c, list, sizeof list)[0] == '\0') return;
    page_put(r->out, " \u00b7 ");
    page_fill(r->out, r->language, WORD_RESULT_OPTIONS, WORDS(word_text("list", list)));
}

/* What made it and how, which assessment it is, when, and room for a name. */
static void put_end(const struct report *r, const struct ischia_case *c, bool with_signature)
{
    char id[UUID_TEXT_BYTES], created[DOCUMENTS_TIME_BYTES], finished[DOCUMENTS_TIME_BYTES];
    uuid_format(&r->row->id, id);
    documents_time(r->row->created_ms, created);
    documents_time(r->row->finished_ms, finished);
    page_put(r->out, "<footer>\n<p>");
    page_fill(r->out, r->language, WORD_DAEMON_REPORT_MADE,
              WORDS(word_text("version", ISCHIA_VERSION), word_text("model", ISCHIA_MODEL_NAME),
                    word_count("model_version", ISCHIA_MODEL_VERSION), word_text("id", id),
                    word_text("time", created)));
    if (finished[0] != '\0') {
        page_put(r->out, " \u00b7 ");
        page_fill(r->out, r->language, WORD_REPORT_ENDED, WORDS(word_text("time", finished)));
    }
    put_settings(r, c);
    page_put(r->out, "</p>\n");
    if (with_signature) {
        page_put(r->out, "<p class=\"signature\">");
        page_word(r->out, r->language, WORD_REPORT_SIGNATURE);
        page_put(r->out, "</p>\n");
    }
    page_put(r->out, "</footer>\n");
}

/* ---------------------------------------------------------------------------- states */

/* The address of a part of this assessment, for an attribute. */
static void put_address(const struct report *r, const char *part)
{
    char id[UUID_TEXT_BYTES];
    uuid_format(&r->row->id, id);
    page_format(r->out, "/v1/assessments/%s%s", id, part);
}

static void put_figure(const struct report *r)
{
    page_put(r->out, "<figure><figcaption>");
    page_word(r->out, r->language, WORD_REPORT_SECTION);
    page_put(r->out, "</figcaption><img alt=\"");
    page_word(r->out, r->language, WORD_DAEMON_REPORT_ALT);
    page_put(r->out, "\" src=\"");
    put_address(r, "/section.svg?lang=");
    page_put(r->out, language_tags[r->language]);
    page_put(r->out, "\"></figure>\n");
}

static enum ischia_code put_result(const struct report *r, const struct ischia_request *request,
                                   struct ischia_error *err)
{
    struct ischia_result result;
    TRY(result_doc_read(&result, NULL, r->row->result_json, strlen(r->row->result_json),
                        &json_limits_stored, err));
    put_words(r, &request->values, &result);
    page_put(r->out, "<div class=\"columns\">\n<div>\n");
    put_inputs(r, request);
    page_put(r->out, "</div>\n<div>\n");
    put_strains(r, &result);
    put_seat(r, &result.seat);
    page_put(r->out, "</div>\n</div>\n");
    put_clusters(r, &request->values, &result);
    TRY(put_uncertainty(r, err));
    if (!r->attached) put_figure(r);
    put_notes(r, &request->values);
    put_end(r, &request->values, true);
    return ISCHIA_OK;
}

/* Why there is no result. Records are kept in English; here its kind and its numbers speak. */
static void put_reason(const struct report *r, const struct problem *problem, double F_N)
{
    const bool on_path =
        problem->kind == PROBLEM_NOT_CONVERGED && !isnan(problem->last_converged_fraction);
    if (r->language == LANGUAGE_EN)
        page_escape(r->out, problem->detail);
    else if (on_path && problem->last_converged_fraction < 1)
        page_fill(r->out, r->language, WORD_RESULT_FAILED_PATH,
                  WORDS(word_number("at", problem->last_converged_fraction * F_N, 4),
                        word_number("F", F_N, 4)));
    else if (on_path)
        page_word(r->out, r->language, WORD_RESULT_FAILED_CHECKS);
    else
        page_word(r->out, r->language, problem_kinds[problem->kind].title);
}

static void put_failure(const struct report *r, const struct ischia_request *request)
{
    const struct store_assessment *row = r->row;
    struct problem problem;
    put_headline(r, queue_state_names[row->state], WORD_DAEMON_REPORT_NO_RESULT);
    page_put(r->out, "<p>");
    if (row->problem_json != NULL &&
        problem_doc_read(&problem, row->problem_json, strlen(row->problem_json), NULL) == ISCHIA_OK)
        put_reason(r, &problem, request->values.param[ISCHIA_F]);
    else
        page_fill(r->out, r->language, WORD_DAEMON_REPORT_ENDED_AS,
                  WORDS(word_text("status", reply_state(r->language, row->state))));
    page_put(r->out, "</p>\n");
}

static void put_waiting(const struct report *r)
{
    put_headline(r, queue_state_names[r->row->state],
                 r->row->state == QUEUE_RUNNING ? WORD_DAEMON_REPORT_RUNNING
                                                : WORD_DAEMON_REPORT_QUEUED);
    page_put(r->out, "<div class=\"actions\">\n<form method=\"get\" action=\"");
    put_address(r, "/report");
    page_put(r->out, "\">");
    if (r->lang_query[0] != '\0') { /* a form's own fields replace the query of its address */
        page_put(r->out, "<input type=\"hidden\" name=\"lang\" value=\"");
        page_put(r->out, language_tags[r->language]);
        page_put(r->out, "\">");
    }
    page_put(r->out, "<button type=\"submit\" name=\"wait\" value=\"60\">");
    page_word(r->out, r->language, WORD_DAEMON_REPORT_WAIT);
    page_put(r->out, "</button></form>\n<form method=\"post\" action=\"");
    put_address(r, "/cancel");
    page_put(r->out, r->lang_query);
    page_put(r->out, "\"><button type=\"submit\">");
    page_word(r->out, r->language, WORD_RESULT_CANCEL);
    page_put(r->out, "</button></form>\n</div>\n");
}

/* What stands between the beginning and the end of the document. */
static enum ischia_code put_body(const struct report *r, struct ischia_error *err)
{
    struct ischia_request request;
    TRY(documents_request(&request, r->row, err));
    put_title(r, &request);
    if (r->row->state == QUEUE_SUCCEEDED) return put_result(r, &request, err);
    if (queue_is_final(r->row->state))
        put_failure(r, &request);
    else
        put_waiting(r);
    put_inputs(r, &request);
    put_end(r, &request.values, false);
    return ISCHIA_OK;
}

enum ischia_code report_attachment(char **ret, const struct store_assessment *row,
                                   struct ischia_error *err)
{
    struct text_out out;
    const struct report r = {&out, LANGUAGE_EN, row, "", true};
    text_out_init(&out);
    page_put(&out, "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>");
    page_word(&out, LANGUAGE_EN, WORD_DAEMON_REPORT_PAGE);
    page_put(&out, "</title></head>\n<body>\n");
    const enum ischia_code code = put_body(&r, err);
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
    char address[UUID_TEXT_BYTES + 32];
    const enum language language = reply_language(call->request);
    const struct report r = {&out, language, row, call->lang_query, false};
    (void)snprintf(address, sizeof address, "/v1/assessments/%s/report", call->id_text);
    page_begin(&out, language, words_get(language, WORD_DAEMON_REPORT_PAGE));
    page_languages(&out, language, address);
    page_put(&out, "<main>\n<article class=\"report\">\n");
    http_header_static(ret, "Cache-Control", "no-store");
    if (put_body(&r, &err) == ISCHIA_OK) {
        page_put(&out, "</article>\n");
        page_end(&out);
        reply_put_language(call->request, ret);
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
        reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_QUERY_WAIT,
                      WORDS(word_count("max", WAIT_MAX_S)));
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
