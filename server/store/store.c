/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <assert.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "server/store/engine.h"

enum { BUSY_TIMEOUT_MS = 5000, READERS_MAX = 8 };

/* ------------------------------------------------------------------------ which engine */

/* The beginning of a location says which; the last row takes all that are left. */
static const struct {
    const char *scheme;
    const struct engine *engine;
    bool scheme_is_part; /* of what the engine is given */
} engines[] = {
    {"postgresql://", &engine_postgresql, true},
    {"postgres://", &engine_postgresql, true},
    {"sqlite:", &engine_sqlite, false},
    {"", &engine_sqlite, false},
};

static const struct engine *find_engine(const char *location, const char **ret_rest)
{
    size_t i = 0;
    if (location == NULL) location = "";
    while (strncmp(location, engines[i].scheme, strlen(engines[i].scheme)) != 0) i++;
    *ret_rest = engines[i].scheme_is_part ? location : location + strlen(engines[i].scheme);
    return engines[i].engine;
}

static int64_t system_now_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

int64_t store_now_ms(const struct store *store)
{
    return store->now_ms != NULL ? store->now_ms() : system_now_ms();
}

/* --------------------------------------------------------------------- reader connections */

/* One more connection, made without the lock: that may take time. The lock is held before and
 * after. */
static enum ischia_code add_reader(struct store *store, struct db **ret_db,
                                   struct ischia_error *err)
{
    store->reader_count++;
    (void)pthread_mutex_unlock(&store->reader_lock);
    const enum ischia_code code = store->engine->connect(store, ret_db, err);
    (void)pthread_mutex_lock(&store->reader_lock);
    if (code != ISCHIA_OK) store->reader_count--;
    return code;
}

enum ischia_code reader_take(struct store *store, struct db **ret_db, struct ischia_error *err)
{
    enum ischia_code code = ISCHIA_OK;
    (void)pthread_mutex_lock(&store->reader_lock);
    if (store->idle_readers == NULL && store->reader_count < READERS_MAX) {
        code = add_reader(store, ret_db, err);
        if (code == ISCHIA_OK) {
            (void)pthread_mutex_unlock(&store->reader_lock);
            return ISCHIA_OK;
        }
    }
    /* Out of descriptors, perhaps: the connections that are open serve all the same. One is
     * opened with the store, so that there is always one to wait for. */
    while (store->idle_readers == NULL && store->reader_count > 0)
        (void)pthread_cond_wait(&store->reader_free, &store->reader_lock);
    struct db *db = store->idle_readers;
    assert(db != NULL || code != ISCHIA_OK);
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

void store_set_idempotency(struct store *store, int64_t idempotency_ms)
{
    atomic_store(&store->idempotency_ms,
                 idempotency_ms > 0 ? idempotency_ms : STORE_IDEMPOTENCY_MS);
}

static void set_up(struct store *store, const struct store_options *options)
{
    store->last = &store->first;
    store->busy_timeout_ms =
        options->busy_timeout_ms > 0 ? options->busy_timeout_ms : BUSY_TIMEOUT_MS;
    store_set_idempotency(store, options->idempotency_ms);
    store->now_ms = options->now_ms;
    (void)pthread_mutex_init(&store->reader_lock, NULL);
    (void)pthread_cond_init(&store->reader_free, NULL);
    (void)pthread_mutex_init(&store->write_lock, NULL);
    (void)pthread_cond_init(&store->write_ready, NULL);
}

static void tear_down(struct store *store)
{
    while (store->idle_readers != NULL) {
        struct db *db = store->idle_readers;
        store->idle_readers = db->next;
        store->engine->disconnect(db);
    }
    store->engine->close(store);
    (void)pthread_cond_destroy(&store->write_ready);
    (void)pthread_mutex_destroy(&store->write_lock);
    (void)pthread_cond_destroy(&store->reader_free);
    (void)pthread_mutex_destroy(&store->reader_lock);
    free(store);
}

enum ischia_code store_open(const struct store_options *options, struct store **ret_store,
                            struct ischia_error *err)
{
    struct store_options own = *options;
    struct store *store = calloc(1, sizeof *store);
    CHECK(store != NULL, err, ISCHIA_E_MEMORY, "no memory for the store");
    store->engine = find_engine(options->location, &own.location);
    set_up(store, options);
    enum ischia_code code = store->engine->open(store, &own, err);
    if (code == ISCHIA_OK) code = first_reader(store, err);
    if (code == ISCHIA_OK) code = writer_start(store, err);
    if (code != ISCHIA_OK) {
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
    tear_down(store);
}

/* -------------------------------------------------------------------- the engine's affairs */

const char *store_engine(const struct store *store) { return store->engine->version(store); }

bool store_is_on_server(const char *location)
{
    const char *rest = NULL;
    return find_engine(location, &rest)->watch != NULL;
}

int store_schema_version(void) { return store_migration_count; }

enum ischia_code store_backup(struct store *store, const char *path, struct ischia_error *err)
{
    return store->engine->backup(store, path, err);
}

enum ischia_code store_restore(const char *location, const char *backup_path,
                               struct ischia_error *err)
{
    const char *rest = NULL;
    const struct engine *engine = find_engine(location, &rest);
    return engine->restore(rest, backup_path, err);
}

void store_watch(struct store *store, const struct store_watcher *watcher)
{
    if (store->engine->watch != NULL) store->engine->watch(store, watcher);
}

void store_tell_progress(struct store *store, const struct uuid *id,
                         const struct store_progress *progress)
{
    if (store->engine->tell_progress != NULL) store->engine->tell_progress(store, id, progress);
}
