/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What the store can do, without HTTP: bench_store DIR [SECONDS].
 * Durable accepts a second with 1, 16 and 64 callers that each wait for their commit, one page of
 * a listing and one lookup in what has gathered by then.
 */
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "server/store/store.h"

enum { CALLERS_MAX = 64, SAMPLES_MAX = 1 << 18 };

static struct store *store;
static atomic_bool stopping;
static atomic_int samples;
static double sample_ms[SAMPLES_MAX];
static struct uuid known;

static double now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static void check(enum ischia_code code, const struct ischia_error *err)
{
    if (code == ISCHIA_OK) return;
    (void)fprintf(stderr, "bench_store: %s\n", err->message);
    exit(1);
}

static void *accept_until_told(void *argument)
{
    const struct store_new what = {
        .subject = "P-017",
        .side = "left",
        .case_json = "{\"R1\":7.1,\"R2\":22.8,\"eM\":31,\"eF\":10,\"muM\":8,\"muF\":5,\"F\":258}",
        .warnings_json = "[]",
        .priority = QUEUE_CLINIC,
        .client = ""};
    while (!atomic_load(&stopping)) {
        struct store_accepted accepted;
        struct ischia_error err = {0};
        const double begun_ms = now_ms();
        check(store_accept(store, &what, &accepted, &err), &err);
        const int sample = atomic_fetch_add(&samples, 1);
        if (sample < SAMPLES_MAX) sample_ms[sample] = now_ms() - begun_ms;
        if (sample == 0) known = accepted.id;
    }
    return argument;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void bench_accepts(int callers, double seconds)
{
    pthread_t thread[CALLERS_MAX];
    atomic_store(&stopping, false);
    atomic_store(&samples, 0);
    const double begun_ms = now_ms();
    for (int i = 0; i < callers; i++)
        if (pthread_create(&thread[i], NULL, accept_until_told, NULL) != 0) exit(1);
    while (now_ms() - begun_ms < 1e3 * seconds) {
        const struct timespec rest = {0, 10000000};
        (void)nanosleep(&rest, NULL);
    }
    atomic_store(&stopping, true);
    for (int i = 0; i < callers; i++) (void)pthread_join(thread[i], NULL);
    const double took_s = (now_ms() - begun_ms) / 1e3;
    const int total = atomic_load(&samples);
    const int kept = total < SAMPLES_MAX ? total : SAMPLES_MAX;
    qsort(sample_ms, (size_t)kept, sizeof sample_ms[0], by_size);
    printf("%2d callers: %7.0f durable accepts/s, median %.2f ms, p99 %.2f ms\n", callers,
           total / took_s, sample_ms[kept / 2], sample_ms[kept - 1 - kept / 100]);
}

static bool ignore(void *context, const struct store_assessment *row)
{
    (void)row;
    ++*(int *)context;
    return true;
}

static void bench_reads(void)
{
    struct store_stats stats;
    struct ischia_error err = {0};
    char cursor[STORE_CURSOR_BYTES];
    const struct store_filter filter = {.limit = 100, .by_state = true, .state = QUEUE_QUEUED};
    int rows = 0;
    enum { PAGES = 50, LOOKUPS = 20000 };
    check(store_stats(store, &stats, &err), &err);
    double begun_ms = now_ms();
    for (int i = 0; i < PAGES; i++)
        check(store_list(store, &filter, ignore, &rows, cursor, &err), &err);
    printf("%lld queued: a page of %d in %.2f ms\n", (long long)stats.count[QUEUE_QUEUED],
           rows / PAGES, (now_ms() - begun_ms) / PAGES);
    begun_ms = now_ms();
    for (int i = 0; i < LOOKUPS; i++) {
        struct store_assessment a = {0};
        enum store_answer answer;
        check(store_get(store, &known, &a, &answer, &err), &err);
        store_assessment_finish(&a);
    }
    printf("one thread: %.0f lookups/s; %llu writes in %llu commits\n",
           1e3 * LOOKUPS / (now_ms() - begun_ms), (unsigned long long)stats.writes,
           (unsigned long long)stats.commits);
}

int main(int argc, char **argv)
{
    if (argc < 2) return 2;
    const double seconds = argc > 2 ? strtod(argv[2], NULL) : 2.0;
    const struct store_options options = {.location = argv[1]};
    struct ischia_error err = {0};
    check(store_open(&options, &store, &err), &err);
    bench_accepts(1, seconds);
    bench_accepts(16, seconds);
    bench_accepts(CALLERS_MAX, seconds);
    bench_reads();
    store_close(store);
    return 0;
}
