/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The pool against a worker that misbehaves on command (tests/crash/fake_worker.c). */
#include <dirent.h>
#include <errno.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "server/pool.h"

enum { JOBS_MAX = 16, WAIT_S = 100 };

struct ended {
    enum pool_end end;
    char document[2048], field[64], detail[200];
    unsigned char id;
};

/* A host with a list of jobs, that writes down everything it is told. */
struct host {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    const char *job[JOBS_MAX];
    int jobs, given, ends, progress, ticks;
    int yielding; /* the first jobs yield */
    int pressing;
    int notes[POOL_NOTE_KIND_COUNT];
    int last_pid;
    char last_failure[400];
    struct ended ended[JOBS_MAX];
    int drawings;
    enum ischia_code drawing_code[JOBS_MAX];
    char drawing[JOBS_MAX][128];
    struct pool *pool;
};

static void lock(struct host *host) { assert_int_equal(pthread_mutex_lock(&host->lock), 0); }
static void unlock(struct host *host)
{
    (void)pthread_cond_broadcast(&host->changed);
    assert_int_equal(pthread_mutex_unlock(&host->lock), 0);
}

static bool next_job(void *context, struct pool_job *ret)
{
    struct host *host = context;
    lock(host);
    const bool has = host->given < host->jobs;
    if (has) {
        *ret = (struct pool_job){.attempt = 1,
                                 .yields = host->given < host->yielding,
                                 .case_json = strdup(host->job[host->given])};
        ret->id.byte[0] = (unsigned char)++host->given;
    }
    unlock(host);
    return has;
}

static int64_t pressing(void *context)
{
    struct host *host = context;
    lock(host);
    const int64_t waiting = host->pressing;
    unlock(host);
    return waiting;
}

static void on_progress(void *context, const struct pool_job *job,
                        const struct pool_progress *progress)
{
    struct host *host = context;
    lock(host);
    (void)job;
    if (progress->fraction > 0.4 && strcmp(progress->message, "pressing") == 0) host->progress++;
    unlock(host);
}

static void on_outcome(void *context, const struct pool_job *job,
                       const struct pool_outcome *outcome)
{
    struct host *host = context;
    lock(host);
    struct ended *ended = &host->ended[host->ends++];
    ended->end = outcome->end;
    ended->id = job->id.byte[0];
    (void)snprintf(ended->document, sizeof ended->document, "%s",
                   outcome->document == NULL ? "" : outcome->document);
    (void)snprintf(ended->field, sizeof ended->field, "%.*s", (int)outcome->field_size,
                   outcome->field == NULL ? "" : (const char *)outcome->field);
    (void)snprintf(ended->detail, sizeof ended->detail, "%s", outcome->detail);
    unlock(host);
}

static void on_note(void *context, const struct pool_note *note)
{
    struct host *host = context;
    lock(host);
    host->notes[note->kind]++;
    if (note->pid > 0) host->last_pid = note->pid;
    if (note->kind == POOL_NOTE_FAILED || note->kind == POOL_NOTE_DIED)
        (void)snprintf(host->last_failure, sizeof host->last_failure, "%s", note->detail);
    unlock(host);
}

static void on_tick(void *context)
{
    struct host *host = context;
    lock(host);
    host->ticks++;
    unlock(host);
}

static void on_drawing(void *context, enum ischia_code code, const unsigned char *bytes,
                       size_t size, const struct ischia_error *err)
{
    struct host *host = context;
    lock(host);
    host->drawing_code[host->drawings] = code;
    (void)snprintf(host->drawing[host->drawings++], 128, "%.*s",
                   code == ISCHIA_OK ? (int)size : 127,
                   code == ISCHIA_OK ? (const char *)bytes : err->message);
    unlock(host);
}

/* Waits until *counter reaches count; fails the test after WAIT_S. */
static void await(struct host *host, const int *counter, int count)
{
    struct timespec until;
    (void)clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += WAIT_S;
    lock(host);
    int code = 0;
    while (*counter < count && code == 0)
        code = pthread_cond_timedwait(&host->changed, &host->lock, &until);
    const int reached = *counter;
    unlock(host);
    if (reached < count) fail_msg("only %d of %d after %d s", reached, count, WAIT_S);
}

