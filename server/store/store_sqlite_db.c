/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "server/store/store_sqlite.h"

#define ASSESSMENT_COLUMNS                                                                         \
    "a.id, a.seq, a.change_seq, a.state, a.priority, a.created_ms, a.started_ms, a.finished_ms, "  \
    "a.attempt, a.cached, a.subject, a.side, a.label, a.measured_at, a.case_json, "                \
    "a.warnings_json, a.problem_json, s.result_json, s.field IS NOT NULL, o.document"

#define STUDY_COLUMNS                                                                              \
    "seq, id, created_ms, started_ms, finished_ms, cancelled, name, columns_json, responses_json"

static const char *const sql_text[SQL_COUNT] = {
    /* IMMEDIATE: another process' write is met here, where waiting for it is harmless */
    [SQL_BEGIN] = "BEGIN IMMEDIATE",
    [SQL_COMMIT] = "COMMIT",
    [SQL_ROLLBACK] = "ROLLBACK",
    [SQL_SAVEPOINT] = "SAVEPOINT one",
    [SQL_SAVEPOINT_UNDO] = "ROLLBACK TO one",
    [SQL_SAVEPOINT_DONE] = "RELEASE one",
    [SQL_CHANGE_ADD] = "INSERT INTO change (kind, id, at_ms) VALUES (?, ?, ?)",
    [SQL_KEY_FIND] = "SELECT k.body_digest, a.id, a.state, a.created_ms FROM idempotency k "
                     "JOIN assessment a ON a.seq = k.assessment "
                     "WHERE k.client = ? AND k.key = ? AND k.created_ms > ?",
    [SQL_KEY_PUT] = "INSERT OR REPLACE INTO idempotency "
                    "(client, key, body_digest, created_ms, assessment) VALUES (?, ?, ?, ?, ?)",
    [SQL_KEY_EXPIRE] = "DELETE FROM idempotency WHERE created_ms <= ?",
    [SQL_SOLUTION_FIND] = "SELECT rowid FROM solution WHERE case_key = ?",
    [SQL_SOLUTION_ADD] = "INSERT INTO solution (case_key, created_ms, result_json, field) "
                         "VALUES (?, ?, ?, ?)",
    [SQL_SOLUTION_DROP] = "DELETE FROM solution WHERE rowid = ?1 AND NOT EXISTS "
                          "(SELECT 1 FROM assessment WHERE solution = ?1)",
    [SQL_TALLY] = "SELECT n FROM tally WHERE state = ?",
    [SQL_TALLY_ALL] = "SELECT state, n FROM tally",
    [SQL_OLDEST_QUEUED] = "SELECT created_ms FROM assessment WHERE state = 0 ORDER BY seq LIMIT 1",
    [SQL_ACCEPT] = "INSERT INTO assessment (seq, id, state, priority, cached, change_seq, "
                   "created_ms, finished_ms, solution, case_key, subject, side, label, "
                   "measured_at, case_json, warnings_json) "
                   "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    [SQL_STATE] = "SELECT seq, state, attempt, case_key, crashes, solution FROM assessment "
                  "WHERE id = ?",
    [SQL_NEXT] = "SELECT id, seq, attempt, crashes, case_key, case_json FROM assessment "
                 "WHERE state = 0 ORDER BY priority DESC, seq LIMIT 1",
    [SQL_START] = "UPDATE assessment SET state = 1, attempt = attempt + 1, started_ms = ?, "
                  "change_seq = ? WHERE seq = ?",
    [SQL_REQUEUE] = "UPDATE assessment SET state = 0, crashes = crashes + ?, change_seq = ? "
                    "WHERE seq = ?",
    [SQL_SUCCEED] = "UPDATE assessment SET state = 2, solution = ?, cached = ?, finished_ms = ?, "
                    "change_seq = ? WHERE seq = ?",
    [SQL_FAIL] = "UPDATE assessment SET state = 3, problem_json = ?, finished_ms = ?, "
                 "change_seq = ? WHERE seq = ?",
    [SQL_CANCEL] = "UPDATE assessment SET state = 4, finished_ms = ?, change_seq = ? WHERE seq = ?",
    [SQL_RUNNING] = "SELECT id, seq FROM assessment WHERE state = 1 ORDER BY seq LIMIT 1",
    [SQL_ERASE] = "DELETE FROM assessment WHERE seq = ?",
    [SQL_TOO_OLD] = "SELECT id FROM assessment WHERE finished_ms > 0 AND finished_ms < ? "
                    "ORDER BY finished_ms LIMIT 1",
    [SQL_TOO_MANY] = "SELECT id FROM assessment WHERE finished_ms > 0 "
                     "ORDER BY finished_ms LIMIT 1",
    [SQL_GET] = "SELECT " ASSESSMENT_COLUMNS
                " FROM assessment a LEFT JOIN solution s ON s.rowid = a.solution "
                "LEFT JOIN origin o ON o.assessment = a.seq WHERE a.id = ?",
    [SQL_FIELD] = "SELECT s.field FROM assessment a LEFT JOIN solution s ON s.rowid = a.solution "
                  "WHERE a.id = ?",
    [SQL_CHANGES] = "SELECT seq, kind, id, at_ms FROM change WHERE seq > ? ORDER BY seq LIMIT ?",
    [SQL_CHANGES_LAST] = "SELECT max(seq) FROM change",
    [SQL_TOKEN_ADD] = "INSERT OR IGNORE INTO token (id, name, digest, scopes, created_ms, "
                      "expires_ms) VALUES (?, ?, ?, ?, ?, ?)",
    [SQL_TOKEN_GET] = "SELECT id, name, digest, scopes, created_ms, expires_ms, revoked_ms "
                      "FROM token WHERE id = ?",
    [SQL_TOKEN_LIST] = "SELECT id, name, digest, scopes, created_ms, expires_ms, revoked_ms "
                       "FROM token ORDER BY created_ms, id",
    [SQL_TOKEN_REVOKE] = "UPDATE token SET revoked_ms = ? WHERE id = ? AND revoked_ms = 0",
    [SQL_TOKEN_EPOCH] = "SELECT value FROM number WHERE name = 'token_epoch'",
    [SQL_AUDIT_HEAD] = "SELECT seq, hash FROM audit ORDER BY seq DESC LIMIT 1",
    [SQL_AUDIT_ADD] = "INSERT INTO audit (seq, at_ms, who, what, subject, outcome, detail, hash) "
                      "VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
    [SQL_AUDIT_LIST] = "SELECT seq, at_ms, who, what, subject, outcome, detail, hash FROM audit "
                       "WHERE seq > ? ORDER BY seq",
    [SQL_PROBE] = "UPDATE number SET value = ? WHERE name = 'probe'",
    [SQL_ORIGIN_ADD] = "INSERT INTO origin (assessment, reference, document) VALUES (?, ?, ?)",
    [SQL_OUTBOX_OPEN] = "INSERT OR IGNORE INTO outbox_target (target, change_seq) "
                        "SELECT ?, coalesce(max(seq), 0) FROM change",
    [SQL_OUTBOX_CLOSE] = "DELETE FROM outbox_target WHERE target = ?",
    [SQL_OUTBOX_CLEAR] = "DELETE FROM outbox WHERE target = ?",
    /* kinds 3, 4, 5: succeeded, failed, cancelled */
    [SQL_OUTBOX_FILL] = "INSERT OR IGNORE INTO outbox (target, change_seq, id, kind, created_ms, "
                        "due_ms) SELECT t.target, c.seq, c.id, c.kind, c.at_ms, c.at_ms "
                        "FROM outbox_target t JOIN change c ON c.seq > t.change_seq "
                        "JOIN assessment a ON a.id = c.id "
                        "WHERE t.target = ? AND c.kind IN (3, 4, 5) ORDER BY c.seq",
    [SQL_OUTBOX_MOVE] = "UPDATE outbox_target SET change_seq = "
                        "(SELECT coalesce(max(seq), 0) FROM change) WHERE target = ?",
    [SQL_OUTBOX_NEXT] = "SELECT seq, change_seq, id, kind, created_ms, attempts, due_ms "
                        "FROM outbox WHERE target = ? AND given_up = 0 "
                        "ORDER BY due_ms, seq LIMIT 1",
    [SQL_OUTBOX_DONE] = "DELETE FROM outbox WHERE seq = ?",
    [SQL_OUTBOX_RETRY] = "UPDATE outbox SET attempts = attempts + 1, due_ms = ?, given_up = ?, "
                         "problem = ? WHERE seq = ?",
    [SQL_OUTBOX_LIST] = "SELECT seq, change_seq, id, kind, created_ms, attempts, due_ms, target, "
                        "given_up, problem FROM outbox ORDER BY seq",
    [SQL_OUTBOX_REVIVE] = "UPDATE outbox SET due_ms = ?, given_up = 0",
    [SQL_FEEDBACK_ADD] = "INSERT INTO feedback (at_ms, service, card, document) "
                         "VALUES (?, ?, ?, ?)",
    [SQL_FEEDBACK_LIST] = "SELECT at_ms, service, card, document FROM feedback ORDER BY seq",
    [SQL_STUDY_KEY_FIND] = "SELECT body_digest, id FROM study WHERE client = ? AND "
                           "idempotency_key = ? AND created_ms > ?",
    [SQL_STUDY_KEY_FREE] = "UPDATE study SET idempotency_key = NULL WHERE client = ? AND "
                           "idempotency_key = ?",
    [SQL_STUDY_ADD] = "INSERT INTO study (id, name, columns_json, responses_json, created_ms, "
                      "client, idempotency_key, body_digest) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
    [SQL_STUDY_POINT_ADD] = "INSERT INTO study_point (study, line, state, refused, case_key, "
                            "case_json, cells_json, outcome_json) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
    [SQL_STUDY_GET] = "SELECT " STUDY_COLUMNS " FROM study WHERE id = ?",
    [SQL_STUDY_LIST] =
        "SELECT " STUDY_COLUMNS " FROM study WHERE seq < ? ORDER BY seq DESC LIMIT ?",
    [SQL_STUDY_COUNT] = "SELECT state, refused, count(*) FROM study_point WHERE study = ? "
                        "GROUP BY state, refused",
    [SQL_STUDY_POINTS] = "SELECT p.line, p.state, p.refused, p.cells_json, p.case_json, "
                         "p.outcome_json FROM study s JOIN study_point p ON p.study = s.seq "
                         "WHERE s.id = ? ORDER BY p.line",
    [SQL_STUDY_NEXT] = "SELECT s.seq, s.id, p.line, p.attempt, p.crashes, p.case_key, p.case_json "
                       "FROM study_point p JOIN study s ON s.seq = p.study WHERE p.state = 0 "
                       "ORDER BY p.study, p.line LIMIT 1",
    [SQL_STUDY_KNOWN] = "SELECT result_json FROM solution WHERE case_key = ? UNION ALL "
                        "SELECT outcome_json FROM study_point WHERE case_key = ? AND state = 2 "
                        "LIMIT 1",
    [SQL_STUDY_BEGIN] = "UPDATE study SET started_ms = ? WHERE seq = ? AND started_ms = 0",
    [SQL_STUDY_POINT_PUT] = "UPDATE study_point SET state = ?, outcome_json = ?, "
                            "attempt = attempt + ?, crashes = crashes + ? "
                            "WHERE study = ? AND line = ?",
    [SQL_STUDY_POINT_GET] = "SELECT s.seq, p.state, p.attempt FROM study s "
                            "JOIN study_point p ON p.study = s.seq WHERE s.id = ? AND p.line = ?",
    [SQL_STUDY_END] = "UPDATE study SET finished_ms = ?1 WHERE seq = ?2 AND finished_ms = 0 AND "
                      "NOT EXISTS (SELECT 1 FROM study_point WHERE study = ?2 AND state < 2)",
    [SQL_STUDY_SEQ] = "SELECT seq FROM study WHERE id = ?",
    /* 0: not over, 1: over, 2: cancelled */
    [SQL_STUDY_OVER] = "SELECT CASE WHEN finished_ms = 0 THEN 0 ELSE 1 + cancelled END "
                       "FROM study WHERE seq = ?",
    [SQL_STUDY_CANCEL_POINTS] = "UPDATE study_point SET state = 4 WHERE study = ? AND state < 2",
    [SQL_STUDY_CANCEL] = "UPDATE study SET cancelled = 1, finished_ms = ? WHERE seq = ?",
    [SQL_STUDY_RUNNING] = "SELECT count(*) FROM study_point WHERE study = ? AND state = 1",
    [SQL_STUDY_ERASE] = "DELETE FROM study WHERE seq = ?",
    [SQL_STUDY_TOO_OLD] = "SELECT seq FROM study WHERE finished_ms > 0 AND finished_ms < ? "
                          "ORDER BY finished_ms LIMIT 1",
    [SQL_STUDY_RECOVER] = "UPDATE study_point SET state = 0 WHERE state = 1",
};

