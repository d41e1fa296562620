/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The queue whole: a real store, real processes, a worker that misbehaves on command. */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "server/queue.h"
#include "tests/unit/test_folder.h"
#include "tests/unit/test_server.h"

enum { WAIT_MS = 100000 };

struct room {
    char directory[128];
    struct store *store;
    struct events *events;
    struct queue *queue;
    int finished, cancelled, points, store_errors;
};

static const char *const command[] = {FAKE_WORKER, NULL};

static void on_finished(void *context, const struct uuid *id, enum queue_state state,
                        enum pool_end end, int64_t wall_ms, const char *detail)
{
    struct room *room = context;
    (void)id;
    (void)end;
    (void)detail;
    if (state == QUEUE_CANCELLED) (void)__atomic_add_fetch(&room->cancelled, 1, __ATOMIC_SEQ_CST);
    if (wall_ms >= 0) (void)__atomic_add_fetch(&room->finished, 1, __ATOMIC_SEQ_CST);
}

static void on_point(void *context, enum queue_state state, enum pool_end end, int64_t wall_ms)
{
    struct room *room = context;
    (void)end;
    (void)wall_ms;
    if (queue_is_final(state)) (void)__atomic_add_fetch(&room->points, 1, __ATOMIC_SEQ_CST);
}

static void on_store_error(void *context, const struct ischia_error *err)
{
    struct room *room = context;
    (void)err;
    (void)__atomic_add_fetch(&room->store_errors, 1, __ATOMIC_SEQ_CST);
}

