/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Studies in the store: points are solved once, by one attempt, and found again after a restart. */
#include "tests/unit/store_room.h"

#include "server/store/studies.h"

#define OK(call) expect_ok((call), &err)
enum { POINTS = 3 };

static struct store_study_point_new point_of(unsigned char number, const char *problem_json)
{
    struct store_study_point_new point = {.cells_json = "[\"1\"]", .problem_json = problem_json};
    if (problem_json == NULL) point.case_json = "{\"R1\":7.1}";
    point.case_key[0] = number;
    return point;
}

/* Three points whose cases are first, first + 1 and one that is refused. */
static struct store_study_accepted accept_study(struct store *store, unsigned char first,
                                                const char *key, int64_t waiting_max)
{
    struct ischia_error err = {0};
    struct store_study_accepted accepted = {0};
    const struct store_study_point_new point[POINTS] = {
        point_of(first, NULL), point_of((unsigned char)(first + 1), NULL), point_of(0, "{}")};
    const struct store_study_new what = {.name = "table1",
                                         .columns_json = "[\"row\"]",
                                         .responses_json = "[\"eps_max\"]",
                                         .client = "t1",
                                         .idempotency_key = key,
                                         .body_digest = {first},
                                         .waiting_max = waiting_max,
                                         .count = POINTS,
                                         .point = point};
    OK(store_study_accept(store, &what, &accepted, &err));
    return accepted;
}

static struct store_study get_study(struct store *store, const struct uuid *id)
{
    struct ischia_error err = {0};
    struct store_study study = {0};
    enum store_answer answer = STORE_ANSWER_COUNT;
    OK(store_study_get(store, id, &study, &answer, &err));
    assert_int_equal(answer, STORE_DONE);
    return study;
}

static int64_t count_of(struct store *store, const struct uuid *id, enum queue_state state)
{
    struct store_study study = get_study(store, id);
    const int64_t count = study.count[state];
    store_study_finish(&study);
    return count;
}

/* line 0: nothing was left. */
static struct store_study_claim claim_point(struct store *store)
{
    struct ischia_error err = {0};
    struct store_study_claim claim = {0};
    enum store_answer answer = STORE_ANSWER_COUNT;
    OK(store_study_claim_next(store, &claim, &answer, &err));
    assert_int_equal(answer == STORE_DONE, claim.line != 0);
    free(claim.case_json);
    claim.case_json = NULL;
    return claim;
}

static enum store_answer settle(struct store *store, const struct store_study_claim *claim,
                                enum queue_state to)
{
    struct ischia_error err = {0};
    enum store_answer answer = STORE_ANSWER_COUNT;
    const char *outcome = to == QUEUE_QUEUED ? NULL : "{\"strain\":{}}";
    OK(store_study_settle(store, &claim->study, claim->line, claim->attempt, to, outcome,
                          to == QUEUE_QUEUED, &answer, &err));
    return answer;
}

static void test_a_study_is_solved_point_by_point(void **state)
{
    struct room *room = *state;
    const struct uuid id = accept_study(room->store, 1, NULL, 0).id;
    struct store_study study = get_study(room->store, &id);
    assert_string_equal(study.name, "table1");
    assert_string_equal(study.responses_json, "[\"eps_max\"]");
    assert_int_equal(study.count[QUEUE_QUEUED], 2);
    assert_int_equal(study.refused, 1);
    assert_true(study.started_ms == 0 && study.finished_ms == 0);
    store_study_finish(&study);
    const struct store_study_claim first = claim_point(room->store);
    const struct store_study_claim second = claim_point(room->store);
    assert_true(first.line == 1 && second.line == 2);
    assert_int_equal(claim_point(room->store).line, 0);
    assert_int_equal(settle(room->store, &second, QUEUE_FAILED), STORE_DONE);
    assert_int_equal(settle(room->store, &first, QUEUE_SUCCEEDED), STORE_DONE);
    assert_int_equal(settle(room->store, &first, QUEUE_SUCCEEDED), STORE_CONFLICT); /* not twice */
    study = get_study(room->store, &id);
    assert_true(study.count[QUEUE_SUCCEEDED] == 1 && study.count[QUEUE_FAILED] == 1);
    assert_true(study.started_ms > 0 && study.finished_ms > 0 && !study.cancelled);
    store_study_finish(&study);
}

