/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/json.h"
#include "api/problem_doc.h"
#include "server/http/estimate_doc.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/routes.h"

/*
 * Estimates of one side by the trained emulator, in the request: no queue, no worker, nothing
 * stored. And what they would be were one of its numbers another: which force a cushion aims at.
 * Where the emulator knows nothing (outside its training, other options) it says so and gives no
 * numbers.
 */

/* ------------------------------------------------------------------------------ an estimate */

static void send_document(struct call *call, struct json_out *out, struct http_response *ret)
{
    struct ischia_error err;
    char *text = NULL;
    size_t size = 0;
    http_header_static(ret, "Cache-Control", "no-store");
    if (json_out_take(out, &text, &size, &err) == ISCHIA_OK)
        http_body(ret, "application/json", text, size);
    else
        reply_failure(call->request, ret, &err);
}

static void begin_document(struct json_out *out, const char *kind, const struct ischia_case *c)
{
    json_out_init(out, 0);
    json_open_object(out, NULL);
    json_put_string(out, "kind", kind);
    json_open_object(out, "parameters");
    case_doc_write_parameters(out, c);
    json_close_object(out);
}

static void send_estimate(struct call *call, const struct ischia_case *c, struct http_response *ret)
{
    const struct estimator *estimator = call->service->estimator;
    const struct predictor *p = &estimator->predictor;
    const bool known = predictor_knows(p, c);
    struct json_out out;
    begin_document(&out, "estimate", c);
    estimate_put_values(&out, p, known ? c : NULL);
    estimate_put_emulator(&out, estimator);
    estimate_put_warnings(&out, p, c, reply_language(call->request));
    json_close_object(&out);
    send_document(call, &out, ret);
}

/* Who asks gets an estimate, or is told what is wrong. */
typedef void answerer(struct call *call, const struct ischia_case *c, struct http_response *ret);

static void answer(struct call *call, struct http_response *ret, answerer *give)
{
    struct ischia_request request;
    struct doc_faults faults;
    struct problem problem;
    struct ischia_error err;
    const struct http_request *http = call->request;
    if (call->service->estimator == NULL) {
        reply_refusal(http, ret, PROBLEM_NOT_FOUND, WORD_DAEMON_REFUSAL_NO_EMULATOR, NULL);
        return;
    }
    doc_faults_init(&faults);
    faults.language = reply_language(http);
    const enum ischia_code code =
        case_doc_read(&request, http->body, http->body_size, &json_limits_request, &faults, &err);
    if (code == ISCHIA_OK && faults.count == 0) {
        give(call, &request.values, ret);
        return;
    }
    if (code != ISCHIA_OK)
        problem_from_error(&problem, &err);
    else
        problem_from_faults(&problem, &faults);
    reply_problem(http, &problem, ret);
}

void handle_estimate(struct call *call, struct http_response *ret)
{
    answer(call, ret, send_estimate);
}

/* --------------------------------------------------------------------------------- what if */

enum { POINTS_DEFAULT = 41, POINTS_MIN = 2, POINTS_MAX = 201 };

struct sweep {
    enum ischia_param input;
    double from, to;
    int points;
};

static bool find_input(const char *key, enum ischia_param *ret)
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        if (strcmp(key, ischia_params[i].key) != 0) continue;
        *ret = (enum ischia_param)i;
        return true;
    }
    return false;
}

/* "?parameter=F&points=41"; false when one of them makes no sense. */
static bool read_query(const struct call *call, struct sweep *ret)
{
    char key[16], count[8];
    long long points = POINTS_DEFAULT;
    const char *query = call->request->query;
    const enum query_answer has_key = query_find(query, "parameter", key, sizeof key);
    const enum query_answer has_count = query_find(query, "points", count, sizeof count);
    ret->input = ISCHIA_F;
    if (has_key == QUERY_BAD || has_count == QUERY_BAD) return false;
    if (has_key == QUERY_FOUND && !find_input(key, &ret->input)) return false;
    if (has_count == QUERY_FOUND && !query_whole_number(count, POINTS_MIN, POINTS_MAX, &points))
        return false;
    ret->points = (int)points;
    return true;
}

static void refuse_query(const struct call *call, struct http_response *ret)
{
    char known[64];
    size_t used = 0;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        used += (size_t)snprintf(known + used, sizeof known - used, "%s%s", i == 0 ? "" : ", ",
                                 ischia_params[i].key);
    reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_WHAT_IF,
                  WORDS(word_text("known", known), word_count("min", POINTS_MIN),
                        word_count("max", POINTS_MAX)));
}

/* Over the training box, and no further than where the case would not be valid any more. */
static void bound_sweep(const struct predictor *p, const struct ischia_case *c, struct sweep *sweep)
{
    sweep->from = p->input[sweep->input].min;
    sweep->to = p->input[sweep->input].max;
    if (sweep->input == ISCHIA_R2) sweep->from = fmax(sweep->from, c->param[ISCHIA_R1]);
    if (sweep->input == ISCHIA_R1) sweep->to = fmin(sweep->to, c->param[ISCHIA_R2]);
}

static double sweep_value(const struct sweep *sweep, int k)
{
    if (k + 1 == sweep->points) return sweep->to; /* not a rounding beyond it */
    return sweep->from + (sweep->to - sweep->from) * k / (sweep->points - 1);
}

static void put_points(struct json_out *out, const struct predictor *p, const struct ischia_case *c,
                       const struct sweep *sweep)
{
    json_open_array(out, "points");
    for (int k = 0; k < sweep->points; k++) {
        struct ischia_case at = *c;
        at.param[sweep->input] = sweep_value(sweep, k);
        if (!predictor_knows(p, &at)) continue; /* another input is outside: no point is inside */
        json_open_object(out, NULL);
        json_put_number(out, "at", at.param[sweep->input]);
        estimate_put_values(out, p, &at);
        estimate_put_margins(out, "margin", p, &at);
        json_close_object(out);
    }
    json_close_array(out);
}

static void send_sweep(struct call *call, const struct ischia_case *c, struct http_response *ret)
{
    const struct estimator *estimator = call->service->estimator;
    const struct predictor *p = &estimator->predictor;
    struct sweep sweep;
    struct json_out out;
    if (!read_query(call, &sweep)) {
        refuse_query(call, ret);
        return;
    }
    bound_sweep(p, c, &sweep);
    begin_document(&out, "what_if", c);
    json_put_string(&out, "parameter", ischia_params[sweep.input].key);
    json_put_string(&out, "unit", ischia_params[sweep.input].unit);
    put_points(&out, p, c, &sweep);
    if (predictor_knows(p, c))
        estimate_put_forces(&out, "target_force_N", p, c);
    else
        json_put_null(&out, "target_force_N");
    estimate_put_emulator(&out, estimator);
    estimate_put_warnings(&out, p, c, reply_language(call->request));
    json_close_object(&out);
    send_document(call, &out, ret);
}

void handle_what_if(struct call *call, struct http_response *ret) { answer(call, ret, send_sweep); }
