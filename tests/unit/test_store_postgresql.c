/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What only a store on a server has: other daemons, leases, lost connections, another store's rows.
 * Runs under tests/postgresql/cluster.py. */
#include "tests/unit/store_room.h"

#include <time.h>

#include "server/store/studies.h"

#define OK(call) expect_ok((call), &err)
enum { PATIENCE_MS = 60000, TICK_MS = 10 };

/* ---------------------------------------------------------------------------- two daemons */

struct other {
    struct store *store;
    int changes, kinds, cancelled_studies, work, lost, progress;
    int64_t last_seq;
    struct uuid last;
    double fraction;
};

static void on_change(void *context, const struct store_change *change)
{
    struct other *other = context;
    assert_true(change->seq > other->last_seq);
    other->last_seq = change->seq;
    other->last = change->id;
    (void)__atomic_or_fetch(&other->kinds, 1 << change->kind, __ATOMIC_SEQ_CST);
    (void)__atomic_add_fetch(&other->changes, 1, __ATOMIC_SEQ_CST);
}

static void on_progress(void *context, const struct uuid *id, const struct store_progress *progress)
{
    struct other *other = context;
    other->last = *id;
    other->fraction = progress->fraction;
    assert_string_equal(progress->message, "Newton, iteration 3");
    (void)__atomic_add_fetch(&other->progress, 1, __ATOMIC_SEQ_CST);
}

static void on_work(void *context)
{
    (void)__atomic_add_fetch(&((struct other *)context)->work, 1, __ATOMIC_SEQ_CST);
}

static void on_study_cancelled(void *context, const struct uuid *id)
{
    ((struct other *)context)->last = *id;
    (void)__atomic_add_fetch(&((struct other *)context)->cancelled_studies, 1, __ATOMIC_SEQ_CST);
}

static void on_lease_lost(void *context)
{
    (void)__atomic_add_fetch(&((struct other *)context)->lost, 1, __ATOMIC_SEQ_CST);
}

static void watch(struct other *other, struct store *store)
{
    const struct store_watcher watcher = {other,   on_change,          on_progress,
                                          on_work, on_study_cancelled, on_lease_lost};
    store_watch(store, &watcher);
}

static struct other *open_other(void)
{
    struct ischia_error err = {0};
    struct other *other = calloc(1, sizeof *other);
    assert_non_null(other);
    const struct store_options options = {.location = test_server(), .now_ms = fake_now};
    OK(store_open(&options, &other->store, &err));
    watch(other, other->store);
    return other;
}

static void close_other(struct other *other)
{
    store_watch(other->store, NULL);
    store_close(other->store);
    free(other);
}

static void rest(void)
{
    const struct timespec pause = {.tv_nsec = TICK_MS * 1000000L};
    (void)nanosleep(&pause, NULL);
}

static void await(const int *count, int at_least)
{
    for (int ms = 0; __atomic_load_n(count, __ATOMIC_SEQ_CST) < at_least; ms += TICK_MS) {
        assert_true(ms < PATIENCE_MS);
        rest();
    }
}

static void await_state(struct store *store, const struct uuid *id, enum queue_state state)
{
    for (int ms = 0; state_of(store, id) != state; ms += TICK_MS) {
        assert_true(ms < PATIENCE_MS);
        rest();
    }
}

static void test_each_job_goes_to_one_daemon(void **state)
{
    struct room *room = *state;
    struct other *other = open_other();
    struct store_new what = request(1);
    const struct store_accepted first = accept(room->store, &what);
    what = request(2);
    const struct store_accepted second = accept(other->store, &what);
    const struct store_claim here = claim_one(room->store), there = claim_one(other->store);
    assert_true(uuid_equal(&here.id, &first.id));
    assert_true(uuid_equal(&there.id, &second.id));
    assert_int_equal(succeed(other->store, &here.id, here.attempt), STORE_CONFLICT);
    assert_int_equal(succeed(room->store, &here.id, here.attempt), STORE_DONE);
    assert_int_equal(succeed(other->store, &there.id, there.attempt), STORE_DONE);
    close_other(other);
}

