/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The engine in one SQLite file.
 *
 * Durability: write-ahead log with synchronous=FULL, so that COMMIT returns after fsync. Writes go
 * through one thread that commits all that wait at once (store_write.c); reads have connections of
 * their own and never wait for a write.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "server/store/store_sqlite.h"

enum { SCRUB_WAIT_MS = 100, SQLITE_BATCH_MAX = 512 };

static struct sqlite_place *place_of(const struct store *store) { return store->place; }

static const char *version(const struct store *store)
{
    static char text[32]; /* the same bytes whoever writes them */
    (void)store;
    (void)snprintf(text, sizeof text, "SQLite %s", sqlite3_libversion());
    return text;
}

/* --------------------------------------------------------------------------- open, close */

static enum ischia_code prepare_location(struct sqlite_place *place, enum store_mode mode,
                                         struct ischia_error *err)
{
    TRY(sqlite_make_directory(&place->paths, err));
    const int patience_ms = mode == STORE_SERVE ? SQLITE_LOCK_PATIENCE_MS : 0;
    enum ischia_code code = sqlite_lock(&place->paths, patience_ms, &place->lock_fd, err);
    /* A daemon that serves the store has migrated it; a command beside it only joins in. */
    if (code == ISCHIA_E_STATE && mode == STORE_ADMIN) return ISCHIA_OK;
    return code;
}

static enum ischia_code open_database(struct store *store, enum store_mode mode,
                                      struct ischia_error *err)
{
    int version = 0;
    const struct sqlite_place *place = place_of(store);
    if (place->lock_fd >= 0) TRY(sqlite_make_file(place->paths.database, err));
    TRY(sqlite_look(place->paths.database, mode == STORE_SERVE, &version, err));
    CHECK(version == store_migration_count || place->lock_fd >= 0, err, ISCHIA_E_STATE,
          "the daemon that serves %s is of another version than this program",
          place->paths.directory);
    TRY(sqlite_open(place->paths.database, DB_WRITE, store->busy_timeout_ms, &store->writer, err));
    return sqlite_migrate(store->writer, version, store_migration_count, err);
}

static void give_back_lock(struct sqlite_place *place)
{
    if (place->lock_fd >= 0) (void)close(place->lock_fd);
    place->lock_fd = -1;
}

static enum ischia_code open_place(struct store *store, const struct store_options *options,
                                   struct ischia_error *err)
{
    struct sqlite_place *place = calloc(1, sizeof *place);
    CHECK(place != NULL, err, ISCHIA_E_MEMORY, "no memory for the store");
    place->lock_fd = -1;
    store->place = place;
    TRY(sqlite_paths_of(options->location, &place->paths, err));
    TRY(prepare_location(place, options->mode, err));
    TRY(open_database(store, options->mode, err));
    /* A short-lived command needs the lock only to create or migrate. */
    if (options->mode == STORE_ADMIN) give_back_lock(place);
    return ISCHIA_OK;
}

static void close_place(struct store *store)
{
    if (store->place == NULL) return;
    sqlite_close(store->writer);
    give_back_lock(place_of(store));
    free(store->place);
}

static enum ischia_code add_connection(struct store *store, struct db **ret_db,
                                       struct ischia_error *err)
{
    return sqlite_open(place_of(store)->paths.database, DB_READ, store->busy_timeout_ms, ret_db,
                       err);
}

/* A file is not lost by failing: the next attempt may do. */
static bool is_lost(const struct db *db)
{
    (void)db;
    return false;
}

static int64_t size_of_files(struct store *store, struct db *db)
{
    static const char *const suffixes[] = {"", "-wal", "-shm"};
    int64_t size = 0;
    (void)db;
    for (size_t i = 0; i < sizeof suffixes / sizeof suffixes[0]; i++) {
        char path[SQLITE_PATH_BYTES + 8];
        struct stat status;
        (void)stpcpy(stpcpy(path, place_of(store)->paths.database), suffixes[i]);
        if (stat(path, &status) == 0) size += status.st_size;
    }
    return size;
}

/* ------------------------------------------------------------------------------ scrubbing */

/* Erased rows are overwritten in the database (secure_delete), but older pages that held them are
 * in the write-ahead log until it is emptied. A long read can delay that; it is tried again. */
static void scrub(struct store *store)
{
    sqlite3_busy_timeout(sqlite_handle(store->writer), SCRUB_WAIT_MS);
    int64_t busy = 1;
    if (db_number(store->writer, "PRAGMA wal_checkpoint(TRUNCATE)", &busy, NULL) != ISCHIA_OK)
        busy = 1;
    sqlite3_busy_timeout(sqlite_handle(store->writer), store->busy_timeout_ms);
    store->scrub = busy != 0;
}

const struct engine engine_sqlite = {
    .undoes_one = true,
    .batch_max = SQLITE_BATCH_MAX,
    .open = open_place,
    .close = close_place,
    .connect = add_connection,
    .disconnect = sqlite_close,
    .begin = sqlite_begin,
    .commit = sqlite_commit,
    .roll_back = sqlite_roll_back,
    .is_in_transaction = sqlite_is_in_transaction,
    .mark = sqlite_mark,
    .keep = sqlite_keep,
    .is_lost = is_lost,
    .step = sqlite_step,
    .end = sqlite_end,
    .integer = sqlite_integer,
    .bytes = sqlite_bytes,
    .changed = sqlite_changed,
    .scrub = scrub,
    .size_bytes = size_of_files,
    .version = version,
    .backup = sqlite_backup,
    .restore = sqlite_restore,
};
