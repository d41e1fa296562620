/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_STORE_ENGINE_H
#define ISCHIA_SERVER_STORE_ENGINE_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "server/store/store.h"

/*
 * Internal to the store. What an assessment, a study, a token goes through is written once, in
 * files that know statements and transactions but no engine; an engine is a table of functions that
 * runs them.
 *
 *   store.c            open, close, which engine, the connections that read
 *   store_sql.c        the statements, where engines differ in two forms
 *   store_query.c      one run of a statement
 *   store_write.c      the writer thread and its group commit
 *   store_job.c        accepting and the life of a job      store_read.c  get, list, numbers
 *   store_admin.c      tokens, audit                        store_study.c studies
 *   store_exchange.c   outbox, feedback                     store_move.c  from store to store
 *   store_sqlite*.c    one file on this machine             store_postgresql*.c  a server for many
 */

/* ----------------------------------------------------------------------------- statements */

enum sql {
    SQL_CHANGE_ADD,
    SQL_KEY_FIND,
    SQL_KEY_PUT,
    SQL_KEY_EXPIRE,
    SQL_SOLUTION_FIND,
    SQL_SOLUTION_ADD,
    SQL_SOLUTION_DROP,
    SQL_QUEUED,
    SQL_ACCEPT_LOOK,
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
    SQL_TOKEN_FORGET,
    SQL_TOKEN_EPOCH_MOVE,
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
    SQL_FINISHED,
    SQL_STUDY_WAITING,
    SQL_COUNT
};

/* A statement, or a piece of one, as each engine wants it; postgresql NULL: the same. Parameters
 * are written ?, or ?1, ?2 ... */
struct sql_text {
    const char *sqlite, *postgresql;
    bool rows_stream; /* so many rows that they are not all taken into memory at once */
};
extern const struct sql_text sql_text[SQL_COUNT];
struct engine;
const char *sql_for(const struct engine *engine, const struct sql_text *text);
/* The conditions of a listing of assessments (store_read.c). */
extern const struct sql_text sql_alternative[STORE_ALTERNATIVE_KIND_COUNT];
/* The columns that read_assessment (store_read.c) expects, of "assessment a" and "solution s" and
 * "origin o". */
extern const char *const sql_assessment_columns;

struct migration {
    int version;
    const char *name;
    const char *sqlite, *postgresql;
};
extern const struct migration store_migrations[]; /* generated from the numbered *.sql */
extern const int store_migration_count;

/* ------------------------------------------------------------------------ one connection */

/* The engine's own struct begins with this one. */
struct db {
    const struct engine *engine;
    struct db *next; /* in the store's list of idle readers */
};

enum value_kind { VALUE_NULL, VALUE_INTEGER, VALUE_TEXT, VALUE_BLOB };
struct value {
    enum value_kind kind;
    int64_t integer;
    const void *bytes; /* VALUE_TEXT: ends in NUL */
    size_t size;       /* without the NUL */
};
/* A listing has the most: its plain conditions and up to two values an alternative. */
enum { QUERY_VALUES_MAX = 20 + 2 * STORE_ALTERNATIVES_MAX };

/*
 * One run of a statement: put the values in order of the ?s, step, read columns, end. query_end
 * must follow query_begin whatever happened between; it may be called twice. More values than
 * QUERY_VALUES_MAX are a mistake of ours.
 */
struct query {
    struct db *db;
    enum sql sql; /* SQL_COUNT: text */
    const char *text;
    bool rows_stream; /* as of sql_text; a caller may ask for it after query_begin_text */
    int count;
    struct value value[QUERY_VALUES_MAX];
    bool begun; /* the engine's from the first step on, as the next two */
    void *state;
    int row;
};
void query_begin(struct query *ret, struct db *db, enum sql sql);
/* The same for a text that is not kept; it must live until query_end. */
void query_begin_text(struct query *ret, struct db *db, const char *text);
/* What is put must stay as it is until query_end. */
void query_put_integer(struct query *query, int64_t value);
void query_put_text(struct query *query, const char *text); /* NULL: NULL */
void query_put_blob(struct query *query, const void *bytes, size_t size);
ISCHIA_MUST_CHECK enum ischia_code query_step(struct query *query, bool *ret_row,
                                              struct ischia_error *err);
void query_end(struct query *query);
/* Runs a statement whose rows, if it has any, are of no interest, and ends it. In a transaction its
 * failure may show at a later statement, or at the commit. */
ISCHIA_MUST_CHECK enum ischia_code query_run(struct query *query, struct ischia_error *err);
/* The same, at once; *ret: how many rows it has changed. */
ISCHIA_MUST_CHECK enum ischia_code query_change(struct query *query, int64_t *ret,
                                                struct ischia_error *err);
/* Runs a statement without parameters. */
ISCHIA_MUST_CHECK enum ischia_code db_run(struct db *db, enum sql sql, struct ischia_error *err);
/* Steps once, ends, and returns the first column as a number; `otherwise` when there is no row. */
ISCHIA_MUST_CHECK enum ischia_code query_number(struct query *query, int64_t otherwise,
                                                int64_t *ret, struct ischia_error *err);