static void test_the_others_are_told_in_order(void **state)
{
    struct room *room = *state;
    struct other *other = open_other();
    struct store_new what = request(1);
    rest(); /* the thread looks where the log ends; what came before is nobody's news */
    const struct store_accepted accepted = accept(room->store, &what);
    for (int ms = 0; __atomic_load_n(&other->changes, __ATOMIC_SEQ_CST) == 0 && ms < 2000;
         ms += TICK_MS)
        rest();
    const struct store_claim claimed = claim_one(room->store);
    assert_int_equal(succeed(room->store, &claimed.id, claimed.attempt), STORE_DONE);
    await(&other->changes, 2);
    while ((__atomic_load_n(&other->kinds, __ATOMIC_SEQ_CST) & 1 << STORE_CHANGE_SUCCEEDED) == 0)
        rest();
    assert_true(uuid_equal(&other->last, &accepted.id));
    const int before = other->changes;
    what = request(7);
    (void)accept(other->store, &what); /* its own is no news */
    for (int i = 0; i < 50; i++) rest();
    assert_int_equal(other->changes, before);
    close_other(other);
}

static void test_progress_reaches_the_others(void **state)
{
    struct room *room = *state;
    struct other *other = open_other();
    struct store_new what = request(1);
    const struct store_accepted accepted = accept(room->store, &what);
    await(&other->changes, 0);
    const struct store_progress progress = {0.25, 2, 3, 64.5, "Newton, iteration 3"};
    for (int ms = 0; __atomic_load_n(&other->progress, __ATOMIC_SEQ_CST) == 0; ms += TICK_MS) {
        assert_true(ms < PATIENCE_MS);
        store_tell_progress(room->store, &accepted.id, &progress);
        rest();
    }
    assert_true(uuid_equal(&other->last, &accepted.id));
    assert_true(other->fraction > 0.2499 && other->fraction < 0.2501);
    close_other(other);
}

static void test_a_study_wakes_and_stops_the_others(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    struct other *other = open_other();
    enum store_answer answer = STORE_ANSWER_COUNT;
    struct store_study_accepted accepted = {0};
    const struct store_study_point_new point = {.cells_json = "[]", .case_json = "{}"};
    const struct store_study_new what = {
        .name = "s", .columns_json = "[]", .client = "", .count = 1, .point = &point};
    for (int i = 0; i < 100; i++) rest(); /* it listens by now */
    OK(store_study_accept(room->store, &what, &accepted, &err));
    await(&other->work, 1);
    struct store_study_claim claim = {0};
    OK(store_study_claim_next(other->store, &claim, &answer, &err));
    assert_int_equal(answer, STORE_DONE);
    free(claim.case_json);
    OK(store_study_settle(room->store, &claim.study, claim.line, claim.attempt, QUEUE_SUCCEEDED,
                          "{}", false, &answer, &err));
    assert_int_equal(answer, STORE_CONFLICT); /* it is the other's */
    OK(store_study_cancel(room->store, &accepted.id, &answer, &err));
    await(&other->cancelled_studies, 1);
    assert_true(uuid_equal(&other->last, &accepted.id));
    close_other(other);
}

/* -------------------------------------------------------------------------------- leases */

/* As when a daemon is cut off for longer than its lease: the others strike it from the list. */
static void test_a_lost_lease_gives_back_and_refuses(void **state)
{
    struct room *room = *state;
    struct other *other = open_other(), mine = {0};
    watch(&mine, room->store);
    struct store_new what = request(1);
    const struct store_accepted accepted = accept(room->store, &what);
    const struct store_claim stale = claim_one(room->store);
    for (int i = 0; i < 700; i++) rest(); /* both have lived for longer than a lease */
    tell_server("DELETE FROM ischia.daemon WHERE id = (SELECT min(id) FROM ischia.daemon)");
    await(&mine.lost, 1);
    await_state(other->store, &accepted.id, QUEUE_QUEUED);
    assert_int_equal(succeed(room->store, &stale.id, stale.attempt), STORE_CONFLICT);
    const struct store_claim again = claim_one(other->store);
    assert_int_equal(again.attempt, stale.attempt + 1);
    assert_int_equal(succeed(room->store, &stale.id, stale.attempt), STORE_CONFLICT);
    assert_int_equal(succeed(other->store, &again.id, again.attempt), STORE_DONE);
    close_other(other);
    store_watch(room->store, NULL);
}

static void test_a_daemon_that_leaves_keeps_nothing(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    struct other *other = open_other();
    struct store_new what = request(1);
    const struct store_accepted accepted = accept(room->store, &what);
    (void)claim_one(other->store);
    int requeued = -1;
    OK(store_recover(room->store, &requeued, &err));
    assert_int_equal(requeued, 0); /* the other lives */
    close_other(other);
    OK(store_recover(room->store, &requeued, &err));
    assert_int_equal(requeued, 1);
    assert_int_equal(state_of(room->store, &accepted.id), QUEUE_QUEUED);
}

