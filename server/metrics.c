/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/metrics.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { ROUTES_MAX = 64, BUCKETS_MAX = 16 };

struct metric_info {
    const char *name;
    const char *help;
};

static const struct metric_info counter_info[METRIC_COUNTER_COUNT] = {
    [METRIC_ASSESSMENTS_ACCEPTED] = {"ischia_assessments_accepted_total",
                                     "Assessments durably accepted."},
    [METRIC_WORKER_DEATHS] = {"ischia_worker_deaths_total",
                              "Worker processes that ended on their own or had to be ended."},
    [METRIC_WORKER_STARTS] = {"ischia_worker_starts_total",
                              "Worker processes started; the first ones and replacements."},
    [METRIC_STORE_COMMITS] = {"ischia_store_commits_total", "Transactions committed."},
    [METRIC_STORE_FAILURES] = {"ischia_store_failures_total", "Writes that the store refused."},
    [METRIC_REFUSED_RATE] = {"ischia_refused_rate_total", "Requests over a client's rate limit."},
    [METRIC_REFUSED_AUTH] = {"ischia_refused_auth_total",
                             "Requests without a valid token or scope."},
    [METRIC_REFUSED_ORIGIN] = {"ischia_refused_origin_total",
                               "Requests with a foreign Host or Origin."},
    [METRIC_SLOW_CLIENTS] = {"ischia_slow_clients_total",
                             "Connections closed because a request did not arrive in time."},
    [METRIC_STUDY_POINTS] = {"ischia_study_points_total", "Points of studies that have ended."},
    [METRIC_STUDY_YIELDS] = {"ischia_study_yields_total",
                             "Solves of studies that were stopped to make room for a request."},
};

static const struct metric_info gauge_info[METRIC_GAUGE_COUNT] = {
    [METRIC_QUEUED] = {"ischia_queue_depth", "Assessments waiting for a worker."},
    [METRIC_RUNNING] = {"ischia_running", "Assessments being solved."},
    [METRIC_OLDEST_QUEUED_SECONDS] = {"ischia_queue_oldest_seconds",
                                      "Age of the assessment that has waited longest."},
    [METRIC_WORKERS] = {"ischia_workers", "Worker processes alive."},
    [METRIC_WORKERS_BUSY] = {"ischia_workers_busy", "Worker processes that are solving."},
    [METRIC_STORE_BYTES] = {"ischia_store_bytes", "Size of the store's files."},
    [METRIC_CONNECTIONS] = {"ischia_http_connections", "Connections open."},
    [METRIC_EVENT_STREAMS] = {"ischia_http_event_streams", "Event streams open."},
    [METRIC_STUDY_POINTS_WAITING] = {"ischia_study_points_waiting",
                                     "Points of studies that wait for a worker."},
};

static const double solve_bounds[] = {0.05, 0.1, 0.25, 0.5, 1, 2, 4, 8, 16, 32, 64, 128, 256};
static const double fast_bounds[] = {0.0001, 0.00025, 0.0005, 0.001, 0.0025, 0.005, 0.01,
                                     0.025,  0.05,    0.1,    0.25,  1,      5,     30};
#define COUNT_OF(array) (sizeof(array) / sizeof(array)[0])

struct histogram {
    atomic_ullong bucket[BUCKETS_MAX + 1]; /* the last is +Inf; not cumulative */
    atomic_ullong sum_us;
};

static const int statuses[] = {200, 201, 202, 204, 303, 304, 400, 401, 403, 404, 405, 406,
                               408, 409, 412, 413, 415, 421, 422, 429, 431, 500, 501, 503};
enum { STATUS_COUNT = COUNT_OF(statuses) };

static const char *const outcome_names[OUTCOME_COUNT] = {
    [OUTCOME_SUCCEEDED] = "succeeded",
    [OUTCOME_FAILED] = "failed",
    [OUTCOME_CANCELLED] = "cancelled",
};
static const char *const store_names[STORE_KIND_COUNT] = {
    [STORE_READS] = "read",
    [STORE_LISTS] = "list",
    [STORE_ACCEPTS] = "accept",
    [STORE_CHANGES] = "change",
};

