/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The store's files: damage, versions, backup; and the audit chain, which somebody tampers with. */
#include <fcntl.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include "tests/unit/store_room.h"

static void tamper(const struct room *room, const char *sql)
{
    char path[256];
    sqlite3 *db = NULL;
    (void)snprintf(path, sizeof path, "%s/ischia.sqlite", room->path);
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, sql, NULL, NULL, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
}

static void expect_audit(const struct room *room, int64_t rows, int64_t first_bad)
{
    struct ischia_error err;
    struct store_audit_report report;
    assert_int_equal(store_audit_verify(room->store, &report, &err), ISCHIA_OK);
    assert_int_equal(report.rows, rows);
    assert_int_equal(report.first_bad_seq, first_bad);
}

static void test_audit_chain_shows_tampering(void **state)
{
    struct room *room = *state;
    struct ischia_error err;
    const struct store_audit row = {.who = "local",
                                    .what = "assessment.create",
                                    .subject = "id",
                                    .outcome = "ok",
                                    .detail = ""};
    expect_audit(room, 0, 0);
    for (int i = 0; i < 5; i++)
        assert_int_equal(store_audit_append_later(room->store, &row, &err), ISCHIA_OK);
    assert_int_equal(store_audit_append(room->store, &row, &err), ISCHIA_OK);
    expect_audit(room, 6, 0);
    tamper(room, "UPDATE audit SET outcome = 'denied' WHERE seq = 3");
    expect_audit(room, 6, 3);
    tamper(room, "UPDATE audit SET outcome = 'ok' WHERE seq = 3");
    expect_audit(room, 6, 0);
    tamper(room, "UPDATE audit SET who = 'loca', what = 'lassessment.create' WHERE seq = 4");
    expect_audit(room, 6, 4);
    tamper(room, "UPDATE audit SET who = 'local', what = 'assessment.create' WHERE seq = 4");
    tamper(room, "DELETE FROM audit WHERE seq = 2");
    expect_audit(room, 5, 3);
}

static void test_one_daemon_at_a_time(void **state)
{
    struct room *room = *state;
    struct ischia_error err = {0};
    struct store *second = NULL;
    struct store_options options = {.location = room->path, .now_ms = fake_now};
    assert_int_equal(store_open(&options, &second, &err), ISCHIA_E_STATE);
    assert_non_null(strstr(err.message, "another ischiad"));
    options.mode = STORE_ADMIN; /* a command beside the daemon works */
    expect_ok(store_open(&options, &second, &err), &err);
    const struct store_new what = request(1);
    const struct store_accepted accepted = accept(second, &what);
    store_close(second);
    assert_int_equal(state_of(room->store, &accepted.id), QUEUE_QUEUED);
}

static void copy_file(const char *from, const char *to)
{
    FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
    assert_non_null(in);
    assert_non_null(out);
    for (int c; (c = fgetc(in)) != EOF;) assert_int_not_equal(fputc(c, out), EOF);
    assert_int_equal(fclose(in), 0);
    assert_int_equal(fclose(out), 0);
}

static bool same_bytes(const char *a, const char *b)
{
    FILE *first = fopen(a, "rb"), *second = fopen(b, "rb");
    assert_non_null(first);
    assert_non_null(second);
    int x, y;
    do {
        x = fgetc(first);
        y = fgetc(second);
    } while (x == y && x != EOF);
    (void)fclose(first);
    (void)fclose(second);
    return x == y;
}

/* Closes the store, spoils its file, and expects an open to refuse and leave it byte for byte. */
static void expect_refusal(struct room *room, void (*spoil)(const char *path),
                           enum ischia_code expected, const char *words)
{
    char path[256], copy[256];
    (void)snprintf(path, sizeof path, "%s/ischia.sqlite", room->path);
    (void)snprintf(copy, sizeof copy, "%s/copy", room->directory);
    store_close(room->store);
    room->store = NULL;
    spoil(path);
    copy_file(path, copy);
    struct ischia_error err = {0};
    const struct store_options options = {.location = room->path, .now_ms = fake_now};
    assert_int_equal(store_open(&options, &room->store, &err), expected);
    if (strstr(err.message, words) == NULL) fail_msg("no '%s' in: %s", words, err.message);
    assert_true(same_bytes(path, copy));
}