/* ---------------------------------------------------------------------- lost connections */

static void test_lost_connections_come_back(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    struct store_new what = request(1);
    const struct store_accepted accepted = accept(room->store, &what);
    for (int i = 0; i < 5; i++) {
        tell_server("SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
                    "WHERE application_name = 'ischiad' AND pid <> pg_backend_pid()");
        assert_int_equal(state_of(room->store, &accepted.id), QUEUE_QUEUED);
        OK(store_probe(room->store, &err));
    }
    struct store_stats stats;
    OK(store_stats(room->store, &stats, &err));
    assert_int_equal(stats.write_failures, 0);
}

static const char *const left_open =
    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE state LIKE 'idle in tr%'";

/* A transaction of somebody else who holds the writers' lock and is gone delays, no more. */
static void test_writers_take_turns(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    PGconn *connection = PQconnectdb(test_server());
    PQclear(PQexec(connection, "BEGIN; SELECT pg_advisory_xact_lock(1232298856)"));
    struct store_new what = request(1);
    struct store_accepted ignored;
    const pid_t child = fork();
    if (child == 0) {
        for (int i = 0; i < 50; i++) rest();
        execlp("psql", "psql", "-q", "-o", "/dev/null", test_server(), "-c", left_open,
               (char *)NULL);
        _exit(1);
    }
    OK(store_accept(room->store, &what, &ignored, &err));
    assert_int_equal(ignored.acceptance, STORE_ACCEPTED);
    PQfinish(connection);
}

/* ------------------------------------------------------------------- what it is opened on */

static void expect_refusal(enum ischia_code code, const char *words)
{
    struct ischia_error err = {0};
    struct store *store = NULL;
    const struct store_options options = {.location = test_server()};
    assert_int_equal(store_open(&options, &store, &err), code);
    if (strstr(err.message, words) == NULL) fail_msg("%s", err.message);
}

static void test_a_newer_schema_is_refused(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    tell_server("UPDATE ischia.schema_version SET version = version + 1");
    expect_refusal(ISCHIA_E_STATE, "newer Ischia");
    assert_int_equal(store_probe(room->store, &err), ISCHIA_E_STATE); /* who was there already */
    tell_server("UPDATE ischia.schema_version SET version = version - 1");
    OK(store_probe(room->store, &err));
}

static void test_a_foreign_schema_is_refused(void **state)
{
    struct room *room = *state;
    store_close(room->store);
    empty_server();
    tell_server("CREATE SCHEMA ischia CREATE TABLE birds (name text)");
    expect_refusal(ISCHIA_E_INPUT, "not one of Ischia's");
    empty_server();
    open_room(room);
}

static void test_what_is_no_server_is_refused(void **state)
{
    static const char *const locations[] = {"postgresql://?nonsense=1",
                                            "postgresql://127.0.0.1:1/ischia"};
    static const enum ischia_code codes[] = {ISCHIA_E_INPUT, ISCHIA_E_IO};
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct ischia_error err = {0};
        struct store *store = NULL;
        const struct store_options options = {.location = locations[i]};
        assert_int_equal(store_open(&options, &store, &err), codes[i]);
    }
}

/* ------------------------------------------------------------------------ from store to store */

/* One of everything. */
static struct uuid fill(struct store *store)
{
    struct ischia_error err = {0};
    enum store_answer answer;
    OK(store_outbox_open(store, "webhook", &err));
    struct store_new what = request(1);
    what.origin_json = "{\"o\":1}";
    what.reference = "Patient/1";
    what.idempotency_key = "key";
    const struct store_accepted first = accept(store, &what);
    const struct store_claim claimed = claim_one(store);
    assert_int_equal(succeed(store, &claimed.id, claimed.attempt), STORE_DONE);
    what = request(2);
    (void)accept(store, &what);
    (void)claim_one(store); /* runs: queued in the copy */
    OK(store_outbox_fill(store, "webhook", &err));
    const struct store_token token = {.id = "t1", .name = "n", .scopes = 3};
    OK(store_token_add(store, &token, &answer, &err));
    const struct store_audit row = {
        .who = "a", .what = "b", .subject = "", .outcome = "ok", .detail = "ä"};
    OK(store_audit_append(store, &row, &err));
    const struct store_feedback feedback = {.service = "s", .card = first.id, .document = "{}"};
    OK(store_feedback_add(store, &feedback, 1, &err));
    struct store_study_accepted accepted;
    const struct store_study_point_new point[2] = {{.cells_json = "[\"1\"]", .case_json = "{}"},
                                                   {.cells_json = "[\"x\"]", .problem_json = "{}"}};
    const struct store_study_new study = {
        .name = "s", .columns_json = "[]", .client = "", .count = 2, .point = point};
    OK(store_study_accept(store, &study, &accepted, &err));
    return first.id;
}

