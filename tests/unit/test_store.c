/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The life of an assessment in the store: what is promised in store.h, one test each. */
#include <pthread.h>

#include "tests/unit/store_room.h"

static void test_accepted_is_kept_over_a_restart(void **state)
{
    struct room *room = *state;
    const struct store_new what = request(1);
    const struct store_accepted accepted = accept(room->store, &what);
    assert_int_equal(accepted.acceptance, STORE_ACCEPTED);
    assert_int_equal(accepted.queued, 1);
    store_close(room->store);
    open_room(room);
    struct store_assessment a = get(room->store, &accepted.id);
    assert_int_equal(a.state, QUEUE_QUEUED);
    assert_string_equal(a.subject, "P-017");
    assert_string_equal(a.side, "left");
    assert_null(a.label);
    assert_string_equal(a.case_json, "{\"R1\":7.1}");
    assert_int_equal(a.created_ms, clock_ms);
    store_assessment_finish(&a);
}

static void test_unknown_is_not_found(void **state)
{
    struct room *room = *state;
    const struct uuid nobody = {{1}};
    struct store_assessment a;
    struct ischia_error err;
    enum store_answer answer;
    enum queue_state was;
    unsigned char *bytes;
    size_t size;
    assert_int_equal(store_get(room->store, &nobody, &a, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_NOT_FOUND);
    assert_int_equal(store_get_field(room->store, &nobody, &bytes, &size, &answer, &err),
                     ISCHIA_OK);
    assert_int_equal(answer, STORE_NOT_FOUND);
    assert_int_equal(store_cancel(room->store, &nobody, &was, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_NOT_FOUND);
    assert_int_equal(store_erase(room->store, &nobody, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_NOT_FOUND);
    assert_int_equal(succeed(room->store, &nobody, 1), STORE_NOT_FOUND);
}

static void test_finished_exactly_once(void **state)
{
    struct room *room = *state;
    const struct store_new what = request(1);
    const struct store_accepted accepted = accept(room->store, &what);
    assert_int_equal(succeed(room->store, &accepted.id, 0), STORE_CONFLICT); /* not running */
    const struct store_claim claimed = claim_one(room->store);
    assert_true(uuid_equal(&claimed.id, &accepted.id));
    assert_int_equal(succeed(room->store, &accepted.id, claimed.attempt + 1), STORE_CONFLICT);
    assert_int_equal(succeed(room->store, &accepted.id, claimed.attempt), STORE_DONE);
    assert_int_equal(succeed(room->store, &accepted.id, claimed.attempt), STORE_CONFLICT);
    struct ischia_error err;
    enum store_answer answer;
    assert_int_equal(store_fail(room->store, &accepted.id, claimed.attempt, "{}", &answer, &err),
                     ISCHIA_OK);
    assert_int_equal(answer, STORE_CONFLICT);
    struct store_assessment a = get(room->store, &accepted.id);
    assert_int_equal(a.state, QUEUE_SUCCEEDED);
    assert_string_equal(a.result_json, "{\"strain\":{}}");
    assert_null(a.problem_json);
    assert_true(a.has_field);
    store_assessment_finish(&a);
    unsigned char *bytes = NULL;
    size_t size = 0;
    assert_int_equal(store_get_field(room->store, &accepted.id, &bytes, &size, &answer, &err),
                     ISCHIA_OK);
    assert_int_equal(size, 5);
    assert_memory_equal(bytes, "field", 5);
    free(bytes);
}

static void test_stale_attempt_is_fenced_off(void **state)
{
    struct room *room = *state;
    const struct store_new what = request(1);
    (void)accept(room->store, &what);
    const struct store_claim first = claim_one(room->store);
    struct ischia_error err;
    enum store_answer answer;
    assert_int_equal(store_requeue(room->store, &first.id, first.attempt, true, &answer, &err),
                     ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    const struct store_claim second = claim_one(room->store);
    assert_int_equal(second.attempt, first.attempt + 1);
    assert_int_equal(second.crashes, 1);
    assert_int_equal(succeed(room->store, &first.id, first.attempt), STORE_CONFLICT);
    assert_int_equal(succeed(room->store, &first.id, second.attempt), STORE_DONE);
}

static void test_recovery_requeues_what_ran(void **state)
{
    struct room *room = *state;
    for (unsigned char i = 1; i <= 3; i++) {
        const struct store_new what = request(i);
        (void)accept(room->store, &what);
    }
    const struct store_claim a = claim_one(room->store);
    const struct store_claim b = claim_one(room->store);
    struct ischia_error err;
    int requeued = 0;
    store_close(room->store); /* on a server, what a living daemon runs stays its own */
    open_room(room);
    assert_int_equal(store_recover(room->store, &requeued, &err), ISCHIA_OK);
    assert_int_equal(requeued, 2);
    assert_int_equal(state_of(room->store, &a.id), QUEUE_QUEUED);
    assert_int_equal(state_of(room->store, &b.id), QUEUE_QUEUED);
    const struct store_claim again = claim_one(room->store);
    assert_true(uuid_equal(&again.id, &a.id)); /* keeps its place */
    assert_int_equal(again.attempt, 2);
    assert_int_equal(again.crashes, 0); /* a restart is not the job's fault */
}

static void test_clinic_goes_before_study(void **state)
{
    struct room *room = *state;
    struct store_new study = request(1), clinic = request(2);
    study.priority = QUEUE_STUDY;
    const struct store_accepted first = accept(room->store, &study);
    const struct store_accepted second = accept(room->store, &clinic);
    const struct store_claim got = claim_one(room->store);
    assert_true(uuid_equal(&got.id, &second.id));
    const struct store_claim then = claim_one(room->store);
    assert_true(uuid_equal(&then.id, &first.id));
    struct store_claim none;
    int cached;
    assert_int_equal(claim(room->store, &none, &cached), STORE_NOT_FOUND);
}

static void test_idempotency_key(void **state)
{
    struct room *room = *state;
    struct store_new what = request(1);
    what.idempotency_key = "k-1";
    what.body_digest[0] = 7;
    const struct store_accepted first = accept(room->store, &what);
    struct store_accepted again = accept(room->store, &what);
    assert_int_equal(again.acceptance, STORE_REPLAYED);
    assert_true(uuid_equal(&again.id, &first.id));
    what.body_digest[0] = 8;
    assert_int_equal(accept(room->store, &what).acceptance, STORE_KEY_CONFLICT);
    what.client = "another";
    assert_int_equal(accept(room->store, &what).acceptance, STORE_ACCEPTED);
    what.client = "";
    clock_ms += STORE_IDEMPOTENCY_MS - 1;
    assert_int_equal(accept(room->store, &what).acceptance, STORE_KEY_CONFLICT);
    clock_ms += 1;
    again = accept(room->store, &what); /* 24 h later the key is free */
    assert_int_equal(again.acceptance, STORE_ACCEPTED);
    assert_false(uuid_equal(&again.id, &first.id));
}

static void test_full_queue_refuses(void **state)
{
    struct room *room = *state;
    struct store_new what = request(1);
    what.queued_max = 2;
    assert_int_equal(accept(room->store, &what).acceptance, STORE_ACCEPTED);
    assert_int_equal(accept(room->store, &what).acceptance, STORE_ACCEPTED);
    const struct store_accepted full = accept(room->store, &what);
    assert_int_equal(full.acceptance, STORE_FULL);
    assert_int_equal(full.queued, 2);
    (void)claim_one(room->store);
    assert_int_equal(accept(room->store, &what).acceptance, STORE_ACCEPTED);
}

static void test_equal_case_is_taken_from_the_cache(void **state)
{
    struct room *room = *state;
    const struct store_new what = request(1);
    const struct store_accepted first = accept(room->store, &what);
    const struct store_accepted waiting = accept(room->store, &what);
    const struct store_claim claimed = claim_one(room->store);
    assert_int_equal(succeed(room->store, &first.id, claimed.attempt), STORE_DONE);

    const struct store_accepted cached = accept(room->store, &what); /* solved: at once */
    assert_int_equal(cached.acceptance, STORE_CACHED);
    assert_int_equal(cached.state, QUEUE_SUCCEEDED);
    struct store_claim none;
    int finished = 0;
    assert_int_equal(claim(room->store, &none, &finished), STORE_NOT_FOUND);
    assert_int_equal(finished, 1); /* queued before it was solved: on the way */
    assert_int_equal(state_of(room->store, &waiting.id), QUEUE_SUCCEEDED);
    struct store_assessment a = get(room->store, &waiting.id);
    assert_true(a.cached);
    assert_string_equal(a.result_json, "{\"strain\":{}}");
    store_assessment_finish(&a);

    struct ischia_error err;
    enum store_answer answer;
    const struct uuid *const all[] = {&first.id, &waiting.id, &cached.id};
    for (int i = 0; i < 2; i++) { /* the result lives as long as one of them does */
        assert_int_equal(store_erase(room->store, all[i], &answer, &err), ISCHIA_OK);
        assert_int_equal(answer, STORE_DONE);
        assert_int_equal(state_of(room->store, &cached.id), QUEUE_SUCCEEDED);
    }
    assert_int_equal(store_erase(room->store, all[2], &answer, &err), ISCHIA_OK);
    assert_int_equal(accept(room->store, &what).acceptance, STORE_ACCEPTED);
}

static void test_cancel(void **state)
{
    struct room *room = *state;
    const struct store_new one = request(1), two = request(2);
    const struct store_accepted queued = accept(room->store, &one);
    struct ischia_error err;
    enum store_answer answer;
    enum queue_state was;
    assert_int_equal(store_cancel(room->store, &queued.id, &was, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    assert_int_equal(was, QUEUE_QUEUED);
    const struct store_accepted running = accept(room->store, &two);
    const struct store_claim claimed = claim_one(room->store);
    assert_true(uuid_equal(&claimed.id, &running.id));
    assert_int_equal(store_cancel(room->store, &running.id, &was, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    assert_int_equal(was, QUEUE_RUNNING);
    assert_int_equal(succeed(room->store, &running.id, claimed.attempt), STORE_CONFLICT);
    assert_int_equal(state_of(room->store, &running.id), QUEUE_CANCELLED);
    assert_int_equal(store_cancel(room->store, &running.id, &was, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_CONFLICT);
    assert_int_equal(was, QUEUE_CANCELLED);
}

/* True when the file's bytes hold the text. */
static bool file_holds(const char *path, const char *text)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL) return false;
    bool held = false;
    const size_t length = strlen(text);
    size_t matched = 0;
    for (int c; !held && (c = fgetc(file)) != EOF;) {
        matched = c == text[matched] ? matched + 1 : (c == text[0] ? 1 : 0);
        held = matched == length;
    }
    (void)fclose(file);
    return held;
}

static bool store_holds(const struct room *room, const char *text)
{
    static const char *const names[] = {"ischia.sqlite", "ischia.sqlite-wal"};
    bool held = false;
    for (int i = 0; i < 2; i++) {
        char path[256];
        (void)snprintf(path, sizeof path, "%s/%s", room->path, names[i]);
        held |= file_holds(path, text);
    }
    return held;
}

static void test_erased_leaves_no_byte(void **state)
{
    struct room *room = *state;
    if (test_server() != NULL) return; /* the bytes are the server's: docs/INVARIANTS.md, I11 */
    struct store_new what = request(1);
    what.subject = "SECRET-SUBJECT";
    what.label = "SECRET-LABEL";
    what.idempotency_key = "SECRET-KEY";
    const struct store_accepted accepted = accept(room->store, &what);
    const struct store_claim claimed = claim_one(room->store);
    struct ischia_error err;
    enum store_answer answer;
    assert_int_equal(store_erase(room->store, &accepted.id, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_CONFLICT); /* it runs */
    assert_int_equal(store_succeed(room->store, &accepted.id, claimed.attempt,
                                   "{\"x\":\"SECRET-RESULT\"}",
                                   (const unsigned char *)"SECRET-FIELD", 12, &answer, &err),
                     ISCHIA_OK);
    assert_true(store_holds(room, "SECRET-SUBJECT"));
    assert_true(store_holds(room, "SECRET-FIELD"));
    assert_int_equal(store_erase(room->store, &accepted.id, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    assert_false(store_holds(room, "SECRET"));
    struct store_assessment a;
    assert_int_equal(store_get(room->store, &accepted.id, &a, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_NOT_FOUND);
}

struct page {
    int count;
    struct uuid id[64];
};

static bool add_to_page(void *context, const struct store_assessment *row)
{
    struct page *page = context;
    assert_null(row->result_json);
    assert_non_null(row->case_json);
    page->id[page->count++] = row->id;
    return true;
}

static void test_listing_pages_newest_first(void **state)
{
    struct room *room = *state;
    struct uuid id[7];
    for (unsigned char i = 0; i < 7; i++) {
        struct store_new what = request(i);
        what.subject = i % 2 == 0 ? "even" : "odd";
        id[i] = accept(room->store, &what).id;
    }
    struct ischia_error err;
    struct page page = {0};
    char cursor[STORE_CURSOR_BYTES];
    struct store_filter filter = {.limit = 3};
    assert_int_equal(store_list(room->store, &filter, add_to_page, &page, cursor, &err), ISCHIA_OK);
    assert_int_equal(page.count, 3);
    assert_true(uuid_equal(&page.id[0], &id[6]));
    const struct store_new late = request(99);
    (void)accept(room->store, &late); /* does not shift what follows */
    filter.cursor = cursor;
    while (cursor[0] != '\0')
        assert_int_equal(store_list(room->store, &filter, add_to_page, &page, cursor, &err),
                         ISCHIA_OK);
    assert_int_equal(page.count, 7);
    for (int i = 0; i < 7; i++) assert_true(uuid_equal(&page.id[i], &id[6 - i]));

    page.count = 0;
    filter = (struct store_filter){
        .limit = 4, .subject = "even", .side = "left", .by_state = true, .state = QUEUE_QUEUED};
    assert_int_equal(store_list(room->store, &filter, add_to_page, &page, cursor, &err), ISCHIA_OK);
    assert_int_equal(page.count, 4);
    assert_string_equal(cursor, ""); /* exactly a page: no empty one after it */
    filter.side = "right";
    page.count = 0;
    assert_int_equal(store_list(room->store, &filter, add_to_page, &page, cursor, &err), ISCHIA_OK);
    assert_int_equal(page.count, 0);
}

static void test_foreign_cursors_are_refused(void **state)
{
    struct room *room = *state;
    static const char *const bad[] = {"",
                                      "c",
                                      "c0",
                                      "x12",
                                      "cXYZ",
                                      "c-1",
                                      "12",
                                      "c1 ",
                                      "cffffffffffffffff",
                                      "c11111111111111111"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct ischia_error err;
        struct page page = {0};
        char cursor[STORE_CURSOR_BYTES];
        const struct store_filter filter = {.limit = 3, .cursor = bad[i]};
        assert_int_equal(store_list(room->store, &filter, add_to_page, &page, cursor, &err),
                         ISCHIA_E_INPUT);
    }
}

struct seen {
    int count;
    int64_t last;
    enum store_change_kind kind[32];
};

static bool see_change(void *context, const struct store_change *change)
{
    struct seen *seen = context;
    assert_true(change->seq > seen->last);
    seen->last = change->seq;
    seen->kind[seen->count++] = change->kind;
    return true;
}

static void test_changes_in_order(void **state)
{
    struct room *room = *state;
    const struct store_new what = request(1);
    const struct store_accepted accepted = accept(room->store, &what);
    const struct store_claim claimed = claim_one(room->store);
    assert_int_equal(succeed(room->store, &accepted.id, claimed.attempt), STORE_DONE);
    struct ischia_error err;
    enum store_answer answer;
    assert_int_equal(store_erase(room->store, &accepted.id, &answer, &err), ISCHIA_OK);
    struct seen seen = {0};
    int64_t last = 0;
    assert_int_equal(store_changes(room->store, 0, 2, see_change, &seen, &last, &err), ISCHIA_OK);
    assert_int_equal(seen.count, 2);
    assert_int_equal(store_changes(room->store, seen.last, 500, see_change, &seen, &last, &err),
                     ISCHIA_OK);
    assert_int_equal(seen.count, 4);
    assert_int_equal(seen.last, last);
    static const enum store_change_kind expected[] = {STORE_CHANGE_CREATED, STORE_CHANGE_STARTED,
                                                      STORE_CHANGE_SUCCEEDED, STORE_CHANGE_ERASED};
    for (int i = 0; i < 4; i++) assert_int_equal(seen.kind[i], expected[i]);
}

static void test_retention(void **state)
{
    struct room *room = *state;
    struct uuid id[6];
    for (unsigned char i = 0; i < 6; i++) {
        const struct store_new what = request(i);
        id[i] = accept(room->store, &what).id;
        clock_ms += 1000;
        if (i == 5) continue; /* the last one stays queued: never retired */
        const struct store_claim claimed = claim_one(room->store);
        assert_int_equal(succeed(room->store, &id[i], claimed.attempt), STORE_DONE);
    }
    struct ischia_error err;
    int erased = -1;
    const struct store_retention keep = {0};
    assert_int_equal(store_retire(room->store, &keep, 10, &erased, &err), ISCHIA_OK);
    assert_int_equal(erased, 0);
    const struct store_retention count = {.count_max = 3};
    assert_int_equal(store_retire(room->store, &count, 1, &erased, &err), ISCHIA_OK);
    assert_int_equal(erased, 1);
    assert_int_equal(store_retire(room->store, &count, 10, &erased, &err), ISCHIA_OK);
    assert_int_equal(erased, 1);
    clock_ms += 1;
    const struct store_retention age = {.age_max_ms = 2500};
    assert_int_equal(store_retire(room->store, &age, 10, &erased, &err), ISCHIA_OK);
    assert_int_equal(erased, 1);
    struct store_stats stats;
    assert_int_equal(store_stats(room->store, &stats, &err), ISCHIA_OK);
    assert_int_equal(stats.count[QUEUE_SUCCEEDED], 2);
    assert_int_equal(stats.count[QUEUE_QUEUED], 1);
    assert_int_equal(state_of(room->store, &id[3]), QUEUE_SUCCEEDED);
}

static void test_stats_count_states(void **state)
{
    struct room *room = *state;
    struct store_stats stats;
    struct ischia_error err;
    assert_int_equal(store_stats(room->store, &stats, &err), ISCHIA_OK);
    assert_int_equal(stats.oldest_queued_ms, 0);
    const int64_t first_ms = clock_ms;
    for (unsigned char i = 0; i < 3; i++) {
        const struct store_new what = request(i);
        (void)accept(room->store, &what);
        clock_ms += 10;
    }
    assert_int_equal(store_stats(room->store, &stats, &err), ISCHIA_OK);
    assert_int_equal(stats.count[QUEUE_QUEUED], 3);
    assert_int_equal(stats.oldest_queued_ms, first_ms);
    (void)claim_one(room->store);
    assert_int_equal(store_stats(room->store, &stats, &err), ISCHIA_OK);
    assert_int_equal(stats.count[QUEUE_QUEUED], 2);
    assert_int_equal(stats.count[QUEUE_RUNNING], 1);
    assert_int_equal(stats.oldest_queued_ms, first_ms + 10);
    assert_true(stats.size_bytes > 4096);
    uint64_t latencies = 0;
    for (int i = 0; i < STORE_LATENCY_BUCKETS; i++) latencies += stats.latency_count[i];
    assert_int_equal(latencies, stats.writes);
}

enum { THREADS = 8, EACH = 50 };

static void *accept_many(void *argument)
{
    struct room *room = argument;
    for (int i = 0; i < EACH; i++) {
        struct store_new what = request((unsigned char)i);
        struct store_accepted accepted;
        struct ischia_error err;
        if (store_accept(room->store, &what, &accepted, &err) != ISCHIA_OK) return argument;
    }
    return NULL;
}

static void later_done(void *context, enum ischia_code code, const struct store_accepted *accepted,
                       const struct ischia_error *err)
{
    (void)err;
    if (code == ISCHIA_OK && accepted->acceptance == STORE_ACCEPTED)
        (void)__atomic_add_fetch((int *)context, 1, __ATOMIC_SEQ_CST);
}

static void test_writers_share_commits(void **state)
{
    struct room *room = *state;
    pthread_t thread[THREADS];
    int later = 0;
    struct ischia_error err;
    for (int i = 0; i < EACH; i++) {
        char subject[16];
        struct store_new what = request(1);
        (void)snprintf(subject, sizeof subject, "s%d", i);
        what.subject = subject; /* must have been copied */
        assert_int_equal(store_accept_later(room->store, &what, later_done, &later, &err),
                         ISCHIA_OK);
    }
    for (int i = 0; i < THREADS; i++)
        assert_int_equal(pthread_create(&thread[i], NULL, accept_many, room), 0);
    for (int i = 0; i < THREADS; i++) {
        void *failed;
        assert_int_equal(pthread_join(thread[i], &failed), 0);
        assert_null(failed);
    }
    struct store_stats stats;
    assert_int_equal(store_probe(room->store, &err), ISCHIA_OK);
    assert_int_equal(store_stats(room->store, &stats, &err), ISCHIA_OK);
    assert_int_equal(stats.count[QUEUE_QUEUED], THREADS * EACH + EACH);
    assert_int_equal(__atomic_load_n(&later, __ATOMIC_SEQ_CST), EACH);
    assert_true(stats.commits < stats.writes);
    assert_int_equal(stats.write_failures, 0);
}

static bool count_token(void *context, const struct store_token *token)
{
    assert_string_equal(token->name, "scanner");
    ++*(int *)context;
    return true;
}

static void test_tokens(void **state)
{
    struct room *room = *state;
    struct ischia_error err;
    enum store_answer answer;
    int64_t before = -1, after = -1;
    struct store_token token = {.id = "t1", .name = "scanner", .scopes = 3, .expires_ms = 99};
    token.digest[31] = 9;
    assert_int_equal(store_token_epoch(room->store, &before, &err), ISCHIA_OK);
    assert_int_equal(store_token_add(room->store, &token, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    assert_int_equal(store_token_add(room->store, &token, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_CONFLICT);
    assert_int_equal(store_token_epoch(room->store, &after, &err), ISCHIA_OK);
    assert_int_equal(after, before + 1);
    struct store_token got;
    assert_int_equal(store_token_get(room->store, "t1", &got, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    assert_int_equal(got.scopes, 3);
    assert_int_equal(got.expires_ms, 99);
    assert_int_equal(got.created_ms, clock_ms);
    assert_int_equal(got.revoked_ms, 0);
    assert_int_equal(got.digest[31], 9);
    assert_int_equal(store_token_revoke(room->store, "t1", &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_DONE);
    assert_int_equal(store_token_revoke(room->store, "t1", &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_CONFLICT);
    assert_int_equal(store_token_revoke(room->store, "t2", &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_NOT_FOUND);
    assert_int_equal(store_token_get(room->store, "t1", &got, &answer, &err), ISCHIA_OK);
    assert_int_equal(got.revoked_ms, clock_ms);
    int count = 0;
    assert_int_equal(store_token_list(room->store, count_token, &count, &err), ISCHIA_OK);
    assert_int_equal(count, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        STORE_TEST(test_accepted_is_kept_over_a_restart),
        STORE_TEST(test_unknown_is_not_found),
        STORE_TEST(test_finished_exactly_once),
        STORE_TEST(test_stale_attempt_is_fenced_off),
        STORE_TEST(test_recovery_requeues_what_ran),
        STORE_TEST(test_clinic_goes_before_study),
        STORE_TEST(test_idempotency_key),
        STORE_TEST(test_full_queue_refuses),
        STORE_TEST(test_equal_case_is_taken_from_the_cache),
        STORE_TEST(test_cancel),
        STORE_TEST(test_erased_leaves_no_byte),
        STORE_TEST(test_listing_pages_newest_first),
        STORE_TEST(test_foreign_cursors_are_refused),
        STORE_TEST(test_changes_in_order),
        STORE_TEST(test_retention),
        STORE_TEST(test_stats_count_states),
        STORE_TEST(test_writers_share_commits),
        STORE_TEST(test_tokens),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
