/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_STORE_SQLITE_H
#define ISCHIA_SERVER_STORE_SQLITE_H

#include <pthread.h>
#include <sqlite3.h>
#include <stdbool.h>
#include <stdint.h>

#include "server/store/store.h"

/*
 * Internal to the SQLite store (store_sqlite*.c): the only header that sees sqlite3.h.
 *
 *   store_sqlite.c        open, close, the reader connections
 *   store_sqlite_file.c   the file: lock, look before touching, migrations
 *   store_sqlite_db.c     one connection, its cached statements, queries, errors
 *   store_sqlite_write.c  the writer thread and its group commit
 *   store_sqlite_job.c    accepting and the life of a job
 *   store_sqlite_read.c   get, list, changes, numbers
 *   store_sqlite_admin.c  tokens, audit      store_sqlite_copy.c  backup, restore
 *   store_sqlite_exchange.c  outbox, feedback      store_sqlite_study.c  studies
 */

/* ------------------------------------------------------------------------- connections */

/* Every statement that is kept prepared; its text is in sql_text (store_sqlite_db.c). */
enum sql {
    SQL_BEGIN,
    SQL_COMMIT,
    SQL_ROLLBACK,
    SQL_SAVEPOINT,
    SQL_SAVEPOINT_UNDO,
    SQL_SAVEPOINT_DONE,
    SQL_CHANGE_ADD,
    SQL_KEY_FIND,
    SQL_KEY_PUT,
    SQL_KEY_EXPIRE,
    SQL_SOLUTION_FIND,
    SQL_SOLUTION_ADD,
    SQL_SOLUTION_DROP,
    SQL_TALLY,
    SQL_TALLY_ALL,
    SQL_OLDEST_QUEUED,
    SQL_ACCEPT,
    SQL_STATE,
    SQL_NEXT,
    SQL_START,
    SQL_REQUEUE,
    SQL_SUCCEED,
    SQL_FAIL,
    SQL_CANCEL,
    SQL_RUNNING,
    SQL_ERASE,
    SQL_TOO_OLD,
    SQL_TOO_MANY,
    SQL_GET,
    SQL_FIELD,
    SQL_CHANGES,
    SQL_CHANGES_LAST,
    SQL_TOKEN_ADD,
    SQL_TOKEN_GET,
    SQL_TOKEN_LIST,
    SQL_TOKEN_REVOKE,
    SQL_TOKEN_EPOCH,
    SQL_AUDIT_HEAD,
    SQL_AUDIT_ADD,
    SQL_AUDIT_LIST,
    SQL_PROBE,
    SQL_ORIGIN_ADD,
    SQL_OUTBOX_OPEN,
    SQL_OUTBOX_CLOSE,
    SQL_OUTBOX_CLEAR,
    SQL_OUTBOX_FILL,
    SQL_OUTBOX_MOVE,
    SQL_OUTBOX_NEXT,
    SQL_OUTBOX_DONE,
    SQL_OUTBOX_RETRY,
    SQL_OUTBOX_LIST,
    SQL_OUTBOX_REVIVE,
    SQL_FEEDBACK_ADD,
    SQL_FEEDBACK_LIST,
    SQL_STUDY_KEY_FIND,
    SQL_STUDY_KEY_FREE,
    SQL_STUDY_ADD,
    SQL_STUDY_POINT_ADD,
    SQL_STUDY_GET,
    SQL_STUDY_LIST,
    SQL_STUDY_COUNT,
    SQL_STUDY_POINTS,
    SQL_STUDY_NEXT,
    SQL_STUDY_KNOWN,
    SQL_STUDY_BEGIN,
    SQL_STUDY_POINT_PUT,
    SQL_STUDY_POINT_GET,
    SQL_STUDY_END,
    SQL_STUDY_SEQ,
    SQL_STUDY_OVER,
    SQL_STUDY_CANCEL_POINTS,
    SQL_STUDY_CANCEL,
    SQL_STUDY_RUNNING,
    SQL_STUDY_ERASE,
    SQL_STUDY_TOO_OLD,
    SQL_STUDY_RECOVER,
    SQL_COUNT
};

/* The columns that read_assessment (store_sqlite_read.c) expects, of "assessment a" and
 * "solution s" and "origin o". */
extern const char *const sqlite_assessment_columns;

struct db {
    sqlite3 *handle;
    sqlite3_stmt *kept[SQL_COUNT]; /* prepared when first used */
    struct db *next;               /* in the store's list of idle readers */
};

enum db_access { DB_READ, DB_WRITE, DB_LOOK /* read-only: leaves every byte as it is */ };

/* *ret_db is the caller's: db_close. */
ISCHIA_MUST_CHECK enum ischia_code db_open(const char *path, enum db_access access,
                                           int busy_timeout_ms, struct db **ret_db,
                                           struct ischia_error *err);
void db_close(struct db *db); /* NULL allowed */

/* Fills *err from the connection's last error, in words for an operator: it cannot `doing`. */
enum ischia_code db_fail(struct db *db, const char *doing, struct ischia_error *err);

/* Runs SQL text that returns nothing. */
ISCHIA_MUST_CHECK enum ischia_code db_execute(struct db *db, const char *sql,
                                              struct ischia_error *err);
/* Runs SQL text and reads the first column of the first row as a number; 0 when there is no row. */
ISCHIA_MUST_CHECK enum ischia_code db_number(struct db *db, const char *sql, int64_t *ret,
                                             struct ischia_error *err);