const char *const sqlite_assessment_columns = ASSESSMENT_COLUMNS;

/* ------------------------------------------------------------------------- connections */

static enum ischia_code code_of(int sqlite_code)
{
    switch (sqlite_code & 0xff) {
    case SQLITE_NOMEM:
        return ISCHIA_E_MEMORY;
    case SQLITE_NOTADB:
        return ISCHIA_E_INPUT;
    default:
        return ISCHIA_E_IO;
    }
}

/* What an operator can do about it; "" when SQLite's own words say it all. */
static const char *advice_of(int sqlite_code)
{
    switch (sqlite_code & 0xff) {
    case SQLITE_FULL:
        return " (free some disk space)";
    case SQLITE_READONLY:
        return " (make the state directory writable for this user)";
    case SQLITE_CORRUPT:
        return " (the database is damaged: stop, and restore a backup)";
    case SQLITE_CANTOPEN:
        return " (check that the directory exists, its permissions, and the "
               "limit on open files)";
    case SQLITE_BUSY:
        return " (another process is writing to it for too long)";
    default:
        return "";
    }
}

enum ischia_code db_fail(struct db *db, const char *doing, struct ischia_error *err)
{
    const int code = sqlite3_extended_errcode(db->handle);
    return FAIL(err, code_of(code), "the store cannot %s: %s%s [SQLite %d]", doing,
                sqlite3_errmsg(db->handle), advice_of(code), code);
}

