/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What record systems gave and are told, in the store: origins, the outbox, feedback. */
#include "tests/unit/store_room.h"

enum { HOUR_MS = 3600 * 1000 };

static struct store_accepted accept_of(struct store *store, unsigned char number,
                                       const char *reference)
{
    struct store_new what = request(number);
    what.reference = reference;
    what.origin_json = reference == NULL ? NULL : "{\"reference\":\"x\"}";
    return accept(store, &what);
}

static int solve_all(struct store *store)
{
    struct store_claim got = {0};
    int cached, count = 0;
    while (claim(store, &got, &cached) == STORE_DONE) {
        assert_int_equal(succeed(store, &got.id, got.attempt), STORE_DONE);
        free(got.case_json);
        count++;
    }
    return count;
}

static bool next(struct store *store, const char *target, struct store_delivery *ret)
{
    struct ischia_error err = {0};
    enum store_answer answer = STORE_ANSWER_COUNT;
    int64_t due_ms = -1;
    expect_ok(store_outbox_next(store, target, clock_ms, ret, &due_ms, &answer, &err), &err);
    return answer == STORE_DONE;
}

#define OK(call) expect_ok((call), &err)

static void test_each_end_is_a_row_until_it_is_confirmed(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    struct store_delivery row = {0}, same = {0};
    (void)accept_of(room->store, 1, NULL);
    solve_all(room->store);
    OK(store_outbox_open(room->store, "a", &err)); /* what ended before is not for it */
    const struct store_accepted second = accept_of(room->store, 2, NULL);
    OK(store_outbox_fill(room->store, "a", &err));
    assert_false(next(room->store, "a", &row)); /* not ended yet */
    solve_all(room->store);
    OK(store_outbox_fill(room->store, "a", &err));
    OK(store_outbox_fill(room->store, "a", &err)); /* not twice */
    assert_true(next(room->store, "a", &row));
    assert_true(uuid_equal(&row.id, &second.id));
    assert_int_equal(row.kind, STORE_CHANGE_SUCCEEDED);
    assert_false(next(room->store, "b", &same));
    store_close(room->store);
    open_room(room); /* a restart changes nothing */
    OK(store_outbox_open(room->store, "a", &err));
    assert_true(next(room->store, "a", &same));
    assert_int_equal(same.seq, row.seq);
    OK(store_outbox_done(room->store, row.seq, &err));
    assert_false(next(room->store, "a", &same));
}

static void test_retries_wait_and_end(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    struct store_delivery row = {0};
    int revived = 0;
    OK(store_outbox_open(room->store, "a", &err));
    (void)accept_of(room->store, 1, NULL);
    (void)accept_of(room->store, 2, NULL);
    solve_all(room->store);
    OK(store_outbox_fill(room->store, "a", &err));
    assert_true(next(room->store, "a", &row));
    const int64_t first = row.seq;
    OK(store_outbox_retry(room->store, row.seq, clock_ms + HOUR_MS, false, "down", &err));
    assert_true(next(room->store, "a", &row)); /* the other one goes on */
    assert_true(row.seq != first);
    OK(store_outbox_done(room->store, row.seq, &err));
    assert_false(next(room->store, "a", &row));
    clock_ms += HOUR_MS;
    assert_true(next(room->store, "a", &row));
    assert_int_equal(row.attempts, 1);
    OK(store_outbox_retry(room->store, row.seq, clock_ms, true, "gone", &err));
    assert_false(next(room->store, "a", &row));
    OK(store_outbox_revive(room->store, &revived, &err));
    assert_int_equal(revived, 1);
    assert_true(next(room->store, "a", &row));
    assert_int_equal(row.attempts, 2);
    OK(store_outbox_close(room->store, "a", &err));
    assert_false(next(room->store, "a", &row));
}

static bool count_feedback(void *context, const struct store_feedback *row)
{
    assert_string_equal(row->document, "{\"outcome\":\"accepted\"}");
    ++*(int *)context;
    return true;
}