static bool count_row(void *context, const struct store_outbox_row *row)
{
    assert_string_equal(row->target, "webhook");
    ++*(int *)context;
    return true;
}

static void check_copy(struct store *store, const struct uuid *id)
{
    struct ischia_error err = {0};
    struct store_stats stats;
    struct store_audit_report audit;
    unsigned char *field = NULL;
    size_t size = 0;
    int rows = 0;
    int64_t waiting = 0;
    enum store_answer answer = STORE_ANSWER_COUNT;
    struct store_assessment a = get(store, id);
    assert_string_equal(a.result_json, "{\"strain\":{}}");
    assert_string_equal(a.origin_json, "{\"o\":1}");
    store_assessment_finish(&a);
    OK(store_get_field(store, id, &field, &size, &answer, &err));
    assert_int_equal(size, 5);
    assert_memory_equal(field, "field", 5);
    free(field);
    OK(store_stats(store, &stats, &err));
    assert_int_equal(stats.count[QUEUE_SUCCEEDED], 1);
    assert_int_equal(stats.count[QUEUE_QUEUED], 1);
    assert_int_equal(stats.count[QUEUE_RUNNING], 0);
    OK(store_audit_verify(store, &audit, &err));
    assert_int_equal(audit.rows, 1);
    assert_int_equal(audit.first_bad_seq, 0);
    OK(store_outbox_list(store, count_row, &rows, &err));
    assert_int_equal(rows, 1);
    OK(store_study_waiting(store, &waiting, &err));
    assert_int_equal(waiting, 1);
    struct store_new what = request(1); /* the key is known there too, and new rows have numbers */
    what.idempotency_key = "key";
    assert_int_equal(accept(store, &what).acceptance, STORE_REPLAYED);
    what = request(9);
    assert_int_equal(accept(store, &what).acceptance, STORE_ACCEPTED);
}

static void test_a_store_moves_there_and_back(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    int64_t rows = 0;
    char file[160], back[160];
    (void)snprintf(file, sizeof file, "sqlite:%s/file", room->directory);
    (void)snprintf(back, sizeof back, "sqlite:%s/back", room->directory);
    const struct store_options options = {.location = file, .now_ms = fake_now};
    struct store *store = NULL;
    OK(store_open(&options, &store, &err));
    const struct uuid id = fill(store);
    store_close(store);
    assert_int_equal(store_move(file, test_server(), &rows, &err), ISCHIA_E_STATE); /* in use */
    store_close(room->store);
    OK(store_move(file, test_server(), &rows, &err));
    assert_true(rows > 10);
    assert_int_equal(store_move(file, test_server(), &rows, &err), ISCHIA_E_STATE); /* not empty */
    OK(store_move(test_server(), back, &rows, &err));
    open_room(room);
    check_copy(room->store, &id);
    const struct store_options again = {.location = back, .now_ms = fake_now};
    OK(store_open(&again, &store, &err));
    check_copy(store, &id);
    store_close(store);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        STORE_TEST(test_each_job_goes_to_one_daemon),
        STORE_TEST(test_the_others_are_told_in_order),
        STORE_TEST(test_progress_reaches_the_others),
        STORE_TEST(test_a_study_wakes_and_stops_the_others),
        STORE_TEST(test_a_lost_lease_gives_back_and_refuses),
        STORE_TEST(test_a_daemon_that_leaves_keeps_nothing),
        STORE_TEST(test_lost_connections_come_back),
        STORE_TEST(test_writers_take_turns),
        STORE_TEST(test_a_newer_schema_is_refused),
        STORE_TEST(test_a_foreign_schema_is_refused),
        STORE_TEST(test_what_is_no_server_is_refused),
        STORE_TEST(test_a_store_moves_there_and_back),
    };
    if (test_server() == NULL) {
        (void)printf("SKIP: no server in ISCHIA_TEST_POSTGRESQL\n");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
