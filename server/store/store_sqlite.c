/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The store in one SQLite file: opening, closing and the connections that read.
 *
 * Durability: write-ahead log with synchronous=FULL, so that COMMIT returns after fsync. Writes go
 * through one thread that commits all that wait at once (store_sqlite_write.c); reads have
 * connections of their own and never wait for a write.
 */
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "server/store/store_sqlite.h"

enum { BUSY_TIMEOUT_MS = 5000, READERS_MAX = 8 };

const char *store_engine(void)
{
    static char text[32]; /* the same bytes whoever writes them */
    (void)sqlite3_snprintf(sizeof text, text, "SQLite %s", sqlite3_libversion());
    return text;
}

int64_t sqlite_system_now_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

int64_t sqlite_now_ms(const struct store *store) { return store->now_ms(); }

/* --------------------------------------------------------------------- reader connections */

enum ischia_code reader_take(struct store *store, struct db **ret_db, struct ischia_error *err)
{
    enum ischia_code code = ISCHIA_OK;
    (void)pthread_mutex_lock(&store->reader_lock);
    if (store->idle_readers == NULL && store->reader_count < READERS_MAX) {
        struct db *db = NULL;
        code = db_open(store->paths.database, DB_READ, store->busy_timeout_ms, &db, err);
        if (code == ISCHIA_OK) {
            store->reader_count++;
            (void)pthread_mutex_unlock(&store->reader_lock);
            *ret_db = db;
            return ISCHIA_OK;
        }
    }
    /* Out of descriptors, perhaps: the connections that are open serve all the same. One is
     * opened with the store, so that there is always one to wait for. */
    while (store->idle_readers == NULL && store->reader_count > 0)
        (void)pthread_cond_wait(&store->reader_free, &store->reader_lock);
    struct db *db = store->idle_readers;
    if (db != NULL) {
        store->idle_readers = db->next;
        *ret_db = db;
        code = ISCHIA_OK;
    }
    (void)pthread_mutex_unlock(&store->reader_lock);
    return code;
}

void reader_give(struct store *store, struct db *db)
{
    (void)pthread_mutex_lock(&store->reader_lock);
    db->next = store->idle_readers;
    store->idle_readers = db;
    (void)pthread_cond_signal(&store->reader_free);
    (void)pthread_mutex_unlock(&store->reader_lock);
}

static enum ischia_code first_reader(struct store *store, struct ischia_error *err)
{
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    reader_give(store, db);
    return ISCHIA_OK;
}

/* --------------------------------------------------------------------------- open, close */

static enum ischia_code prepare_location(struct store *store, enum store_mode mode,
                                         struct ischia_error *err)
{
    TRY(sqlite_make_directory(&store->paths, err));
    const int patience_ms = mode == STORE_SERVE ? SQLITE_LOCK_PATIENCE_MS : 0;
    enum ischia_code code = sqlite_lock(&store->paths, patience_ms, &store->lock_fd, err);
    /* A daemon that serves the store has migrated it; a command beside it only joins in. */
    if (code == ISCHIA_E_STATE && mode == STORE_ADMIN) return ISCHIA_OK;
    return code;
}

static enum ischia_code open_database(struct store *store, enum store_mode mode,
                                      struct ischia_error *err)
{
    int version = 0;
    if (store->lock_fd >= 0) TRY(sqlite_make_file(store->paths.database, err));
    TRY(sqlite_look(store->paths.database, mode == STORE_SERVE, &version, err));
    CHECK(version == sqlite_migration_count || store->lock_fd >= 0, err, ISCHIA_E_STATE,
          "the daemon that serves %s is of another version than this program",
          store->paths.directory);
    TRY(db_open(store->paths.database, DB_WRITE, store->busy_timeout_ms, &store->writer, err));
    TRY(sqlite_migrate(store->writer, version, sqlite_migration_count, err));
    return first_reader(store, err);
}

static void give_back_lock(struct store *store)
{
    if (store->lock_fd >= 0) (void)close(store->lock_fd);
    store->lock_fd = -1;
}

static void close_database(struct store *store)
{
    while (store->idle_readers != NULL) {
        struct db *db = store->idle_readers;
        store->idle_readers = db->next;
        db_close(db);
    }
    db_close(store->writer);
    give_back_lock(store);
}

static void set_up(struct store *store, const struct store_options *options)
{
    store->lock_fd = -1;
    store->last = &store->first;
    store->busy_timeout_ms =
        options->busy_timeout_ms > 0 ? options->busy_timeout_ms : BUSY_TIMEOUT_MS;
    store->idempotency_ms =
        options->idempotency_ms > 0 ? options->idempotency_ms : STORE_IDEMPOTENCY_MS;
    store->now_ms = options->now_ms != NULL ? options->now_ms : sqlite_system_now_ms;
    (void)pthread_mutex_init(&store->reader_lock, NULL);
    (void)pthread_cond_init(&store->reader_free, NULL);
    (void)pthread_mutex_init(&store->write_lock, NULL);
    (void)pthread_cond_init(&store->write_ready, NULL);
}

static void tear_down(struct store *store)
{
    (void)pthread_cond_destroy(&store->write_ready);
    (void)pthread_mutex_destroy(&store->write_lock);
    (void)pthread_cond_destroy(&store->reader_free);
    (void)pthread_mutex_destroy(&store->reader_lock);
    free(store);
}

enum ischia_code store_open(const struct store_options *options, struct store **ret_store,
                            struct ischia_error *err)
{
    struct store *store = calloc(1, sizeof *store);
    CHECK(store != NULL, err, ISCHIA_E_MEMORY, "no memory for the store");
    set_up(store, options);
    enum ischia_code code = sqlite_paths_of(options->location, &store->paths, err);
    if (code == ISCHIA_OK) code = prepare_location(store, options->mode, err);
    if (code == ISCHIA_OK) code = open_database(store, options->mode, err);
    /* A short-lived command needs the lock only to create or migrate. */
    if (code == ISCHIA_OK && options->mode == STORE_ADMIN) give_back_lock(store);
    if (code == ISCHIA_OK) code = writer_start(store, err);
    if (code != ISCHIA_OK) {
        close_database(store);
        tear_down(store);
        return code;
    }
    *ret_store = store;
    return ISCHIA_OK;
}

void store_close(struct store *store)
{
    if (store == NULL) return;
    writer_stop(store);
    close_database(store);
    tear_down(store);
}
