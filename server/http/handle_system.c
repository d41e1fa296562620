/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/parameters_doc.h"
#include "api/problem_doc.h"
#include "server/http/assets.h"
#include "server/http/estimate_doc.h"
#include "server/http/page.h"
#include "server/http/reply.h"
#include "server/http/routes.h"
#include "server/http/versions.h"
#include "server/metrics.h"
#include "solver/case.h"

/* What the service says about itself: parameters, contract, health, metrics, versions. */

static void send_json(struct call *call, struct json_out *out, struct http_response *ret)
{
    struct ischia_error err;
    char *text = NULL;
    size_t size = 0;
    if (json_out_take(out, &text, &size, &err) == ISCHIA_OK)
        http_body(ret, "application/json", text, size);
    else
        reply_failure(call->request, ret, &err);
}

void handle_parameters(struct call *call, struct http_response *ret)
{
    struct ischia_error err;
    char *text = NULL;
    const enum language language = reply_language(call->request);
    http_header_static(ret, "Cache-Control", "no-cache");
    reply_put_language(call->request, ret);
    (void)snprintf(ret->etag, sizeof ret->etag, "\"%s-%d-%s-%s\"", ISCHIA_MODEL_NAME,
                   ISCHIA_MODEL_VERSION, language_tags[language], ISCHIA_VERSION);
    if (reply_not_modified(call->request, ret)) return;
    if (parameters_doc_text(&text, language, 2, &err) == ISCHIA_OK)
        http_body(ret, "application/json", text, strlen(text));
    else
        reply_failure(call->request, ret, &err);
}

void handle_openapi(struct call *call, struct http_response *ret)
{
    page_asset(call, asset_openapi(), ret);
}

void handle_health(struct call *call, struct http_response *ret)
{
    static const char alive[] = "{\"status\":\"alive\"}\n";
    (void)call;
    http_header_static(ret, "Cache-Control", "no-store");
    http_body_static(ret, "application/json", alive, sizeof alive - 1);
}

/* Ready: the store commits and a worker has said hello. */
void handle_ready(struct call *call, struct http_response *ret)
{
    struct ischia_error err;
    struct pool_stats pool;
    struct json_out out;
    struct service *service = call->service;
    const bool stored = store_probe(service->store, &err) == ISCHIA_OK;
    pool_stats(queue_pool(service->queue), &pool);
    const bool solves = pool.ready + pool.busy > 0;
    const bool draining = atomic_load(&service->draining);
    if (!stored || !solves || draining) {
        http_header_static(ret, "Retry-After", "5");
        reply_refusal(call->request, ret, PROBLEM_UNAVAILABLE,
                      draining ? WORD_DAEMON_REFUSAL_SHUTTING_DOWN
                      : stored ? WORD_DAEMON_REFUSAL_NO_WORKER
                               : WORD_DAEMON_REFUSAL_STORE,
                      NULL);
        return;
    }
    http_header_static(ret, "Cache-Control", "no-store");
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    json_put_string(&out, "status", "ready");
    json_put_integer(&out, "workers", pool.ready + pool.busy);
    json_close_object(&out);
    send_json(call, &out, ret);
}

/* Gauges of what others count, as of now. */
static void collect(struct service *service)
{
    struct store_stats stats;
    struct pool_stats pool;
    int64_t waiting = 0;
    if (store_stats(service->store, &stats, NULL) == ISCHIA_OK) {
        struct timespec now;
        (void)clock_gettime(CLOCK_REALTIME, &now);
        const double age = stats.oldest_queued_ms == 0
                               ? 0
                               : (double)now.tv_sec - (double)stats.oldest_queued_ms / 1e3;
        metrics_set(METRIC_QUEUED, (double)stats.count[QUEUE_QUEUED]);
        metrics_set(METRIC_RUNNING, (double)stats.count[QUEUE_RUNNING]);
        metrics_set(METRIC_OLDEST_QUEUED_SECONDS, age > 0 ? age : 0);
        metrics_set(METRIC_STORE_BYTES, (double)stats.size_bytes);
        metrics_count_to(METRIC_STORE_COMMITS, stats.commits);
        metrics_count_to(METRIC_STORE_FAILURES, stats.write_failures + stats.audit_failures);
    }
    pool_stats(queue_pool(service->queue), &pool);
    metrics_set(METRIC_WORKERS, pool.ready + pool.busy);
    metrics_set(METRIC_WORKERS_BUSY, pool.busy);
    metrics_count_to(METRIC_WORKER_DEATHS, pool.died);
    metrics_count_to(METRIC_STUDY_YIELDS, pool.yielded);
    if (store_study_waiting(service->store, &waiting, NULL) == ISCHIA_OK)
        metrics_set(METRIC_STUDY_POINTS_WAITING, (double)waiting);
}

void handle_metrics(struct call *call, struct http_response *ret)
{
    struct ischia_error err = {.code = ISCHIA_E_MEMORY, .message = "no memory for the metrics"};
    char *text = NULL, model[64];
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (out == NULL) {
        reply_failure(call->request, ret, &err);
        return;
    }
    collect(call->service);
    (void)snprintf(model, sizeof model, "%s-%d", ISCHIA_MODEL_NAME, ISCHIA_MODEL_VERSION);
    metrics_print(out, model);
    if (fclose(out) != 0) {
        free(text);
        reply_failure(call->request, ret, &err);
        return;
    }
    http_header_static(ret, "Cache-Control", "no-store");
    http_body(ret, "text/plain; version=0.0.4; charset=utf-8", text, size);
}

void handle_version(struct call *call, struct http_response *ret)
{
    struct json_out out;
    struct pool_stats pool;
    pool_stats(queue_pool(call->service->queue), &pool);
    json_out_init(&out, 2);
    json_open_object(&out, NULL);
    json_put_string(&out, "program", "ischiad");
    json_put_string(&out, "version", ISCHIA_VERSION);
    json_open_object(&out, "model");
    json_put_string(&out, "name", ISCHIA_MODEL_NAME);
    json_put_integer(&out, "version", ISCHIA_MODEL_VERSION);
    json_close_object(&out);
    json_open_object(&out, "libraries");
    json_put_string(&out, "store", store_engine(call->service->store));
    for (const struct version *v = versions(); v->name != NULL; v++)
        json_put_string(&out, v->name, v->text());
    json_close_object(&out);
    json_put_string(&out, "worker", pool.program[0] == '\0' ? NULL : pool.program);
    json_put_integer(&out, "schema", store_schema_version());
    if (call->service->estimator != NULL)
        estimate_put_emulator(&out, call->service->estimator);
    else
        json_put_null(&out, "emulator");
    json_close_object(&out);
    http_header_static(ret, "Cache-Control", "no-cache");
    send_json(call, &out, ret);
}