static atomic_ullong counters[METRIC_COUNTER_COUNT];
static atomic_llong gauges_milli[METRIC_GAUGE_COUNT];
static struct histogram solve_seconds[OUTCOME_COUNT];
static struct histogram store_seconds[STORE_KIND_COUNT];
static struct histogram route_seconds[ROUTES_MAX + 1];
static atomic_ullong route_status[ROUTES_MAX + 1][STATUS_COUNT + 1]; /* the last: any other */
static const char *const *route_names;
static size_t route_count;

void metrics_count(enum metric_counter counter)
{
    (void)atomic_fetch_add_explicit(&counters[counter], 1, memory_order_relaxed);
}

void metrics_count_to(enum metric_counter counter, uint64_t total)
{
    atomic_store_explicit(&counters[counter], total, memory_order_relaxed);
}

void metrics_set(enum metric_gauge gauge, double value)
{
    atomic_store_explicit(&gauges_milli[gauge], (long long)(value * 1000), memory_order_relaxed);
}

void metrics_add(enum metric_gauge gauge, int change)
{
    (void)atomic_fetch_add_explicit(&gauges_milli[gauge], change * 1000LL, memory_order_relaxed);
}

static void observe(struct histogram *histogram, const double *bounds, size_t count, double seconds)
{
    size_t i = 0;
    while (i < count && seconds > bounds[i]) i++;
    (void)atomic_fetch_add_explicit(&histogram->bucket[i], 1, memory_order_relaxed);
    (void)atomic_fetch_add_explicit(&histogram->sum_us, (unsigned long long)(seconds * 1e6),
                                    memory_order_relaxed);
}

void metrics_solve(enum metric_outcome outcome, double seconds)
{
    observe(&solve_seconds[outcome], solve_bounds, COUNT_OF(solve_bounds), seconds);
}

void metrics_store(enum metric_store kind, double seconds)
{
    observe(&store_seconds[kind], fast_bounds, COUNT_OF(fast_bounds), seconds);
}

void metrics_set_routes(const char *const *names, size_t count)
{
    route_names = names;
    route_count = count < ROUTES_MAX ? count : ROUTES_MAX;
}

static size_t status_index(int status)
{
    for (size_t i = 0; i < STATUS_COUNT; i++)
        if (statuses[i] == status) return i;
    return STATUS_COUNT;
}

void metrics_http(size_t route, int status, double seconds)
{
    if (route > route_count) route = route_count;
    (void)atomic_fetch_add_explicit(&route_status[route][status_index(status)], 1,
                                    memory_order_relaxed);
    observe(&route_seconds[route], fast_bounds, COUNT_OF(fast_bounds), seconds);
}

