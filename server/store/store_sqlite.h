/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_STORE_SQLITE_H
#define ISCHIA_SERVER_STORE_SQLITE_H

#include <sqlite3.h>

#include "server/store/engine.h"

/*
 * Internal to the engine in one SQLite file (store_sqlite*.c): the only header that sees sqlite3.h.
 *
 *   store_sqlite.c        open, close, the table of the engine
 *   store_sqlite_db.c     one connection, its cached statements, errors
 *   store_sqlite_file.c   the file: lock, look before touching, migrations
 *   store_sqlite_copy.c   backup, restore
 */

/* ------------------------------------------------------------------------- connections */

enum sqlite_access { DB_READ, DB_WRITE, DB_LOOK /* read-only: leaves every byte as it is */ };

/* *ret_db is the caller's: sqlite_close. */
ISCHIA_MUST_CHECK enum ischia_code sqlite_open(const char *path, enum sqlite_access access,
                                               int busy_timeout_ms, struct db **ret_db,
                                               struct ischia_error *err);
void sqlite_close(struct db *db); /* NULL allowed */
sqlite3 *sqlite_handle(const struct db *db);

/* Fills *err from the connection's last error, in words for an operator: it cannot `doing`. */
enum ischia_code sqlite_fail(struct db *db, const char *doing, struct ischia_error *err);

/* Runs SQL text that returns nothing. */
ISCHIA_MUST_CHECK enum ischia_code sqlite_execute(struct db *db, const char *sql,
                                                  struct ischia_error *err);

/* What the engine's table says of one connection (engine.h). */
enum ischia_code sqlite_begin(struct store *store, struct db *db, struct ischia_error *err);
enum ischia_code sqlite_commit(struct db *db, struct ischia_error *err);
void sqlite_roll_back(struct db *db);
bool sqlite_is_in_transaction(const struct db *db);
enum ischia_code sqlite_mark(struct db *db, struct ischia_error *err);
enum ischia_code sqlite_keep(struct db *db, bool undo, struct ischia_error *err);
enum ischia_code sqlite_step(struct query *query, bool *ret_row, struct ischia_error *err);
void sqlite_end(struct query *query);
int64_t sqlite_integer(struct query *query, int column);
const void *sqlite_bytes(struct query *query, int column, size_t *ret_size);
int64_t sqlite_changed(const struct db *db);

/* ---------------------------------------------------------------------------- the file */

enum { SQLITE_APPLICATION_ID = 0x49736368 }; /* "Isch", also in 0001_assessments.sql */

enum { SQLITE_PATH_BYTES = 4096 };
struct sqlite_paths {
    char directory[SQLITE_PATH_BYTES];
    char database[SQLITE_PATH_BYTES];
    char lock[SQLITE_PATH_BYTES];
};

/* ISCHIA_E_INPUT: no name, or one that is too long. */
ISCHIA_MUST_CHECK enum ischia_code sqlite_paths_of(const char *location, struct sqlite_paths *ret,
                                                   struct ischia_error *err);

/* Makes the directory when it is missing. */
ISCHIA_MUST_CHECK enum ischia_code sqlite_make_directory(const struct sqlite_paths *paths,
                                                         struct ischia_error *err);
/* How long a daemon waits for the lock of the one before. */
enum { SQLITE_LOCK_PATIENCE_MS = 5000 };
/* Takes the daemon's lock, waiting for at most patience_ms. *ret_fd is closed to give it back.
 * ISCHIA_E_STATE: someone has it. */
ISCHIA_MUST_CHECK enum ischia_code sqlite_lock(const struct sqlite_paths *paths, int patience_ms,
                                               int *ret_fd, struct ischia_error *err);
/* Makes an empty file of mode 0600 unless there is one. */
ISCHIA_MUST_CHECK enum ischia_code sqlite_make_file(const char *path, struct ischia_error *err);
/* Judges a database file without changing it; *ret_version is 0 for an empty one. whole: also walk
 * every page. ISCHIA_E_INPUT (not ours, damaged), ISCHIA_E_STATE (newer). */
ISCHIA_MUST_CHECK enum ischia_code sqlite_look(const char *path, bool whole, int *ret_version,
                                               struct ischia_error *err);
/* Applies migrations one by one up to version `to`, each in a transaction of its own. */
ISCHIA_MUST_CHECK enum ischia_code sqlite_migrate(struct db *db, int from, int to,
                                                  struct ischia_error *err);
/* Makes the file's name survive a power cut. */
ISCHIA_MUST_CHECK enum ischia_code sqlite_sync_directory(const char *file_path,
                                                         struct ischia_error *err);

/* ------------------------------------------------------------------------ the engine's own */

struct sqlite_place {
    struct sqlite_paths paths;
    int lock_fd; /* -1 when not held */
};

/* store_backup and store_restore (store.h). */
enum ischia_code sqlite_backup(struct store *store, const char *path, struct ischia_error *err);
enum ischia_code sqlite_restore(const char *location, const char *path, struct ischia_error *err);

#endif