static void overwrite_with_text(const char *path)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    for (int i = 0; i < 5000; i++) assert_true(fputs("this is a letter\n", file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static void overwrite_middle(const char *path)
{
    FILE *file = fopen(path, "r+b");
    assert_non_null(file);
    assert_int_equal(fseek(file, 4096 * 3, SEEK_SET), 0);
    for (int i = 0; i < 4096 * 4; i++) assert_int_not_equal(fputc(0xa5, file), EOF);
    assert_int_equal(fclose(file), 0);
}

static void truncate_half(const char *path)
{
    struct stat status;
    assert_int_equal(stat(path, &status), 0);
    assert_int_equal(truncate(path, status.st_size / 2), 0);
}

static void execute_on(const char *path, const char *sql)
{
    sqlite3 *db = NULL;
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, sql, NULL, NULL, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
}

static void make_newer(const char *path) { execute_on(path, "PRAGMA user_version = 1000"); }

static void make_foreign(const char *path)
{
    assert_int_equal(unlink(path), 0);
    execute_on(path, "CREATE TABLE their_data (x)");
}

static void test_text_file_is_refused(void **state)
{
    expect_refusal(*state, overwrite_with_text, ISCHIA_E_INPUT, "ischiad restore");
}

static void test_damaged_pages_are_refused(void **state)
{
    struct room *room = *state;
    for (unsigned char i = 0; i < 40; i++) {
        const struct store_new what = request(i);
        (void)accept(room->store, &what);
    }
    expect_refusal(room, overwrite_middle, ISCHIA_E_INPUT, "damaged");
}

static void test_truncated_file_is_refused(void **state)
{
    expect_refusal(*state, truncate_half, ISCHIA_E_INPUT, "damaged");
}

static void test_newer_schema_is_refused(void **state)
{
    expect_refusal(*state, make_newer, ISCHIA_E_STATE, "newer");
}

static void test_foreign_database_is_refused(void **state)
{
    expect_refusal(*state, make_foreign, ISCHIA_E_INPUT, "not one of Ischia's");
}

static void run_file(sqlite3 *db, const char *path)
{
    char text[16384];
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    const size_t size = fread(text, 1, sizeof text - 1, file);
    assert_true(feof(file) != 0);
    text[size] = '\0';
    (void)fclose(file);
    assert_int_equal(sqlite3_exec(db, text, NULL, NULL, NULL), SQLITE_OK);
}

/* A store as the first version made it, with one assessment in it. */
static void test_old_schema_is_migrated(void **state)
{
    struct room *room = *state;
    char path[256];
    sqlite3 *db = NULL;
    (void)snprintf(path, sizeof path, "%s/ischia.sqlite", room->path);
    store_close(room->store);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    run_file(db, SOURCE_ROOT "/server/store/sqlite/0001_assessments.sql");
    assert_int_equal(
        sqlite3_exec(db,
                     "PRAGMA user_version = 1;"
                     "INSERT INTO change VALUES (1, 0, zeroblob(16), 5);"
                     "INSERT INTO assessment (seq, id, state, priority, change_seq, created_ms, "
                     "case_key, case_json, warnings_json) "
                     "VALUES (1, zeroblob(16), 0, 10, 1, 5, zeroblob(32), '{}', '[]');",
                     NULL, NULL, NULL),
        SQLITE_OK);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
    open_room(room);
    const struct uuid old = {{0}};
    assert_int_equal(state_of(room->store, &old), QUEUE_QUEUED);
    int64_t epoch = -1;
    struct ischia_error err;
    assert_int_equal(store_token_epoch(room->store, &epoch, &err), ISCHIA_OK);
    store_close(room->store);
    open_room(room); /* and once more: nothing left to do */
    assert_int_equal(state_of(room->store, &old), QUEUE_QUEUED);
    assert_int_equal(store_schema_version(), 4);
}

static void test_backup_and_restore(void **state)
{
    struct room *room = *state;
    char backup[256], fresh[256];
    (void)snprintf(backup, sizeof backup, "%s/backup", room->directory);
    (void)snprintf(fresh, sizeof fresh, "%s/fresh", room->directory);
    const struct store_new one = request(1), two = request(2);
    const struct store_accepted kept = accept(room->store, &one);
    (void)claim_one(room->store);
    struct ischia_error err = {0};
    expect_ok(store_backup(room->store, backup, &err), &err);
    assert_int_equal(store_backup(room->store, backup, &err), ISCHIA_E_STATE);
    const struct store_accepted later = accept(room->store, &two);

    expect_ok(store_restore(room->path, backup, &err), &err);        /* while it is served */
    assert_int_equal(state_of(room->store, &kept.id), QUEUE_QUEUED); /* it ran in the backup */
    struct store_assessment a;
    enum store_answer answer;
    assert_int_equal(store_get(room->store, &later.id, &a, &answer, &err), ISCHIA_OK);
    assert_int_equal(answer, STORE_NOT_FOUND);
    (void)accept(room->store, &two); /* and it goes on */

    expect_ok(store_restore(fresh, backup, &err), &err); /* where there was nothing */
    store_close(room->store);
    (void)snprintf(room->path, sizeof room->path, "%s/fresh", room->directory);
    open_room(room);
    assert_int_equal(state_of(room->store, &kept.id), QUEUE_QUEUED);
}

static void test_restore_refuses_damage_and_heals_it(void **state)
{
    struct room *room = *state;
    char backup[256], bad[256], path[256];
    (void)snprintf(backup, sizeof backup, "%s/backup", room->directory);
    (void)snprintf(bad, sizeof bad, "%s/bad", room->directory);
    (void)snprintf(path, sizeof path, "%s/ischia.sqlite", room->path);
    const struct store_new what = request(1);
    const struct store_accepted kept = accept(room->store, &what);
    struct ischia_error err = {0};
    expect_ok(store_backup(room->store, backup, &err), &err);
    copy_file(backup, bad);
    overwrite_middle(bad);
    assert_int_equal(store_restore(room->path, bad, &err), ISCHIA_E_INPUT);
    assert_int_equal(state_of(room->store, &kept.id), QUEUE_QUEUED); /* as it was */
    store_close(room->store);
    room->store = NULL;
    overwrite_with_text(path);
    expect_ok(store_restore(room->path, backup, &err), &err);
    open_room(room);
    assert_int_equal(state_of(room->store, &kept.id), QUEUE_QUEUED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        STORE_TEST(test_audit_chain_shows_tampering),
        STORE_TEST(test_one_daemon_at_a_time),
        STORE_TEST(test_text_file_is_refused),
        STORE_TEST(test_damaged_pages_are_refused),
        STORE_TEST(test_truncated_file_is_refused),
        STORE_TEST(test_newer_schema_is_refused),
        STORE_TEST(test_foreign_database_is_refused),
        STORE_TEST(test_old_schema_is_migrated),
        STORE_TEST(test_backup_and_restore),
        STORE_TEST(test_restore_refuses_damage_and_heals_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
