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

/* How many rows fit: of each condition one alternative. */
static int fitting(struct store *store, int count, const struct store_alternative *alternative)
{
    struct ischia_error err = {0};
    struct listed listed = {.count = 0};
    char cursor[STORE_CURSOR_BYTES];
    const struct store_filter filter = {
        .alternative = alternative, .alternative_count = count, .limit = 8};
    OK(store_list(store, &filter, keep, &listed, cursor, &err));
    return listed.count;
}

static int fits(struct store *store, struct store_alternative only)
{
    return fitting(store, 1, &only);
}

/* Both: as conditions of their own, then as alternatives. */
static void check_two(struct store *store, struct store_alternative a, struct store_alternative b,
                      int both, int either)
{
    struct store_alternative two[] = {a, b};
    two[1].condition = 1;
    assert_int_equal(fitting(store, 2, two), both);
    two[1].condition = 0;
    assert_int_equal(fitting(store, 2, two), either);
}

static struct store_alternative person(const char *subject, const char *reference)
{
    return (struct store_alternative){
        .kind = STORE_OF_PERSON, .subject = subject, .reference = reference};
}

static struct store_alternative in_states(unsigned states)
{
    return (struct store_alternative){.kind = STORE_IN_STATES, .states = states};
}

static struct store_alternative times(enum store_alternative_kind kind, int64_t from_ms,
                                      int64_t before_ms)
{
    return (struct store_alternative){.kind = kind, .from_ms = from_ms, .before_ms = before_ms};
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
    const struct store_accepted two = accept_of(store, 2, NULL);
    const struct store_alternative first = {.kind = STORE_HAS_ID, .id = one.id};
    const struct store_alternative second = {.kind = STORE_HAS_ID, .id = two.id};
    const unsigned queued = 1U << QUEUE_QUEUED, succeeded = 1U << QUEUE_SUCCEEDED;
    assert_int_equal(fits(store, first), 1);
    check_two(store, first, second, 0, 2);
    check_two(store, first, person("P-018", "x"), 0, 1);
    check_two(store, first, in_states(queued), 0, 2);
    check_two(store, person("x", "Patient/1"), times(STORE_ENDED, begun_ms, 0), 1, 1);
    assert_int_equal(fits(store, person("nobody", "Patient/1")), 1);
    assert_int_equal(fits(store, person("P-017", "Patient/2")), 2);
    assert_int_equal(fits(store, person("nobody", "Patient/2")), 0);
    check_two(store, person("nobody", "Patient/2"), person("nobody", "Patient/1"), 0, 1);
    assert_int_equal(fits(store, in_states(succeeded)), 1);
    assert_int_equal(fits(store, in_states(3U << QUEUE_QUEUED)), 1);
    check_two(store, in_states(succeeded), in_states(queued), 0, 2);
    assert_int_equal(fits(store, times(STORE_ENDED, begun_ms + HOUR_MS, 0)), 1);
    assert_int_equal(fits(store, times(STORE_ENDED, begun_ms + HOUR_MS + 1, 0)), 0);
    /* the second has not ended: no bound on its end fits it */
    assert_int_equal(fits(store, times(STORE_ENDED, 0, INT64_MAX)), 1);
    assert_int_equal(fits(store, times(STORE_ENDED, 0, 1)), 0);
    assert_int_equal(fits(store, times(STORE_CHANGED, 0, begun_ms + 2 * HOUR_MS)), 1);
    assert_int_equal(fits(store, times(STORE_CHANGED, begun_ms + 2 * HOUR_MS, 0)), 1);
    assert_int_equal(fits(store, times(STORE_CHANGED, 1, 0)), 2);
    check_two(store, times(STORE_CHANGED, 1, 2), times(STORE_ENDED, 1, 0), 0, 1);
}

static void test_a_search_may_have_so_many_values(void **state)
{
    struct room *room = *state;
    struct store_alternative many[STORE_ALTERNATIVES_MAX + 1];
    struct ischia_error err = {0};
    struct listed listed = {.count = 0};
    char cursor[STORE_CURSOR_BYTES];
    (void)accept_of(room->store, 1, "Patient/1");
    for (int i = 0; i <= STORE_ALTERNATIVES_MAX; i++) {
        many[i] = i % 2 == 0 ? person("P-018", "Patient/2") : times(STORE_CHANGED, 1, 2);
        many[i].condition = i / 4;
    }
    many[STORE_ALTERNATIVES_MAX - 1] = person("P-018", "Patient/1");
    assert_int_equal(fitting(room->store, STORE_ALTERNATIVES_MAX, many), 0);
    for (int i = 0; i < STORE_ALTERNATIVES_MAX; i++) many[i].condition = 0;
    assert_int_equal(fitting(room->store, STORE_ALTERNATIVES_MAX, many), 1);
    const struct store_filter filter = {
        .alternative = many, .alternative_count = STORE_ALTERNATIVES_MAX + 1, .limit = 8};
    assert_int_equal(store_list(room->store, &filter, keep, &listed, cursor, &err), ISCHIA_E_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        STORE_TEST(test_each_end_is_a_row_until_it_is_confirmed),
        STORE_TEST(test_retries_wait_and_end),
        STORE_TEST(test_erasing_takes_everything_along),
        STORE_TEST(test_searching_by_person_state_and_time),
        STORE_TEST(test_a_search_may_have_so_many_values),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