int64_t metrics_now_us(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static void print_head(FILE *out, const char *name, const char *type, const char *help)
{
    (void)fprintf(out, "# HELP %s %s\n# TYPE %s %s\n", name, help, name, type);
}

static void print_histogram(FILE *out, const char *name, const char *label, const char *value,
                            struct histogram *histogram, const double *bounds, size_t count)
{
    unsigned long long total = 0;
    for (size_t i = 0; i <= count; i++) {
        total += atomic_load_explicit(&histogram->bucket[i], memory_order_relaxed);
        (void)fprintf(out, "%s_bucket{%s=\"%s\",le=\"", name, label, value);
        if (i < count)
            (void)fprintf(out, "%g\"} %llu\n", bounds[i], total);
        else
            (void)fprintf(out, "+Inf\"} %llu\n", total);
    }
    const double sum = (double)atomic_load_explicit(&histogram->sum_us, memory_order_relaxed) / 1e6;
    (void)fprintf(out, "%s_sum{%s=\"%s\"} %.6f\n%s_count{%s=\"%s\"} %llu\n", name, label, value,
                  sum, name, label, value, total);
}

static void print_routes(FILE *out)
{
    print_head(out, "ischia_http_requests_total", "counter", "Requests by route and status.");
    for (size_t r = 0; r <= route_count; r++) {
        for (size_t s = 0; s <= STATUS_COUNT; s++) {
            const unsigned long long n =
                atomic_load_explicit(&route_status[r][s], memory_order_relaxed);
            if (n == 0) continue;
            (void)fprintf(out, "ischia_http_requests_total{route=\"%s\",code=\"",
                          r < route_count ? route_names[r] : "none");
            if (s < STATUS_COUNT)
                (void)fprintf(out, "%d\"} %llu\n", statuses[s], n);
            else
                (void)fprintf(out, "other\"} %llu\n", n);
        }
    }
    print_head(out, "ischia_http_request_seconds", "histogram",
               "Time from a request's first line to the end of its answer, waits included.");
    for (size_t r = 0; r <= route_count; r++)
        print_histogram(out, "ischia_http_request_seconds", "route",
                        r < route_count ? route_names[r] : "none", &route_seconds[r], fast_bounds,
                        COUNT_OF(fast_bounds));
}

/* The second number of /proc/self/statm; 0 when it cannot be read. */
static unsigned long resident_pages(void)
{
    char line[128] = "", *end = line;
    FILE *statm = fopen("/proc/self/statm", "re");
    if (statm == NULL) return 0;
    if (fgets(line, sizeof line, statm) != NULL) (void)strtoul(line, &end, 10);
    (void)fclose(statm);
    return strtoul(end, NULL, 10);
}

static void print_process(FILE *out)
{
    struct timespec cpu;
    const unsigned long pages = resident_pages();
    if (pages > 0) {
        print_head(out, "process_resident_memory_bytes", "gauge", "Resident memory.");
        (void)fprintf(out, "process_resident_memory_bytes %lu\n",
                      pages * (unsigned long)sysconf(_SC_PAGESIZE));
    }
    if (clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &cpu) != 0) return;
    print_head(out, "process_cpu_seconds_total", "counter", "Processor time used by the daemon.");
    (void)fprintf(out, "process_cpu_seconds_total %.3f\n",
                  (double)cpu.tv_sec + (double)cpu.tv_nsec / 1e9);
}

void metrics_print(FILE *out, const char *model)
{
    print_head(out, "ischia_build_info", "gauge", "Versions of the program and the model.");
    (void)fprintf(out, "ischia_build_info{version=\"%s\",model=\"%s\"} 1\n", ISCHIA_VERSION, model);
    for (int i = 0; i < METRIC_COUNTER_COUNT; i++) {
        print_head(out, counter_info[i].name, "counter", counter_info[i].help);
        (void)fprintf(out, "%s %llu\n", counter_info[i].name,
                      atomic_load_explicit(&counters[i], memory_order_relaxed));
    }
    for (int i = 0; i < METRIC_GAUGE_COUNT; i++) {
        print_head(out, gauge_info[i].name, "gauge", gauge_info[i].help);
        (void)fprintf(out, "%s %g\n", gauge_info[i].name,
                      (double)atomic_load_explicit(&gauges_milli[i], memory_order_relaxed) / 1e3);
    }
    print_head(out, "ischia_solve_seconds", "histogram", "Wall time of solves by outcome.");
    for (int i = 0; i < OUTCOME_COUNT; i++)
        print_histogram(out, "ischia_solve_seconds", "outcome", outcome_names[i], &solve_seconds[i],
                        solve_bounds, COUNT_OF(solve_bounds));
    print_head(out, "ischia_store_seconds", "histogram", "Time of calls to the store by kind.");
    for (int i = 0; i < STORE_KIND_COUNT; i++)
        print_histogram(out, "ischia_store_seconds", "kind", store_names[i], &store_seconds[i],
                        fast_bounds, COUNT_OF(fast_bounds));
    print_routes(out);
    print_process(out);
}