static void test_a_stale_attempt_is_fenced_off(void **state)
{
    struct room *room = *state;
    (void)accept_study(room->store, 1, NULL, 0);
    const struct store_study_claim first = claim_point(room->store);
    assert_int_equal(settle(room->store, &first, QUEUE_QUEUED), STORE_DONE);
    const struct store_study_claim again = claim_point(room->store);
    assert_int_equal(again.line, first.line);
    assert_int_equal(again.attempt, first.attempt + 1);
    assert_int_equal(again.crashes, 1);
    assert_int_equal(settle(room->store, &first, QUEUE_SUCCEEDED), STORE_CONFLICT);
    assert_int_equal(settle(room->store, &again, QUEUE_SUCCEEDED), STORE_DONE);
}

static void test_what_ran_waits_again_after_a_restart(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    int requeued = 0;
    const struct uuid id = accept_study(room->store, 1, NULL, 0).id;
    const struct store_study_claim first = claim_point(room->store);
    store_close(room->store);
    open_room(room);
    OK(store_recover(room->store, &requeued, &err));
    assert_int_equal(count_of(room->store, &id, QUEUE_QUEUED), 2);
    const struct store_study_claim again = claim_point(room->store);
    assert_true(again.line == first.line && again.attempt == first.attempt + 1 &&
                again.crashes == 0);
}

static void test_a_case_that_is_known_is_not_solved_again(void **state)
{
    struct room *room = *state;
    const struct uuid id = accept_study(room->store, 1, NULL, 0).id;
    struct store_new what = request(2); /* the second point's case, asked for by a clinic */
    (void)accept(room->store, &what);
    const struct store_claim clinic = claim_one(room->store);
    assert_int_equal(succeed(room->store, &clinic.id, clinic.attempt), STORE_DONE);
    const struct store_study_claim first = claim_point(room->store);
    assert_int_equal(settle(room->store, &first, QUEUE_SUCCEEDED), STORE_DONE);
    assert_int_equal(claim_point(room->store).line, 0);
    assert_int_equal(count_of(room->store, &id, QUEUE_SUCCEEDED), 2);
    const struct uuid same = accept_study(room->store, 1, NULL, 0).id; /* nothing left to do */
    assert_int_equal(claim_point(room->store).line, 0);
    struct store_study study = get_study(room->store, &same);
    assert_true(study.count[QUEUE_SUCCEEDED] == 2 && study.finished_ms > 0);
    store_study_finish(&study);
    /* an assessment of a case that only a study has solved has no field yet: it is solved */
    what = request(1);
    assert_int_equal(accept(room->store, &what).acceptance, STORE_ACCEPTED);
}

static void test_cancel_stops_what_waits_and_what_runs(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    enum store_answer answer = STORE_ANSWER_COUNT;
    const struct uuid id = accept_study(room->store, 1, NULL, 0).id, nobody = {{9}};
    const struct store_study_claim first = claim_point(room->store);
    OK(store_study_cancel(room->store, &nobody, &answer, &err));
    assert_int_equal(answer, STORE_NOT_FOUND);
    for (int twice = 0; twice < 2; twice++) {
        OK(store_study_cancel(room->store, &id, &answer, &err));
        assert_int_equal(answer, STORE_DONE);
    }
    assert_int_equal(count_of(room->store, &id, QUEUE_CANCELLED), 2);
    assert_int_equal(settle(room->store, &first, QUEUE_SUCCEEDED), STORE_CONFLICT);
    assert_int_equal(claim_point(room->store).line, 0);
    const struct uuid other = accept_study(room->store, 11, NULL, 0).id;
    for (struct store_study_claim c; (c = claim_point(room->store)).line != 0;)
        assert_int_equal(settle(room->store, &c, QUEUE_SUCCEEDED), STORE_DONE);
    OK(store_study_cancel(room->store, &other, &answer, &err));
    assert_int_equal(answer, STORE_CONFLICT); /* it is over */
}

static void test_too_many_waiting_points_are_refused_whole(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    int64_t waiting = 0;
    assert_int_equal(accept_study(room->store, 1, NULL, 4).acceptance, STORE_ACCEPTED);
    assert_int_equal(accept_study(room->store, 3, NULL, 4).acceptance, STORE_ACCEPTED);
    const struct store_study_accepted third = accept_study(room->store, 5, NULL, 4);
    assert_int_equal(third.acceptance, STORE_FULL);
    assert_int_equal(third.waiting, 4);
    OK(store_study_waiting(room->store, &waiting, &err));
    assert_int_equal(waiting, 4);
}