static void open_queue(struct room *room, int queued_max)
{
    struct ischia_error err = {0};
    const struct store_options options = {.location = test_server() == NULL ? room->directory
                                                                            : test_server()};
    const struct queue_options queue_options = {.pool = {.command = command,
                                                         .solve_workers = 1,
                                                         .poll_ms = 50,
                                                         .backoff_min_ms = 1,
                                                         .backoff_max_ms = 50,
                                                         .solve_deadline_ms = 3000},
                                                .queued_max = queued_max};
    const struct queue_watcher watcher = {.context = room,
                                          .on_finished = on_finished,
                                          .on_point = on_point,
                                          .on_store_error = on_store_error};
    if (store_open(&options, &room->store, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    assert_int_equal(events_create(&room->events, &err), ISCHIA_OK);
    if (queue_create(room->store, room->events, &queue_options, &watcher, &room->queue, &err) !=
        ISCHIA_OK)
        fail_msg("%s", err.message);
}

static void close_queue(struct room *room, int grace_ms)
{
    queue_destroy(room->queue, grace_ms);
    events_destroy(room->events);
    store_close(room->store);
}

static int set_up(void **state)
{
    struct room *room = calloc(1, sizeof *room);
    assert_non_null(room);
    test_folder_make(room->directory, sizeof room->directory, "queue");
    if (test_server() != NULL) empty_server();
    open_queue(room, 2);
    *state = room;
    return 0;
}

static int tear_down(void **state)
{
    struct room *room = *state;
    close_queue(room, 0);
    test_folder_remove(room->directory);
    free(room);
    return 0;
}

static struct store_accepted accept(struct room *room, const char *case_json)
{
    struct ischia_error err = {0};
    struct store_accepted accepted = {0};
    const struct store_new what = {
        .case_json = case_json, .warnings_json = "[]", .priority = QUEUE_CLINIC, .client = ""};
    if (queue_accept(room->queue, &what, &accepted, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    return accepted;
}

static void rest(void)
{
    const struct timespec ms = {0, 5000000};
    (void)nanosleep(&ms, NULL);
}

static enum queue_state state_of(struct room *room, const struct uuid *id)
{
    struct store_assessment a = {0};
    struct ischia_error err;
    enum store_answer answer;
    assert_int_equal(store_peek(room->store, id, &a, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    return a.state;
}

static void await_state(struct room *room, const struct uuid *id, enum queue_state state)
{
    for (int waited = 0; state_of(room, id) != state; waited += 5) {
        if (waited > WAIT_MS)
            fail_msg("still %s, not %s", queue_state_names[state_of(room, id)],
                     queue_state_names[state]);
        rest();
    }
}

/* What is stored is told a moment later. */
static void await_told(const int *counter, int count)
{
    for (int waited = 0; __atomic_load_n(counter, __ATOMIC_SEQ_CST) < count; waited += 5) {
        assert_true(waited < WAIT_MS);
        rest();
    }
    assert_int_equal(__atomic_load_n(counter, __ATOMIC_SEQ_CST), count);
}

/* Runs one case to its end and gives its document (result or problem), to be freed. */
static char *run(struct room *room, const char *case_json, enum queue_state end,
                 int64_t expected_attempts)
{
    struct store_assessment a = {0};
    struct ischia_error err;
    enum store_answer answer;
    const struct store_accepted accepted = accept(room, case_json);
    await_state(room, &accepted.id, end);
    assert_int_equal(store_get(room->store, &accepted.id, &a, &answer, &err), ISCHIA_OK);
    assert_int_equal(a.attempt, expected_attempts);
    char *document = strdup(end == QUEUE_SUCCEEDED ? a.result_json : a.problem_json);
    store_assessment_finish(&a);
    return document;
}

static void expect(struct room *room, const char *case_json, enum queue_state end,
                   int64_t expected_attempts, const char *words)
{
    char *document = run(room, case_json, end, expected_attempts);
    if (strstr(document, words) == NULL) fail_msg("no '%s' in %s", words, document);
    free(document);
}

static void test_ends_of_all_kinds(void **state)
{
    struct room *room = *state;
    expect(room, "{\"n\":7}", QUEUE_SUCCEEDED, 1, "\"newton_iterations\":7");
    expect(room, "{\"do\":\"diverge\"}", QUEUE_FAILED, 1, "#problem-not-converged");
    expect(room, "{\"do\":\"hang\"}", QUEUE_FAILED, 1, "#problem-time-limit");
    /* a death is tried once more, then told */
    expect(room, "{\"do\":\"crash\"}", QUEUE_FAILED, 2, "killed by signal 11");
    expect(room, "{\"do\":\"babble\"}", QUEUE_FAILED, 2, "#problem-worker-died");
    /* "succeeded" is only ever said of a result that holds */
    expect(room, "{\"do\":\"bad_result\"}", QUEUE_FAILED, 2, "did not hold");
    expect(room, "{\"do\":\"unconverged\"}", QUEUE_FAILED, 2, "did not hold");
    await_told(&room->finished, 7);
}

static void wake(void *context) { (void)__atomic_add_fetch((int *)context, 1, __ATOMIC_SEQ_CST); }

static void test_events_tell_the_whole_story(void **state)
{
    struct room *room = *state;
    struct ischia_error err;
    struct events_subscription *listener;
    struct event event[EVENTS_RING];
    int woken = 0;
    const struct store_accepted blocker = accept(room, "{\"do\":\"slow\",\"ms\":150}");
    const struct store_accepted watched = accept(room, "{\"n\":3}");
    assert_int_equal(events_subscribe(room->events, &watched.id, wake, &woken, &listener, &err),
                     ISCHIA_OK);
    await_state(room, &blocker.id, QUEUE_SUCCEEDED);
    await_state(room, &watched.id, QUEUE_SUCCEEDED);
    for (int waited = 0; __atomic_load_n(&woken, __ATOMIC_SEQ_CST) < 3; waited++) {
        assert_true(waited < WAIT_MS);
        rest();
    }
    const size_t count = events_read(room->events, &watched.id, 0, event, EVENTS_RING);
    assert_int_equal(count, 3);
    assert_int_equal(event[0].kind, EVENT_STATE);
    assert_int_equal(event[0].state, QUEUE_RUNNING);
    assert_int_equal(event[1].kind, EVENT_PROGRESS);
    assert_string_equal(event[1].message, "pressing");
    assert_int_equal(event[2].kind, EVENT_DONE);
    assert_int_equal(event[2].state, QUEUE_SUCCEEDED);
    events_unsubscribe(listener);
}

static void test_cancel_stops_what_runs_and_what_waits(void **state)
{
    struct room *room = *state;
    struct ischia_error err;
    enum queue_state was;
    enum store_answer answer;
    const struct store_accepted running = accept(room, "{\"do\":\"slow\",\"ms\":2500,\"n\":1}");
    await_state(room, &running.id, QUEUE_RUNNING);
    const struct store_accepted waiting = accept(room, "{\"n\":2}");
    assert_int_equal(queue_cancel(room->queue, &waiting.id, &was, &answer, &err), ISCHIA_OK);
    assert_int_equal(was, QUEUE_QUEUED);
    assert_int_equal(queue_cancel(room->queue, &running.id, &was, &answer, &err), ISCHIA_OK);
    assert_int_equal(was, QUEUE_RUNNING);
    const struct store_accepted next = accept(room, "{\"n\":3}");
    await_state(room, &next.id, QUEUE_SUCCEEDED);
    assert_int_equal(state_of(room, &running.id), QUEUE_CANCELLED);
    assert_int_equal(state_of(room, &waiting.id), QUEUE_CANCELLED);
    struct pool_stats stats;
    pool_stats(queue_pool(room->queue), &stats);
    assert_int_equal(stats.cancelled, 1); /* a process really ended */
    await_told(&room->finished, 2);       /* the one that ran, and the next */
    assert_int_equal(__atomic_load_n(&room->cancelled, __ATOMIC_SEQ_CST), 1);
}

static void test_full_queue_and_cache(void **state)
{
    struct room *room = *state;
    const struct store_accepted first = accept(room, "{\"do\":\"slow\",\"ms\":1500,\"n\":1}");
    await_state(room, &first.id, QUEUE_RUNNING);
    const struct store_accepted second = accept(room, "{\"n\":2}");
    (void)accept(room, "{\"n\":3}");
    assert_int_equal(accept(room, "{\"n\":4}").acceptance, STORE_FULL);
    await_state(room, &second.id, QUEUE_SUCCEEDED);
    const struct store_accepted again = accept(room, "{\"n\":2}");
    assert_int_equal(again.acceptance, STORE_CACHED);
    assert_int_equal(again.state, QUEUE_SUCCEEDED);
}

static void test_restart_goes_on_where_it_was(void **state)
{
    struct room *room = *state;
    const struct store_accepted slow = accept(room, "{\"do\":\"slow\",\"ms\":1500,\"n\":1}");
    const struct store_accepted waiting = accept(room, "{\"n\":2}");
    await_state(room, &slow.id, QUEUE_RUNNING);
    close_queue(room, 0); /* taken back, not ended */
    open_queue(room, 0);
    await_state(room, &slow.id, QUEUE_SUCCEEDED);
    await_state(room, &waiting.id, QUEUE_SUCCEEDED);
}

static void accepted_later(void *context, enum ischia_code code,
                           const struct store_accepted *accepted, const struct ischia_error *err)
{
    (void)err;
    if (code == ISCHIA_OK && accepted->acceptance == STORE_ACCEPTED) wake(context);
}

static void test_draining_accepts_nothing(void **state)
{
    struct room *room = *state;
    int accepted = 0;
    struct ischia_error err;
    const struct store_new what = {
        .case_json = "{\"n\":1}", .warnings_json = "[]", .priority = QUEUE_CLINIC, .client = ""};
    assert_int_equal(queue_accept_later(room->queue, &what, accepted_later, &accepted, &err),
                     ISCHIA_OK);
    queue_drain(room->queue);
    assert_int_equal(queue_accept_later(room->queue, &what, accepted_later, &accepted, &err),
                     ISCHIA_E_STATE);
    close_queue(room, WAIT_MS);
    assert_int_equal(__atomic_load_n(&accepted, __ATOMIC_SEQ_CST), 1); /* its answer came first */
    open_queue(room, 0);
}

/* ------------------------------------------------------------------------------- studies */

static struct uuid accept_study(struct room *room, const char *const *cases, size_t count)
{
    struct ischia_error err = {0};
    struct store_study_accepted accepted = {0};
    struct store_study_point_new point[8] = {0};
    assert_true(count <= 8);
    for (size_t i = 0; i < count; i++) {
        point[i] = (struct store_study_point_new){.cells_json = "[]", .case_json = cases[i]};
        queue_case_key(room->queue, cases[i], point[i].case_key);
    }
    const struct store_study_new what = {
        .name = "s", .columns_json = "[]", .client = "", .count = count, .point = point};
    if (queue_accept_study(room->queue, &what, &accepted, &err) != ISCHIA_OK)
        fail_msg("%s", err.message);
    assert_int_equal(accepted.acceptance, STORE_ACCEPTED);
    return accepted.id;
}

static struct store_study study_of(struct room *room, const struct uuid *id)
{
    struct store_study study = {0};
    struct ischia_error err;
    enum store_answer answer;
    assert_int_equal(store_study_get(room->store, id, &study, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    struct store_study counts = study;
    store_study_finish(&study);
    counts.name = counts.columns_json = counts.responses_json = NULL;
    return counts;
}

static void await_points(struct room *room, const struct uuid *id, enum queue_state state,
                         int64_t count)
{
    for (int waited = 0; study_of(room, id).count[state] != count; waited += 5) {
        if (waited > WAIT_MS)
            fail_msg("%lld points %s, not %lld", (long long)study_of(room, id).count[state],
                     queue_state_names[state], (long long)count);
        rest();
    }
}

static void test_points_end_in_all_ways(void **state)
{
    struct room *room = *state;
    static const char *const cases[] = {"{\"n\":7}", "{\"do\":\"diverge\"}", "{\"do\":\"crash\"}",
                                        "{\"n\":8}"};
    const struct uuid id = accept_study(room, cases, 4);
    await_points(room, &id, QUEUE_SUCCEEDED, 2);
    await_points(room, &id, QUEUE_FAILED, 2);
    assert_true(study_of(room, &id).finished_ms > 0);
    await_told(&room->points, 4);
    assert_int_equal(__atomic_load_n(&room->finished, __ATOMIC_SEQ_CST), 0); /* no assessments */
}

/* The only worker is kept by a study; what comes in is solved all the same, and then the study goes
 * on with nothing counted against its point. */
static void test_an_assessment_does_not_wait_for_a_study(void **state)
{
    struct room *room = *state;
    static const char *const cases[] = {"{\"do\":\"slow\",\"ms\":2500,\"n\":1}", "{\"n\":2}"};
    const struct uuid id = accept_study(room, cases, 2);
    await_points(room, &id, QUEUE_RUNNING, 1);
    const struct store_accepted clinic = accept(room, "{\"n\":3}");
    await_state(room, &clinic.id, QUEUE_SUCCEEDED);
    assert_int_equal(study_of(room, &id).count[QUEUE_SUCCEEDED], 0);
    struct pool_stats stats;
    pool_stats(queue_pool(room->queue), &stats);
    assert_int_equal(stats.yielded, 1);
    await_points(room, &id, QUEUE_SUCCEEDED, 2);
    assert_int_equal(stats.died, 0);
}

static void test_a_cancelled_study_stops(void **state)
{
    struct room *room = *state;
    static const char *const cases[] = {"{\"do\":\"hang\"}", "{\"n\":2}"};
    struct ischia_error err;
    enum store_answer answer;
    const struct uuid id = accept_study(room, cases, 2);
    await_points(room, &id, QUEUE_RUNNING, 1);
    assert_int_equal(queue_cancel_study(room->queue, &id, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    const struct store_study study = study_of(room, &id);
    assert_int_equal(study.count[QUEUE_CANCELLED], 2);
    assert_true(study.cancelled && study.finished_ms > 0);
    const struct store_accepted next = accept(room, "{\"n\":3}");
    await_state(room, &next.id, QUEUE_SUCCEEDED); /* the worker is free again */
    assert_int_equal(study_of(room, &id).count[QUEUE_CANCELLED], 2);
}

static void test_a_study_survives_a_restart(void **state)
{
    struct room *room = *state;
    static const char *const cases[] = {"{\"do\":\"slow\",\"ms\":1500,\"n\":1}", "{\"n\":2}"};
    const struct uuid id = accept_study(room, cases, 2);
    await_points(room, &id, QUEUE_RUNNING, 1);
    close_queue(room, 0);
    open_queue(room, 0);
    await_points(room, &id, QUEUE_SUCCEEDED, 2);
}

/* Out of descriptors: what is open goes on; what needs a new one waits for better times. */
static void test_out_of_descriptors(void **state)
{
    struct room *room = *state;
    const struct store_accepted warm = accept(room, "{\"n\":1}");
    await_state(room, &warm.id, QUEUE_SUCCEEDED);
    struct rlimit before, none = {3, 0}; /* 0, 1 and 2 are open; poll() asks for one at least */
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    none.rlim_max = before.rlim_max;
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &none), 0);
    const struct store_accepted second = accept(room, "{\"n\":2}");
    await_state(room, &second.id, QUEUE_SUCCEEDED);
    const struct store_accepted crash = accept(room, "{\"do\":\"crash\"}");
    await_state(room, &crash.id, QUEUE_QUEUED); /* its worker died, and no other can start */
    struct pool_stats stats;
    do pool_stats(queue_pool(room->queue), &stats);
    while (stats.died == 0);
    assert_int_equal(state_of(room, &second.id), QUEUE_SUCCEEDED);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
    await_state(room, &crash.id, QUEUE_FAILED);
    const struct store_accepted third = accept(room, "{\"n\":3}");
    await_state(room, &third.id, QUEUE_SUCCEEDED);
}

#define QUEUE_TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        QUEUE_TEST(test_ends_of_all_kinds),
        QUEUE_TEST(test_events_tell_the_whole_story),
        QUEUE_TEST(test_cancel_stops_what_runs_and_what_waits),
        QUEUE_TEST(test_full_queue_and_cache),
        QUEUE_TEST(test_restart_goes_on_where_it_was),
        QUEUE_TEST(test_draining_accepts_nothing),
        QUEUE_TEST(test_points_end_in_all_ways),
        QUEUE_TEST(test_an_assessment_does_not_wait_for_a_study),
        QUEUE_TEST(test_a_cancelled_study_stops),
        QUEUE_TEST(test_a_study_survives_a_restart),
        QUEUE_TEST(test_out_of_descriptors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