static enum ischia_code configure(struct db *db, enum db_access access, int busy_timeout_ms,
                                  struct ischia_error *err)
{
    sqlite3_extended_result_codes(db->handle, 1);
    sqlite3_busy_timeout(db->handle, busy_timeout_ms);
    sqlite3_db_config(db->handle, SQLITE_DBCONFIG_DEFENSIVE, 1, NULL);
    sqlite3_db_config(db->handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
    /* temp_store: a statement that has to be undone keeps its journal in memory, so that running
     * out of descriptors cannot fail a write */
    TRY(db_execute(db, "PRAGMA foreign_keys = ON; PRAGMA temp_store = MEMORY;", err));
    if (access == DB_LOOK) sqlite3_db_config(db->handle, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, NULL);
    if (access != DB_WRITE) return ISCHIA_OK;
    return db_execute(db,
                      "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;"
                      "PRAGMA secure_delete = ON; PRAGMA journal_size_limit = 67108864;",
                      err);
}

enum ischia_code db_open(const char *path, enum db_access access, int busy_timeout_ms,
                         struct db **ret_db, struct ischia_error *err)
{
    struct db *db = calloc(1, sizeof *db);
    CHECK(db != NULL, err, ISCHIA_E_MEMORY, "no memory for a database connection");
    const int mode = access == DB_LOOK ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE;
    enum ischia_code code = ISCHIA_OK;
    if (sqlite3_open_v2(path, &db->handle, mode | SQLITE_OPEN_NOMUTEX, NULL) != SQLITE_OK)
        code = db->handle == NULL
                   ? FAIL(err, ISCHIA_E_MEMORY, "no memory for a database connection")
                   : db_fail(db, "open its database", err);
    if (code == ISCHIA_OK) code = configure(db, access, busy_timeout_ms, err);
    if (code != ISCHIA_OK) {
        db_close(db);
        return code;
    }
    *ret_db = db;
    return ISCHIA_OK;
}

void db_close(struct db *db)
{
    if (db == NULL) return;
    for (int i = 0; i < SQL_COUNT; i++) sqlite3_finalize(db->kept[i]);
    sqlite3_close(db->handle);
    free(db);
}

enum ischia_code db_execute(struct db *db, const char *sql, struct ischia_error *err)
{
    if (sqlite3_exec(db->handle, sql, NULL, NULL, NULL) == SQLITE_OK) return ISCHIA_OK;
    return db_fail(db, "be set up", err);
}

enum ischia_code db_number(struct db *db, const char *sql, int64_t *ret, struct ischia_error *err)
{
    struct query query;
    bool row = false;
    TRY(query_begin_text(&query, db, sql, err));
    const enum ischia_code code = query_step(&query, &row, err);
    if (code == ISCHIA_OK) *ret = row ? query_integer(&query, 0) : 0;
    query_end(&query);
    return code;
}

/* ----------------------------------------------------------------------------- queries */

enum ischia_code query_begin(struct query *ret, struct db *db, enum sql sql,
                             struct ischia_error *err)
{
    sqlite3_stmt **kept = &db->kept[sql];
    if (*kept == NULL && sqlite3_prepare_v3(db->handle, sql_text[sql], -1,
                                            SQLITE_PREPARE_PERSISTENT, kept, NULL) != SQLITE_OK)
        return db_fail(db, "be read", err);
    *ret = (struct query){.db = db, .statement = *kept, .kept = true};
    return ISCHIA_OK;
}

enum ischia_code query_begin_text(struct query *ret, struct db *db, const char *text,
                                  struct ischia_error *err)
{
    sqlite3_stmt *statement = NULL;
    if (sqlite3_prepare_v2(db->handle, text, -1, &statement, NULL) != SQLITE_OK)
        return db_fail(db, "be read", err);
    *ret = (struct query){.db = db, .statement = statement};
    return ISCHIA_OK;
}

static void bound(struct query *query, int code)
{
    if (query->failed == SQLITE_OK) query->failed = code;
}

void query_put_integer(struct query *query, int64_t value)
{
    bound(query, sqlite3_bind_int64(query->statement, ++query->bound, value));
}

void query_put_text(struct query *query, const char *text)
{
    bound(query, sqlite3_bind_text(query->statement, ++query->bound, text, -1, SQLITE_STATIC));
}

void query_put_blob(struct query *query, const void *bytes, size_t size)
{
    bound(query, sqlite3_bind_blob64(query->statement, ++query->bound, bytes, size, SQLITE_STATIC));
}

enum ischia_code query_step(struct query *query, bool *ret_row, struct ischia_error *err)
{
    if (query->failed != SQLITE_OK) return db_fail(query->db, "take a value", err);
    const int code = sqlite3_step(query->statement);
    if (code != SQLITE_ROW && code != SQLITE_DONE) return db_fail(query->db, "be used", err);
    *ret_row = code == SQLITE_ROW;
    return ISCHIA_OK;
}

void query_end(struct query *query)
{
    if (query->statement == NULL) return;
    /* both report what the last step reported, which has been handled */
    if (query->kept) {
        (void)sqlite3_reset(query->statement);
        (void)sqlite3_clear_bindings(query->statement);
    } else {
        (void)sqlite3_finalize(query->statement);
    }
    query->statement = NULL;
}

enum ischia_code query_run(struct query *query, struct ischia_error *err)
{
    bool row;
    const enum ischia_code code = query_step(query, &row, err);
    query_end(query);
    return code;
}

enum ischia_code db_run(struct db *db, enum sql sql, struct ischia_error *err)
{
    struct query query;
    TRY(query_begin(&query, db, sql, err));
    return query_run(&query, err);
}

int64_t query_integer(struct query *query, int column)
{
    return sqlite3_column_int64(query->statement, column);
}

enum ischia_code query_text(struct query *query, int column, char **ret, struct ischia_error *err)
{
    if (sqlite3_column_type(query->statement, column) == SQLITE_NULL) {
        *ret = NULL;
        return ISCHIA_OK;
    }
    const char *text = (const char *)sqlite3_column_text(query->statement, column);
    char *copy = text == NULL ? NULL : strdup(text);
    CHECK(copy != NULL, err, ISCHIA_E_MEMORY, "no memory for a stored text");
    *ret = copy;
    return ISCHIA_OK;
}

enum ischia_code query_blob(struct query *query, int column, void *ret, size_t size,
                            struct ischia_error *err)
{
    const void *bytes = sqlite3_column_blob(query->statement, column);
    CHECK(bytes != NULL && (size_t)sqlite3_column_bytes(query->statement, column) == size, err,
          ISCHIA_E_IO, "the store holds a value of the wrong size (damaged?)");
    memcpy(ret, bytes, size);
    return ISCHIA_OK;
}