/*
 * One run of a statement: bind in order of the ?s, step, read columns, end. A failed bind is
 * remembered and reported by the first step. query_end must follow query_begin whatever happened
 * between; it may be called twice.
 */
struct query {
    struct db *db;
    sqlite3_stmt *statement;
    int bound;
    int failed; /* the first SQLite code that was not SQLITE_OK */
    bool kept;
};
ISCHIA_MUST_CHECK enum ischia_code query_begin(struct query *ret, struct db *db, enum sql sql,
                                               struct ischia_error *err);
/* The same for a text that is not kept. */
ISCHIA_MUST_CHECK enum ischia_code query_begin_text(struct query *ret, struct db *db,
                                                    const char *text, struct ischia_error *err);
/* Bound memory must stay as it is until query_end. */
void query_put_integer(struct query *query, int64_t value);
void query_put_text(struct query *query, const char *text); /* NULL: NULL */
void query_put_blob(struct query *query, const void *bytes, size_t size);
ISCHIA_MUST_CHECK enum ischia_code query_step(struct query *query, bool *ret_row,
                                              struct ischia_error *err);
void query_end(struct query *query);
/* Steps a statement that returns no rows, and ends it. */
ISCHIA_MUST_CHECK enum ischia_code query_run(struct query *query, struct ischia_error *err);
/* Runs a kept statement without parameters. */
ISCHIA_MUST_CHECK enum ischia_code db_run(struct db *db, enum sql sql, struct ischia_error *err);

/* A column of the present row; 0 for NULL. */
int64_t query_integer(struct query *query, int column);
/* NULL stays NULL; malloc'ed, the caller's. */
ISCHIA_MUST_CHECK enum ischia_code query_text(struct query *query, int column, char **ret,
                                              struct ischia_error *err);
/* Copies a column of exactly `size` bytes; ISCHIA_E_IO when it is not. */
ISCHIA_MUST_CHECK enum ischia_code query_blob(struct query *query, int column, void *ret,
                                              size_t size, struct ischia_error *err);

/* ---------------------------------------------------------------------------- the file */

struct sqlite_migration {
    int version;
    const char *name;
    const char *sql;
};
extern const struct sqlite_migration sqlite_migrations[]; /* generated from *.sql */
extern const int sqlite_migration_count;

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

/* --------------------------------------------------------------------------- the store */

struct write;

struct store {
    struct sqlite_paths paths;
    int lock_fd; /* -1 when not held */
    int busy_timeout_ms;
    int64_t idempotency_ms;
    int64_t (*now_ms)(void);

    pthread_mutex_t reader_lock;
    pthread_cond_t reader_free;
    struct db *idle_readers;
    int reader_count; /* open, idle or not */

    struct db *writer; /* the writer thread's alone */
    pthread_t writer_thread;
    pthread_mutex_t write_lock; /* guards what follows */
    pthread_cond_t write_ready;
    struct write *first, **last; /* waiting, in order */
    bool closing;
    bool scrub; /* erased bytes are still in the write-ahead log; the writer thread's alone */
    uint64_t writes, commits, write_failures, audit_failures;
    uint64_t latency_count[STORE_LATENCY_BUCKETS];
    double latency_sum_ms;
};

int64_t sqlite_now_ms(const struct store *store); /* by the clock it was opened with */
int64_t sqlite_system_now_ms(void);               /* by CLOCK_REALTIME */

/* Borrows a reader connection; waits when all are lent and no more can be opened. */
ISCHIA_MUST_CHECK enum ischia_code reader_take(struct store *store, struct db **ret_db,
                                               struct ischia_error *err);
void reader_give(struct store *store, struct db *db);

/*
 * One write: `run` is called on the writer thread inside a transaction, perhaps more than once
 * (when the commit that it was part of failed and it is tried alone), so it must overwrite its
 * outputs, not add to them. When it fails its changes are undone and those of its neighbours kept.
 */
struct write {
    enum ischia_code (*run)(struct store *store, struct db *db, void *operation,
                            struct ischia_error *err);
    void *operation;
    /* NULL: somebody waits in write_run. Else called after the commit with the outcome in code and
     * err; it frees the write. */
    void (*done)(struct store *store, struct write *write);
    bool erases; /* what it removes must not survive in the write-ahead log */

    enum ischia_code code;
    struct ischia_error err;
    struct write *next;
    double begun_ms;
    void *waiter; /* the semaphore of write_run */
};

/* Queues the write and waits for its commit. */
ISCHIA_MUST_CHECK enum ischia_code write_run(struct store *store, struct write *write,
                                             struct ischia_error *err);
/* Queues it (write->done is set). On an error done is not called and the write is the caller's. */
ISCHIA_MUST_CHECK enum ischia_code write_later(struct store *store, struct write *write,
                                               struct ischia_error *err);

/* The writer thread; it uses store->writer from now on. */
ISCHIA_MUST_CHECK enum ischia_code writer_start(struct store *store, struct ischia_error *err);
/* Commits what waits, ends the thread. */
void writer_stop(struct store *store);

/* Adds to the change log; *ret_seq is its number. */
ISCHIA_MUST_CHECK enum ischia_code change_add(struct store *store, struct db *db,
                                              enum store_change_kind kind, const struct uuid *id,
                                              int64_t *ret_seq, struct ischia_error *err);
/* running -> queued for every running assessment. */
ISCHIA_MUST_CHECK enum ischia_code recover_run(struct store *store, struct db *db, void *operation,
                                               struct ischia_error *err);

#endif