/* query_number of a text without parameters. */
ISCHIA_MUST_CHECK enum ischia_code db_number(struct db *db, const char *text, int64_t *ret,
                                             struct ischia_error *err);

/* A column of the present row; 0 for NULL. */
int64_t query_integer(struct query *query, int column);
/* NULL stays NULL; malloc'ed, the caller's. */
ISCHIA_MUST_CHECK enum ischia_code query_text(struct query *query, int column, char **ret,
                                              struct ischia_error *err);
/* Valid until the next step; NULL stays NULL. */
const char *query_peek_text(struct query *query, int column);
/* Into `size` bytes, cut to fit; NULL becomes "". */
void query_copy_text(struct query *query, int column, char *ret, size_t size);
/* Copies a column of exactly `size` bytes; ISCHIA_E_IO when it is not. */
ISCHIA_MUST_CHECK enum ischia_code query_blob(struct query *query, int column, void *ret,
                                              size_t size, struct ischia_error *err);

/* ------------------------------------------------------------------------------ the engine */

struct store;
struct write;

struct engine {
    /* After a write that failed, its neighbours in the same transaction can still be kept. */
    bool undoes_one;
    bool is_postgresql; /* which of two forms a statement has */
    int batch_max;      /* writes in one transaction          */

    /* Fills store->place and store->writer, brings the schema up to date. On failure `close` is
     * called as well. */
    enum ischia_code (*open)(struct store *store, const struct store_options *options,
                             struct ischia_error *err);
    void (*close)(struct store *store); /* after the writer has stopped */
    enum ischia_code (*connect)(struct store *store, struct db **ret_db, struct ischia_error *err);
    void (*disconnect)(struct db *db);

    /* begin waits for whoever writes: from it to commit nobody else does, on any machine. */
    enum ischia_code (*begin)(struct store *store, struct db *db, struct ischia_error *err);
    enum ischia_code (*commit)(struct db *db, struct ischia_error *err);
    void (*roll_back)(struct db *db); /* also when there is nothing to undo */
    bool (*is_in_transaction)(const struct db *db);
    /* One write of a transaction is about to run; what it did is to be kept, or undone. NULL unless
     * undoes_one. */
    enum ischia_code (*mark)(struct db *db, struct ischia_error *err);
    enum ischia_code (*keep)(struct db *db, bool undo, struct ischia_error *err);
    bool (*is_lost)(const struct db *db); /* the connection: trying at once again is in vain */

    enum ischia_code (*step)(struct query *query, bool *ret_row, struct ischia_error *err);
    /* query_run without the end; NULL: a step does it */
    enum ischia_code (*run)(struct query *query, struct ischia_error *err);
    void (*end)(struct query *query);
    /* Columns of the present row. *ret_size without the NUL that ends a text. NULL: it is NULL, or,
     * when *ret_size is not 0, there was no memory. */
    int64_t (*integer)(struct query *query, int column);
    const void *(*bytes)(struct query *query, int column, size_t *ret_size);
    int64_t (*changed)(const struct db *db); /* rows, by the statement that was run last */

    void (*scrub)(struct store *store); /* NULL: erased bytes are the engine's own affair */
    int64_t (*size_bytes)(struct store *store, struct db *db);
    const char *(*version)(const struct store *store);
    enum ischia_code (*backup)(struct store *store, const char *path, struct ischia_error *err);
    enum ischia_code (*restore)(const char *location, const char *path, struct ischia_error *err);
    /* Both NULL: nobody else writes, and nobody is to be told. */
    void (*watch)(struct store *store, const struct store_watcher *watcher);
    void (*tell_progress)(struct store *store, const struct uuid *id,
                          const struct store_progress *progress);
};
extern const struct engine engine_sqlite, engine_postgresql;

/* ------------------------------------------------------------------------------- the store */

struct store {
    const struct engine *engine;
    void *place; /* the engine's own */
    int busy_timeout_ms;
    atomic_llong idempotency_ms;
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
    struct audit_head { /* the writer thread's, within one transaction */
        bool known;
        int64_t seq;
        unsigned char hash[STORE_DIGEST_BYTES];
    } audit_head;
    bool scrub; /* erased bytes are still in the engine's log; the writer thread's alone */
    uint64_t writes, commits, write_failures, audit_failures;
    uint64_t latency_count[STORE_LATENCY_BUCKETS];
    double latency_sum_ms;
};

int64_t store_now_ms(const struct store *store); /* by the clock it was opened with */

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
    bool erases; /* what it removes must not survive in the engine's log */

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
/* running -> queued for every assessment and point that runs and is nobody's. operation: int, how
 * many assessments. */
ISCHIA_MUST_CHECK enum ischia_code recover_run(struct store *store, struct db *db, void *operation,
                                               struct ischia_error *err);

#endif