static void test_erasing_takes_everything_along(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    struct store_delivery row = {0};
    enum store_answer answer;
    int count = 0;
    OK(store_outbox_open(room->store, "a", &err));
    const struct store_accepted accepted = accept_of(room->store, 1, "Patient/SECRET-9");
    solve_all(room->store);
    OK(store_outbox_fill(room->store, "a", &err));
    const struct store_feedback feedback = {
        .service = "s", .card = accepted.id, .document = "{\"outcome\":\"accepted\"}"};
    OK(store_feedback_add(room->store, &feedback, 1, &err));
    OK(store_feedback_list(room->store, count_feedback, &count, &err));
    assert_int_equal(count, 1);
    OK(store_erase(room->store, &accepted.id, &answer, &err));
    assert_int_equal(answer, STORE_DONE);
    assert_false(next(room->store, "a", &row));
    OK(store_feedback_list(room->store, count_feedback, &count, &err));
    assert_int_equal(count, 1);
    if (test_server() != NULL) return; /* the bytes are the server's: docs/INVARIANTS.md, I11 */
    store_close(room->store);
    char path[256], *bytes = NULL;
    (void)snprintf(path, sizeof path, "%s/ischia.sqlite", room->path);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    (void)fseek(file, 0, SEEK_END);
    const size_t size = (size_t)ftell(file);
    bytes = malloc(size);
    assert_non_null(bytes);
    (void)fseek(file, 0, SEEK_SET);
    assert_int_equal(fread(bytes, 1, size, file), size);
    (void)fclose(file);
    assert_null(memmem(bytes, size, "SECRET-9", 8)); /* the bytes too */
    free(bytes);
    open_room(room);
}

struct listed {
    struct uuid id[8];
    int count;
};

static bool keep(void *context, const struct store_assessment *row)
{
    struct listed *listed = context;
    listed->id[listed->count++] = row->id;
    return true;
}

static int list(struct store *store, struct store_filter filter)
{
    struct ischia_error err = {0};
    struct listed listed = {.count = 0};
    char cursor[STORE_CURSOR_BYTES];
    filter.limit = 8;
    OK(store_list(store, &filter, keep, &listed, cursor, &err));
    return listed.count;
}

static void test_searching_by_person_state_and_time(void **state)
{
    struct room *room = *state;
    struct store *store = room->store;
    const struct store_accepted one = accept_of(store, 1, "Patient/1");
    struct store_assessment a = get(store, &one.id);
    assert_string_equal(a.origin_json, "{\"reference\":\"x\"}");
    store_assessment_finish(&a);
    const int64_t begun_ms = clock_ms;
    clock_ms += HOUR_MS;
    solve_all(store);
    clock_ms += HOUR_MS;
    (void)accept_of(store, 2, NULL);
    assert_int_equal(list(store, (struct store_filter){.id = &one.id}), 1);
    assert_int_equal(list(store, (struct store_filter){.id = &one.id, .person = {"P-018", NULL}}),
                     0);
    assert_int_equal(
        list(store, (struct store_filter){.id = &one.id, .states = 1U << QUEUE_QUEUED}), 0);
    assert_int_equal(list(store, (struct store_filter){.id = &one.id,
                                                       .person = {"x", "Patient/1"},
                                                       .finished_from_ms = begun_ms}),
                     1);
    assert_int_equal(list(store, (struct store_filter){.person = {"nobody", "Patient/1"}}), 1);
    assert_int_equal(list(store, (struct store_filter){.person = {"P-017", "Patient/2"}}), 2);
    assert_int_equal(list(store, (struct store_filter){.person = {"nobody", "Patient/2"}}), 0);
    assert_int_equal(list(store, (struct store_filter){.states = 1U << QUEUE_SUCCEEDED}), 1);
    assert_int_equal(list(store, (struct store_filter){.states = 3U << QUEUE_QUEUED}), 1);
    assert_int_equal(list(store, (struct store_filter){.finished_from_ms = begun_ms + HOUR_MS}), 1);
    assert_int_equal(list(store, (struct store_filter){.finished_from_ms = begun_ms + HOUR_MS + 1}),
                     0);
    /* the second has not ended: no bound on its end fits it */
    assert_int_equal(list(store, (struct store_filter){.finished_before_ms = INT64_MAX}), 1);
    assert_int_equal(list(store, (struct store_filter){.finished_before_ms = 1}), 0);
    assert_int_equal(
        list(store, (struct store_filter){.changed_before_ms = begun_ms + 2 * HOUR_MS}), 1);
    assert_int_equal(list(store, (struct store_filter){.changed_from_ms = begun_ms + 2 * HOUR_MS}),
                     1);
    assert_int_equal(list(store, (struct store_filter){.changed_from_ms = 1}), 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        STORE_TEST(test_each_end_is_a_row_until_it_is_confirmed),
        STORE_TEST(test_retries_wait_and_end),
        STORE_TEST(test_erasing_takes_everything_along),
        STORE_TEST(test_searching_by_person_state_and_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