static double monotonic_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}

static struct pool_options options_with(const char *const *command)
{
    return (struct pool_options){.command = command,
                                 .solve_workers = 1,
                                 .poll_ms = 50,
                                 .backoff_min_ms = 20,
                                 .backoff_max_ms = 100,
                                 .solve_deadline_ms = 60000};
}

static const char *const plain_command[] = {FAKE_WORKER, NULL};

static void start(struct host *host, const struct pool_options *options)
{
    struct ischia_error err = {0};
    const struct pool_host callbacks = {.context = host,
                                        .next_job = next_job,
                                        .pressing = pressing,
                                        .on_progress = on_progress,
                                        .on_outcome = on_outcome,
                                        .on_note = on_note,
                                        .on_tick = on_tick};
    (void)pthread_mutex_init(&host->lock, NULL);
    (void)pthread_cond_init(&host->changed, NULL);
    if (pool_create(options, &callbacks, &host->pool, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
}

static void stop(struct host *host)
{
    pool_destroy(host->pool, 0);
    (void)pthread_cond_destroy(&host->changed);
    (void)pthread_mutex_destroy(&host->lock);
}

static bool is_alive(int pid) { return kill(pid, 0) == 0 || errno != ESRCH; }

static int descriptors(void)
{
    int count = 0;
    DIR *directory = opendir("/proc/self/fd");
    assert_non_null(directory);
    while (readdir(directory) != NULL) count++;
    (void)closedir(directory);
    return count;
}

static void run_jobs(struct host *host, const struct pool_options *options)
{
    start(host, options);
    await(host, &host->ends, host->jobs);
    await(host, &host->notes[POOL_NOTE_READY], 1);
}

static void test_solves_in_order(void **state)
{
    (void)state;
    struct host host = {.job = {"{\"n\":11}", "{\"n\":12}", "{\"do\":\"diverge\"}"}, .jobs = 3};
    const struct pool_options options = options_with(plain_command);
    const int before = descriptors();
    run_jobs(&host, &options);
    assert_int_equal(host.ended[0].end, POOL_RESULT);
    assert_string_equal(host.ended[0].field, "field");
    assert_non_null(strstr(host.ended[0].document, "\"newton_iterations\":11"));
    assert_non_null(strstr(host.ended[1].document, "\"newton_iterations\":12"));
    assert_int_equal(host.ended[2].end, POOL_PROBLEM);
    assert_int_equal(host.progress, 2);
    assert_int_equal(host.notes[POOL_NOTE_STARTED], 1); /* one process for all of them */
    stop(&host);
    assert_int_equal(host.notes[POOL_NOTE_ENDED], 1);
    assert_false(is_alive(host.last_pid));
    assert_int_equal(descriptors(), before);
}

/* Each misdeed ends its job in one way, and the next job is solved all the same. */
static void expect_end(const char *deed, enum pool_end end, const char *words, int died)
{
    struct host host = {.job = {deed, "{\"n\":5}"}, .jobs = 2};
    struct pool_options options = options_with(plain_command);
    options.solve_deadline_ms = end == POOL_DEADLINE ? 1500 : 60000;
    options.memory_max_bytes = strstr(deed, "memory") != NULL ? 64u << 20 : 0;
    run_jobs(&host, &options);
    assert_int_equal(host.ended[0].end, end);
    assert_int_equal(host.ended[0].id, 1);
    if (strstr(host.ended[0].detail, words) == NULL &&
        strstr(host.ended[0].document, words) == NULL)
        fail_msg("no '%s' in '%s' or '%s'", words, host.ended[0].detail, host.ended[0].document);
    assert_int_equal(host.ended[1].end, POOL_RESULT);
    assert_int_equal(host.ended[1].id, 2);
    assert_int_equal(host.notes[POOL_NOTE_DIED], died);
    assert_int_equal(host.ends, 2);
    stop(&host);
}

static void test_crash(void **state)
{
    (void)state;
    expect_end("{\"do\":\"crash\"}", POOL_CRASHED, "signal 11", 1);
}

static void test_kill_by_the_system(void **state)
{
    (void)state;
    expect_end("{\"do\":\"killed\"}", POOL_CRASHED, "perhaps for want of memory", 1);
}

static void test_exit(void **state)
{
    (void)state;
    expect_end("{\"do\":\"exit\"}", POOL_CRASHED, "exited with status 3", 1);
}

static void test_hang(void **state)
{
    (void)state;
    expect_end("{\"do\":\"hang\"}", POOL_DEADLINE, "longer than", 1);
}

static void test_closed_socket(void **state)
{
    (void)state;
    expect_end("{\"do\":\"close\"}", POOL_CRASHED, "signal 9", 1);
}

static void test_memory_limit(void **state)
{
    (void)state;
    if (SANITIZED) {
        print_message("skipped: a sanitizer's own memory is beyond any sensible limit\n");
        skip();
    }
    expect_end("{\"do\":\"memory\"}", POOL_PROBLEM, "memory", 0);
}

static void test_babble(void **state)
{
    (void)state;
    expect_end("{\"do\":\"babble\"}", POOL_CRASHED, "neither a JSON object nor a blob", 1);
    expect_end("{\"do\":\"bad_json\"}", POOL_CRASHED, "", 1);
    expect_end("{\"do\":\"bad_job\"}", POOL_CRASHED, "wrong kind", 1);
    expect_end("{\"do\":\"bad_blob\"}", POOL_CRASHED, "too long", 1);
    expect_end("{\"do\":\"stale\"}", POOL_CRASHED, "a job that it does not have", 1);
}

static void test_last_words_count(void **state)
{
    (void)state;
    struct host host = {.job = {"{\"do\":\"die_after\",\"n\":3}"}, .jobs = 1};
    const struct pool_options options = options_with(plain_command);
    run_jobs(&host, &options);
    await(&host, &host.notes[POOL_NOTE_DIED], 1);
    assert_int_equal(host.ends, 1);
    assert_int_equal(host.ended[0].end, POOL_RESULT);
    assert_non_null(strstr(host.ended[0].document, "\"newton_iterations\":3"));
    stop(&host);
}

static void test_cancel_ends_the_process(void **state)
{
    (void)state;
    struct host host = {.job = {"{\"do\":\"hang\"}", "{}"}, .jobs = 2};
    const struct pool_options options = options_with(plain_command);
    const struct uuid nobody = {{99}}, first = {{1}};
    start(&host, &options);
    await(&host, &host.given, 1);
    const int pid = host.last_pid;
    pool_cancel(host.pool, &nobody);
    pool_cancel(host.pool, &first);
    await(&host, &host.ends, 1);
    assert_int_equal(host.ended[0].end, POOL_CANCELLED);
    assert_false(is_alive(pid));
    await(&host, &host.ends, 2);
    assert_int_equal(host.ended[1].end, POOL_RESULT);
    struct pool_stats stats;
    pool_stats(host.pool, &stats);
    assert_int_equal(stats.cancelled, 1);
    assert_int_equal(stats.died, 0);
    stop(&host);
}

/* Two solves that yield keep both workers; a job that may not wait comes. */
static void test_the_latest_solve_that_yields_makes_room(void **state)
{
    (void)state;
    struct host host = {
        .job = {"{\"do\":\"hang\"}", "{\"do\":\"hang\"}", "{\"n\":4}"}, .jobs = 1, .yielding = 2};
    struct pool_options options = options_with(plain_command);
    options.solve_workers = 2;
    start(&host, &options);
    await(&host, &host.given, 1);
    await(&host, &host.ticks, host.ticks + 1); /* the second begins later, for every clock */
    lock(&host);
    host.jobs = 2;
    unlock(&host);
    await(&host, &host.given, 2);
    await(&host, &host.notes[POOL_NOTE_READY], 2);
    await(&host, &host.ticks, host.ticks + 3); /* nothing presses: nothing happens */
    assert_int_equal(host.ends, 0);
    lock(&host);
    host.jobs = 3;
    host.pressing = 1;
    unlock(&host);
    pool_wake(host.pool);
    await(&host, &host.ends, 1);
    assert_int_equal(host.ended[0].end, POOL_YIELDED);
    assert_int_equal(host.ended[0].id, 2);
    await(&host, &host.given, 3);
    lock(&host);
    host.pressing = 0;
    unlock(&host);
    await(&host, &host.ends, 2);
    assert_int_equal(host.ended[1].end, POOL_RESULT);
    assert_int_equal(host.ended[1].id, 3);
    struct pool_stats stats;
    pool_stats(host.pool, &stats);
    assert_int_equal(stats.yielded, 1);
    assert_int_equal(stats.died, 0); /* a worker that made room is no failure */
    stop(&host);
}

/* One that does not yield is left alone, whoever waits. */
static void test_what_does_not_yield_stays(void **state)
{
    (void)state;
    struct host host = {.job = {"{\"do\":\"slow\",\"ms\":600}", "{}"}, .jobs = 2, .pressing = 5};
    const struct pool_options options = options_with(plain_command);
    run_jobs(&host, &options);
    assert_int_equal(host.ended[0].end, POOL_RESULT);
    assert_int_equal(host.ended[1].end, POOL_RESULT);
    stop(&host);
}

static void test_drain_takes_back_what_runs(void **state)
{
    (void)state;
    struct host host = {.job = {"{\"do\":\"hang\"}", "{}"}, .jobs = 2};
    const struct pool_options options = options_with(plain_command);
    start(&host, &options);
    await(&host, &host.given, 1);
    pool_destroy(host.pool, 100);
    assert_int_equal(host.ends, 1);
    assert_int_equal(host.ended[0].end, POOL_DRAINED);
    assert_int_equal(host.given, 1); /* the second was never taken */
}

static void test_drain_lets_what_runs_end(void **state)
{
    (void)state;
    struct host host = {.job = {"{\"do\":\"slow\",\"ms\":200}"}, .jobs = 1};
    const struct pool_options options = options_with(plain_command);
    start(&host, &options);
    await(&host, &host.progress, 1);
    pool_destroy(host.pool, 60000);
    assert_int_equal(host.ends, 1);
    assert_int_equal(host.ended[0].end, POOL_RESULT);
}

static void ask_drawing(struct host *host, const char *case_json)
{
    struct ischia_error err = {0};
    const enum ischia_code code =
        pool_render(host->pool, POOL_RENDER_SVG, "fr", case_json, (const unsigned char *)"bytes", 5,
                    on_drawing, host, &err);
    if (code != ISCHIA_OK) fail_msg("%s", err.message);
}

static void test_drawings_do_not_wait_for_solves(void **state)
{
    (void)state;
    struct host host = {.job = {"{\"do\":\"hang\"}"}, .jobs = 1};
    struct pool_options options = options_with(plain_command);
    options.render_idle_ms = 100;
    start(&host, &options);
    await(&host, &host.given, 1);
    ask_drawing(&host, "{}");
    ask_drawing(&host, "{\"do\":\"crash\"}");
    ask_drawing(&host, "{\"do\":\"diverge\"}");
    await(&host, &host.drawings, 3);
    assert_int_equal(host.drawing_code[0], ISCHIA_OK);
    assert_string_equal(host.drawing[0], "svg-fr:bytes");
    assert_int_equal(host.drawing_code[1], ISCHIA_E_IO);
    assert_int_equal(host.drawing_code[2], ISCHIA_E_INPUT);
    ask_drawing(&host, "{}");
    await(&host, &host.drawings, 4);
    assert_int_equal(host.drawing_code[3], ISCHIA_OK);
    await(&host, &host.notes[POOL_NOTE_ENDED], 1); /* leaves when idle */
    stop(&host);
}

static void test_drawings_are_limited(void **state)
{
    (void)state;
    struct host host = {.jobs = 0};
    struct pool_options options = options_with(plain_command);
    options.render_deadline_ms = 1500;
    options.renders_waiting_max = 1;
    start(&host, &options);
    ask_drawing(&host, "{\"ms\":20000}");
    struct pool_stats stats;
    do pool_stats(host.pool, &stats);
    while (stats.renders_waiting > 0);
    ask_drawing(&host, "{}");
    struct ischia_error err;
    assert_int_equal(
        pool_render(host.pool, POOL_RENDER_VTU, "en", "{}", NULL, 0, on_drawing, &host, &err),
        ISCHIA_E_LIMIT);
    await(&host, &host.drawings, 2);
    assert_int_equal(host.drawing_code[0], ISCHIA_E_LIMIT);
    assert_int_equal(host.drawing_code[1], ISCHIA_OK);
    pool_drain(host.pool);
    assert_int_equal(
        pool_render(host.pool, POOL_RENDER_VTU, "en", "{}", NULL, 0, on_drawing, &host, &err),
        ISCHIA_E_STATE);
    stop(&host);
}

/* A worker that dies again and again is started ever more slowly, and is given no job. */
static void expect_slow_restarts(const char *mode)
{
    const char *const command[] = {FAKE_WORKER, mode, NULL};
    struct host host = {.job = {"{}"}, .jobs = strcmp(mode, "die_after_hello") == 0 ? 0 : 1};
    struct pool_options options = options_with(command);
    options.backoff_min_ms = 100;
    options.backoff_max_ms = 1000;
    options.hello_deadline_ms = 150;
    const double begun_ms = monotonic_ms();
    start(&host, &options);
    await(&host, &host.notes[POOL_NOTE_STARTED], 5);
    const double took_ms = monotonic_ms() - begun_ms;
    if (host.given != 0) fail_msg("%s: it was given a job", mode);
    if (took_ms < 0 + 100 + 200 + 400) fail_msg("%s: five starts in %.0f ms", mode, took_ms);
    stop(&host);
}

static void test_restarts_slow_down(void **state)
{
    (void)state;
    expect_slow_restarts("exit_first");
    expect_slow_restarts("no_hello");
    expect_slow_restarts("die_after_hello");
}

static void test_other_model_version_is_refused(void **state)
{
    (void)state;
    const char *const command[] = {FAKE_WORKER, "wrong_version", NULL};
    struct host host = {.job = {"{}"}, .jobs = 1};
    const struct pool_options options = options_with(command);
    start(&host, &options);
    await(&host, &host.notes[POOL_NOTE_FAILED], 1);
    assert_non_null(strstr(host.last_failure, "another version"));
    assert_int_equal(host.given, 0);
    stop(&host);
}

static void test_unusable_program(void **state)
{
    (void)state;
    const char *const command[] = {"/nonexistent/ischia", "worker", NULL};
    const struct pool_options options = options_with(command);
    const struct pool_host host = {.next_job = next_job};
    struct ischia_error err = {0};
    struct pool *pool = NULL;
    assert_int_equal(pool_create(&options, &host, &pool, &err), ISCHIA_E_IO);
    assert_non_null(strstr(err.message, "/nonexistent/ischia"));
    const char *const text_file[] = {SOURCE_ROOT "/tests/crash", NULL}; /* passes access(2) */
    struct host told = {.jobs = 0};
    const struct pool_options other = options_with(text_file);
    start(&told, &other);
    await(&told, &told.notes[POOL_NOTE_DIED], 1);
    assert_string_equal(told.last_failure, "the worker program could not be executed");
    stop(&told);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_solves_in_order),
        cmocka_unit_test(test_crash),
        cmocka_unit_test(test_kill_by_the_system),
        cmocka_unit_test(test_exit),
        cmocka_unit_test(test_hang),
        cmocka_unit_test(test_closed_socket),
        cmocka_unit_test(test_memory_limit),
        cmocka_unit_test(test_babble),
        cmocka_unit_test(test_last_words_count),
        cmocka_unit_test(test_cancel_ends_the_process),
        cmocka_unit_test(test_the_latest_solve_that_yields_makes_room),
        cmocka_unit_test(test_what_does_not_yield_stays),
        cmocka_unit_test(test_drain_takes_back_what_runs),
        cmocka_unit_test(test_drain_lets_what_runs_end),
        cmocka_unit_test(test_drawings_do_not_wait_for_solves),
        cmocka_unit_test(test_drawings_are_limited),
        cmocka_unit_test(test_restarts_slow_down),
        cmocka_unit_test(test_other_model_version_is_refused),
        cmocka_unit_test(test_unusable_program),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
