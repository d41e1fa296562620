/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_METRICS_H
#define ISCHIA_SERVER_METRICS_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/*
 * What /metrics shows, in Prometheus' text format. Fixed tables of atomics: counting costs one
 * addition and may be done from any thread. No label ever holds something a client chose.
 */

enum metric_counter {
    METRIC_ASSESSMENTS_ACCEPTED,
    METRIC_WORKER_DEATHS,
    METRIC_WORKER_STARTS,
    METRIC_STORE_COMMITS,
    METRIC_STORE_FAILURES,
    METRIC_REFUSED_RATE,
    METRIC_REFUSED_AUTH,
    METRIC_REFUSED_ORIGIN,
    METRIC_SLOW_CLIENTS,
    METRIC_STUDY_POINTS,
    METRIC_STUDY_YIELDS,
    METRIC_COUNTER_COUNT
};

enum metric_gauge {
    METRIC_QUEUED,
    METRIC_RUNNING,
    METRIC_OLDEST_QUEUED_SECONDS,
    METRIC_WORKERS,
    METRIC_WORKERS_BUSY,
    METRIC_STORE_BYTES,
    METRIC_CONNECTIONS,
    METRIC_EVENT_STREAMS,
    METRIC_STUDY_POINTS_WAITING,
    METRIC_GAUGE_COUNT
};

/* Labels of the solve histogram: how the solve ended. */
enum metric_outcome { OUTCOME_SUCCEEDED, OUTCOME_FAILED, OUTCOME_CANCELLED, OUTCOME_COUNT };
/* Labels of the store histogram. */
enum metric_store { STORE_READS, STORE_LISTS, STORE_ACCEPTS, STORE_CHANGES, STORE_KIND_COUNT };

void metrics_count(enum metric_counter counter);
void metrics_count_to(enum metric_counter counter, uint64_t total); /* a total kept elsewhere */
void metrics_set(enum metric_gauge gauge, double value);
void metrics_add(enum metric_gauge gauge, int change);
void metrics_solve(enum metric_outcome outcome, double seconds);
void metrics_store(enum metric_store kind, double seconds);

/* The routes' names, static storage, given once before the first metrics_http. */
void metrics_set_routes(const char *const *names, size_t count);
/* `route` is an index into those names; any other value counts as "none" (no such path). */
void metrics_http(size_t route, int status, double seconds);

/* A monotonic clock, in microseconds, for the times above. */
int64_t metrics_now_us(void);

/* Writes everything. `model` is "name-version" of the mechanical model. */
void metrics_print(FILE *out, const char *model);

#endif