static void test_a_key_makes_one_study(void **state)
{
    struct room *room = *state;
    const struct store_study_accepted first = accept_study(room->store, 1, "k", 0);
    const struct store_study_accepted again = accept_study(room->store, 1, "k", 0);
    assert_int_equal(again.acceptance, STORE_REPLAYED);
    assert_true(uuid_equal(&first.id, &again.id));
    assert_int_equal(accept_study(room->store, 5, "k", 0).acceptance, STORE_KEY_CONFLICT);
    clock_ms += STORE_IDEMPOTENCY_MS;
    assert_int_equal(accept_study(room->store, 5, "k", 0).acceptance, STORE_ACCEPTED);
}

static bool note_study(void *context, const struct store_study *study)
{
    int64_t *last = context;
    assert_true(*last == 0 || study->seq < *last);
    *last = study->seq;
    return true;
}

static bool count_point(void *context, const struct store_study_point *point)
{
    int64_t *lines = context;
    assert_int_equal(point->line, ++*lines);
    assert_string_equal(point->cells_json, "[\"1\"]");
    assert_true(point->refused == (point->case_json == NULL));
    assert_true(point->refused == (point->outcome_json != NULL)); /* nothing is solved yet */
    return true;
}

static void test_lists_studies_and_points_in_order(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    int64_t last = 0, lines = 0;
    for (unsigned char i = 0; i < 5; i++)
        (void)accept_study(room->store, (unsigned char)(10 * i), NULL, 0);
    const struct uuid id = accept_study(room->store, 99, NULL, 0).id;
    OK(store_study_list(room->store, 0, 4, note_study, &last, &err));
    const int64_t fourth = last;
    OK(store_study_list(room->store, fourth, 4, note_study, &last, &err));
    assert_true(last == fourth - 2);
    assert_int_equal(store_study_list(room->store, 0, 501, note_study, &last, &err),
                     ISCHIA_E_INPUT);
    OK(store_study_points(room->store, &id, count_point, &lines, &err));
    assert_int_equal(lines, POINTS);
}

static void no_changes(struct store *store)
{
    struct ischia_error err = {0};
    struct store_stats stats;
    OK(store_stats(store, &stats, &err));
    for (int i = 0; i < QUEUE_STATE_COUNT; i++) assert_int_equal(stats.count[i], 0);
}

static void test_erasing_takes_all_of_it(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    enum store_answer answer = STORE_ANSWER_COUNT;
    bool erased = true;
    int64_t lines = 0;
    const struct uuid id = accept_study(room->store, 1, NULL, 0).id;
    const struct store_study_claim first = claim_point(room->store);
    OK(store_study_erase(room->store, &id, &answer, &err));
    assert_int_equal(answer, STORE_CONFLICT); /* it runs */
    assert_int_equal(settle(room->store, &first, QUEUE_SUCCEEDED), STORE_DONE);
    OK(store_study_erase(room->store, &id, &answer, &err));
    assert_int_equal(answer, STORE_DONE);
    OK(store_study_points(room->store, &id, count_point, &lines, &err));
    assert_int_equal(lines, 0);
    OK(store_study_erase(room->store, &id, &answer, &err));
    assert_int_equal(answer, STORE_NOT_FOUND);
    const struct uuid old = accept_study(room->store, 1, NULL, 0).id;
    OK(store_study_cancel(room->store, &old, &answer, &err));
    OK(store_study_retire(room->store, 1000, &erased, &err));
    assert_false(erased);
    clock_ms += 2000;
    OK(store_study_retire(room->store, 0, &erased, &err)); /* 0: keep all */
    assert_false(erased);
    OK(store_study_retire(room->store, 1000, &erased, &err));
    assert_true(erased);
    OK(store_study_retire(room->store, 1000, &erased, &err));
    assert_false(erased);
    no_changes(room->store); /* assessments never knew of any of this */
}

#define STORE_TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        STORE_TEST(test_a_study_is_solved_point_by_point),
        STORE_TEST(test_a_stale_attempt_is_fenced_off),
        STORE_TEST(test_what_ran_waits_again_after_a_restart),
        STORE_TEST(test_a_case_that_is_known_is_not_solved_again),
        STORE_TEST(test_cancel_stops_what_waits_and_what_runs),
        STORE_TEST(test_too_many_waiting_points_are_refused_whole),
        STORE_TEST(test_a_key_makes_one_study),
        STORE_TEST(test_lists_studies_and_points_in_order),
        STORE_TEST(test_erasing_takes_all_of_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
