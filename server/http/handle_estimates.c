/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/case_words.h"
#include "api/json.h"
#include "api/problem_doc.h"
#include "server/http/reply.h"
#include "server/http/routes.h"

/*
 * An estimate of one side by the trained emulator, in the request: no queue, no worker, nothing
 * stored. Where the emulator knows nothing (outside its training, other options) it says so and
 * gives no numbers.
 */

static const double no_limit = 1e300;

/* The members of the document, in their order: "group" or "group.part", key, response. */
static const struct shown {
    const char *group, *part, *key, *response;
    double ceiling; /* no value is above it */
    bool crossing;  /* a force at which a threshold is crossed: null beyond the case's own force */
} shown[] = {
    {"strain", NULL, "eps_max", "eps_max", no_limit, false},
    {"strain", NULL, "E_shear_max", "E_shear_max", no_limit, false},
    {"strain", NULL, "E_comp_max", "E_comp_max", 0.5, false},
    {"clusters", "shear", "volume_mm3", "volume_shear_mm3", no_limit, false},
    {"clusters", "compression", "volume_mm3", "volume_compression_mm3", no_limit, false},
    {"clusters", "both", "volume_mm3", "volume_both_mm3", no_limit, false},
    {"seat", NULL, "displacement_mm", "seat_displacement_mm", no_limit, false},
    {"threshold_force_N", NULL, "shear", "force_shear_N", no_limit, true},
    {"threshold_force_N", NULL, "compression", "force_compression_N", no_limit, true},
};
enum { SHOWN_COUNT = sizeof shown / sizeof shown[0] };

/* -------------------------------------------------------------------------------- values */

static double at_most(double value, double ceiling) { return value < ceiling ? value : ceiling; }

static void write_value(struct json_out *out, const struct shown *s, const struct predictor *p,
                        const struct predictor_point *point, double F_N)
{
    const struct predictor_output *output = predictor_output_named(p, s->response);
    struct predictor_estimate e = {0};
    if (output != NULL) e = predictor_estimate_of(p, output, point);
    if (output == NULL || (s->crossing && e.value > F_N)) {
        json_put_null(out, s->key);
        return;
    }
    json_open_object(out, s->key);
    json_put_number(out, "value", at_most(e.value, s->ceiling));
    json_put_number(out, "low", at_most(e.low, s->ceiling));
    json_put_number(out, "high", at_most(e.high, s->ceiling));
    json_close_object(out);
}

/* point: NULL when there is nothing to say; every group is then null. */
static void write_values(struct json_out *out, const struct predictor *p,
                         const struct predictor_point *point, double F_N)
{
    for (int i = 0; i < SHOWN_COUNT; i++) {
        const bool begins = i == 0 || strcmp(shown[i - 1].group, shown[i].group) != 0;
        const bool ends = i + 1 == SHOWN_COUNT || strcmp(shown[i + 1].group, shown[i].group) != 0;
        if (point == NULL) {
            if (begins) json_put_null(out, shown[i].group);
            continue;
        }
        if (begins) json_open_object(out, shown[i].group);
        if (shown[i].part != NULL) json_open_object(out, shown[i].part);
        write_value(out, &shown[i], p, point, F_N);
        if (shown[i].part != NULL) json_close_object(out);
        if (ends) json_close_object(out);
    }
}

/* ------------------------------------------------------------------------------ warnings */

static void write_warning(struct json_out *out, const char *code, const char *pointer,
                          const char *detail)
{
    json_open_object(out, NULL);
    json_put_string(out, "code", code);
    json_put_string(out, "pointer", pointer);
    json_put_string(out, "detail", detail);
    json_close_object(out);
}

static void warn_of_input(struct json_out *out, const struct predictor *p,
                          const struct ischia_case *c, enum ischia_param i)
{
    const struct ischia_param_info *info = &ischia_params[i];
    char pointer[16], detail[160];
    if (predictor_covers(p, c, i)) return;
    (void)snprintf(pointer, sizeof pointer, "/%s", info->key);
    (void)snprintf(detail, sizeof detail,
                   "%s is %.6g %s; the emulator was trained for %.6g to %.6g %s: no estimate",
                   info->key, c->param[i], info->unit, p->input[i].min, p->input[i].max,
                   info->unit);
    write_warning(out, "outside_training", pointer, detail);
}

static void write_warnings(struct json_out *out, const struct predictor *p,
                           const struct ischia_case *c, enum language language)
{
    struct ischia_fault outside[ISCHIA_PARAM_COUNT];
    const size_t count = case_warnings(c, language, outside);
    json_open_array(out, "warnings");
    for (size_t i = 0; i < count; i++)
        write_warning(out, outside[i].code, outside[i].pointer, outside[i].detail);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) warn_of_input(out, p, c, (enum ischia_param)i);
    if (!predictor_same_options(p, c))
        write_warning(out, "other_model", "/model",
                      "the emulator was trained with other options of model or skin: no estimate");
    if (p->trial)
        write_warning(out, "trial_emulator", "",
                      "this emulator was made for trying out: do not rely on its numbers");
    json_close_array(out);
}

/* ------------------------------------------------------------------------------ the whole */

static void write_emulator(struct json_out *out, const struct estimator *estimator)
{
    const struct predictor *p = &estimator->predictor;
    json_open_object(out, "emulator");
    json_put_integer(out, "rows", p->rows);
    json_put_string(out, "resolution", ischia_resolution_names[p->resolution]);
    json_put_bool(out, "trial", p->trial);
    json_put_string(out, "sha256", estimator->digest);
    json_close_object(out);
}

static void send_estimate(struct call *call, const struct ischia_case *c, struct http_response *ret)
{
    const struct estimator *estimator = call->service->estimator;
    const struct predictor *p = &estimator->predictor;
    const bool known = predictor_knows(p, c);
    struct predictor_point point;
    struct json_out out;
    struct ischia_error err;
    char *text = NULL;
    size_t size = 0;
    if (known) point = predictor_point_of(p, c);
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    json_put_string(&out, "kind", "estimate");
    json_open_object(&out, "parameters");
    case_doc_write_parameters(&out, c);
    json_close_object(&out);
    write_values(&out, p, known ? &point : NULL, c->param[ISCHIA_F]);
    write_emulator(&out, estimator);
    write_warnings(&out, p, c, reply_language(call->request));
    json_close_object(&out);
    http_header_static(ret, "Cache-Control", "no-store");
    if (json_out_take(&out, &text, &size, &err) == ISCHIA_OK)
        http_body(ret, "application/json", text, size);
    else
        reply_failure(call->request, ret, &err);
}

void handle_estimate(struct call *call, struct http_response *ret)
{
    struct ischia_request request;
    struct doc_faults faults;
    struct problem problem;
    struct ischia_error err;
    const struct http_request *http = call->request;
    if (call->service->estimator == NULL) {
        reply_refusal_english(
            http, ret, PROBLEM_NOT_FOUND,
            "No trained emulator is in use here (option emulator), so there are no "
            "estimates; an assessment is always solved.");
        return;
    }
    doc_faults_init(&faults);
    faults.language = reply_language(http);
    const enum ischia_code code =
        case_doc_read(&request, http->body, http->body_size, &json_limits_request, &faults, &err);
    if (code == ISCHIA_OK && faults.count == 0) {
        send_estimate(call, &request.values, ret);
        return;
    }
    if (code != ISCHIA_OK)
        problem_from_error(&problem, &err);
    else
        problem_from_faults(&problem, &faults);
    reply_problem(http, &problem, ret);
}
