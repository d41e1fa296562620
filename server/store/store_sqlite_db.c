/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "server/store/store_sqlite.h"

enum control { BEGIN, COMMIT, ROLLBACK, SAVEPOINT, SAVEPOINT_UNDO, SAVEPOINT_DONE, CONTROL_COUNT };
static const char *const control_text[CONTROL_COUNT] = {
    /* IMMEDIATE: another process' write is met here, where waiting for it is harmless */
    [BEGIN] = "BEGIN IMMEDIATE",
    [COMMIT] = "COMMIT",
    [ROLLBACK] = "ROLLBACK",
    [SAVEPOINT] = "SAVEPOINT one",
    [SAVEPOINT_UNDO] = "ROLLBACK TO one",
    [SAVEPOINT_DONE] = "RELEASE one",
};

struct sqlite_db {
    struct db db;
    sqlite3 *handle;
    sqlite3_stmt *kept[SQL_COUNT]; /* prepared when first used, as the next */
    sqlite3_stmt *control[CONTROL_COUNT];
};

static struct sqlite_db *own_of(struct db *db) { return (struct sqlite_db *)db; }

sqlite3 *sqlite_handle(const struct db *db) { return ((const struct sqlite_db *)db)->handle; }

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

enum ischia_code sqlite_fail(struct db *db, const char *doing, struct ischia_error *err)
{
    const int code = sqlite3_extended_errcode(sqlite_handle(db));
    return FAIL(err, code_of(code), "the store cannot %s: %s%s [SQLite %d]", doing,
                sqlite3_errmsg(sqlite_handle(db)), advice_of(code), code);
}

static enum ischia_code configure(struct db *db, enum sqlite_access access, int busy_timeout_ms,
                                  struct ischia_error *err)
{
    sqlite3_extended_result_codes(sqlite_handle(db), 1);
    sqlite3_busy_timeout(sqlite_handle(db), busy_timeout_ms);
    sqlite3_db_config(sqlite_handle(db), SQLITE_DBCONFIG_DEFENSIVE, 1, NULL);
    sqlite3_db_config(sqlite_handle(db), SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
    /* temp_store: a statement that has to be undone keeps its journal in memory, so that running
     * out of descriptors cannot fail a write */
    TRY(sqlite_execute(db, "PRAGMA foreign_keys = ON; PRAGMA temp_store = MEMORY;", err));
    if (access == DB_LOOK)
        sqlite3_db_config(sqlite_handle(db), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, NULL);
    if (access != DB_WRITE) return ISCHIA_OK;
    return sqlite_execute(db,
                          "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;"
                          "PRAGMA secure_delete = ON; PRAGMA journal_size_limit = 67108864;",
                          err);
}

enum ischia_code sqlite_open(const char *path, enum sqlite_access access, int busy_timeout_ms,
                             struct db **ret_db, struct ischia_error *err)
{
    struct sqlite_db *own = calloc(1, sizeof *own);
    CHECK(own != NULL, err, ISCHIA_E_MEMORY, "no memory for a database connection");
    struct db *db = &own->db;
    db->engine = &engine_sqlite;
    const int mode = access == DB_LOOK ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE;
    enum ischia_code code = ISCHIA_OK;
    if (sqlite3_open_v2(path, &own->handle, mode | SQLITE_OPEN_NOMUTEX, NULL) != SQLITE_OK)
        code = own->handle == NULL
                   ? FAIL(err, ISCHIA_E_MEMORY, "no memory for a database connection")
                   : sqlite_fail(db, "open its database", err);
    if (code == ISCHIA_OK) code = configure(db, access, busy_timeout_ms, err);
    if (code != ISCHIA_OK) {
        sqlite_close(db);
        return code;
    }
    *ret_db = db;
    return ISCHIA_OK;
}

void sqlite_close(struct db *db)
{
    struct sqlite_db *own = own_of(db);
    if (db == NULL) return;
    for (int i = 0; i < SQL_COUNT; i++) sqlite3_finalize(own->kept[i]);
    for (int i = 0; i < CONTROL_COUNT; i++) sqlite3_finalize(own->control[i]);
    sqlite3_close(own->handle);
    free(own);
}

enum ischia_code sqlite_execute(struct db *db, const char *sql, struct ischia_error *err)
{
    if (sqlite3_exec(sqlite_handle(db), sql, NULL, NULL, NULL) == SQLITE_OK) return ISCHIA_OK;
    return sqlite_fail(db, "be set up", err);
}

/* ------------------------------------------------------------------------ transactions */

/* These never go through a struct query: there is nothing to put or to read. */
static enum ischia_code run_control(struct db *db, enum control which, struct ischia_error *err)
{
    struct sqlite_db *own = own_of(db);
    sqlite3_stmt **kept = &own->control[which];
    if (*kept == NULL && sqlite3_prepare_v3(own->handle, control_text[which], -1,
                                            SQLITE_PREPARE_PERSISTENT, kept, NULL) != SQLITE_OK)
        return sqlite_fail(db, "be read", err);
    const bool done = sqlite3_step(*kept) == SQLITE_DONE;
    const enum ischia_code code = done ? ISCHIA_OK : sqlite_fail(db, "be used", err);
    (void)sqlite3_reset(*kept); /* repeats the failure of step */
    return code;
}

enum ischia_code sqlite_begin(struct store *store, struct db *db, struct ischia_error *err)
{
    (void)store;
    return run_control(db, BEGIN, err);
}

enum ischia_code sqlite_commit(struct db *db, struct ischia_error *err)
{
    return run_control(db, COMMIT, err);
}

/* After some failures (disk full) SQLite has rolled back by itself. */
void sqlite_roll_back(struct db *db)
{
    if (sqlite_is_in_transaction(db)) (void)!run_control(db, ROLLBACK, NULL);
}

bool sqlite_is_in_transaction(const struct db *db)
{
    return sqlite3_get_autocommit(sqlite_handle(db)) == 0;
}

enum ischia_code sqlite_mark(struct db *db, struct ischia_error *err)
{
    return run_control(db, SAVEPOINT, err);
}

enum ischia_code sqlite_keep(struct db *db, bool undo, struct ischia_error *err)
{
    if (undo) TRY(run_control(db, SAVEPOINT_UNDO, err));
    return run_control(db, SAVEPOINT_DONE, err);
}

/* ----------------------------------------------------------------------------- queries */

static enum ischia_code prepare(struct query *query, struct ischia_error *err)
{
    struct sqlite_db *own = own_of(query->db);
    sqlite3_stmt *fresh = NULL;
    const bool kept = query->sql != SQL_COUNT;
    if (kept) fresh = own->kept[query->sql];
    const char *text = kept ? sql_for(&engine_sqlite, &sql_text[query->sql]) : query->text;
    if (fresh == NULL &&
        sqlite3_prepare_v3(own->handle, text, -1, kept ? SQLITE_PREPARE_PERSISTENT : 0, &fresh,
                           NULL) != SQLITE_OK)
        return sqlite_fail(query->db, "be read", err);
    if (kept) own->kept[query->sql] = fresh;
    query->state = fresh;
    query->begun = true;
    return ISCHIA_OK;
}

static int bind_one(sqlite3_stmt *statement, int place, const struct value *value)
{
    switch (value->kind) {
    case VALUE_INTEGER:
        return sqlite3_bind_int64(statement, place, value->integer);
    case VALUE_TEXT:
        return sqlite3_bind_text64(statement, place, value->bytes, value->size, SQLITE_STATIC,
                                   SQLITE_UTF8);
    case VALUE_BLOB:
        return sqlite3_bind_blob64(statement, place, value->bytes, value->size, SQLITE_STATIC);
    default:
        return sqlite3_bind_null(statement, place);
    }
}

static enum ischia_code start(struct query *query, struct ischia_error *err)
{
    TRY(prepare(query, err));
    for (int i = 0; i < query->count; i++)
        if (bind_one(query->state, i + 1, &query->value[i]) != SQLITE_OK)
            return sqlite_fail(query->db, "take a value", err);
    return ISCHIA_OK;
}

enum ischia_code sqlite_step(struct query *query, bool *ret_row, struct ischia_error *err)
{
    if (!query->begun) TRY(start(query, err));
    const int code = sqlite3_step(query->state);
    if (code != SQLITE_ROW && code != SQLITE_DONE) return sqlite_fail(query->db, "be used", err);
    *ret_row = code == SQLITE_ROW;
    return ISCHIA_OK;
}

void sqlite_end(struct query *query)
{
    /* both report what the last step reported, which has been handled */
    if (query->sql != SQL_COUNT) {
        (void)sqlite3_reset(query->state);
        (void)sqlite3_clear_bindings(query->state);
    } else {
        (void)sqlite3_finalize(query->state);
    }
    query->state = NULL;
}

int64_t sqlite_integer(struct query *query, int column)
{
    return sqlite3_column_int64(query->state, column);
}

const void *sqlite_bytes(struct query *query, int column, size_t *ret_size)
{
    const int type = sqlite3_column_type(query->state, column);
    *ret_size = 0;
    if (type == SQLITE_NULL) return NULL;
    const void *bytes = type == SQLITE_BLOB
                            ? sqlite3_column_blob(query->state, column)
                            : (const void *)sqlite3_column_text(query->state, column);
    *ret_size = (size_t)sqlite3_column_bytes(query->state, column);
    if (bytes == NULL && *ret_size == 0 && type == SQLITE_BLOB) return "";
    if (bytes == NULL) *ret_size = 1;
    return bytes;
}

int64_t sqlite_changed(const struct db *db) { return sqlite3_changes64(sqlite_handle(db)); }
