/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The engine on a PostgreSQL server, for any number of daemons. Tables are in a schema of their
 * own, "ischia", of the database that the location names: one store a database.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/store/store_postgresql.h"

/* Of other daemons too: the longer a transaction, the longer they wait. */
enum { PG_BATCH_MAX = 64 };

static struct pg_place *place_of(const struct store *store) { return store->place; }

static const char *version(const struct store *store) { return place_of(store)->version; }

/* --------------------------------------------------------------------------- migrations */

static enum ischia_code ask(struct db *db, const char *text, int64_t *ret, struct ischia_error *err)
{
    *ret = 0;
    return pg_execute(db, text, ret, err);
}

/* *ret_version: 0 for an empty database. Changes nothing. */
static enum ischia_code look(struct db *db, int64_t *ret_version, struct ischia_error *err)
{
    int64_t marked = 0, tables = 0;
    TRY(ask(db, "SELECT count(*) FROM pg_tables WHERE schemaname = 'ischia'", &tables, err));
    TRY(ask(db,
            "SELECT count(*) FROM pg_tables WHERE schemaname = 'ischia' AND "
            "tablename = 'schema_version'",
            &marked, err));
    CHECK(marked == 1 || tables == 0, err, ISCHIA_E_INPUT,
          "the database has a schema ischia that is not one of Ischia's; it was left as it is");
    *ret_version = 0;
    if (marked == 1) TRY(ask(db, "SELECT version FROM schema_version", ret_version, err));
    CHECK(*ret_version <= store_migration_count, err, ISCHIA_E_STATE,
          "the database was written by a newer Ischia (schema %lld, this program knows %d): use "
          "that program, or restore a dump made with this one; it was left as it is",
          (long long)*ret_version, store_migration_count);
    return ISCHIA_OK;
}

static enum ischia_code make_schema(struct db *db, struct ischia_error *err)
{
    int64_t there = 0;
    TRY(ask(db, "SELECT count(*) FROM pg_namespace WHERE nspname = 'ischia'", &there, err));
    if (there == 0) TRY(pg_execute(db, "CREATE SCHEMA ischia", NULL, err));
    return pg_execute(db,
                      "CREATE TABLE schema_version (version bigint NOT NULL);"
                      "INSERT INTO schema_version VALUES (0)",
                      NULL, err);
}

static enum ischia_code apply(struct db *db, int64_t from, struct ischia_error *err)
{
    char mark[64];
    for (int i = (int)from; i < store_migration_count; i++)
        TRY(pg_execute(db, store_migrations[i].postgresql, NULL, err));
    (void)snprintf(mark, sizeof mark, "UPDATE schema_version SET version = %d",
                   store_migration_count);
    return pg_execute(db, mark, NULL, err);
}

/* A daemon brings an older store to its own schema; those of the older version are refused from
 * then on. A short-lived command does so only where no daemon is. */
static enum ischia_code migrate_locked(struct db *db, enum store_mode mode,
                                       struct ischia_error *err)
{
    int64_t version = 0, daemons = 0;
    TRY(look(db, &version, err));
    if (version == store_migration_count) return ISCHIA_OK;
    if (version > 0 && mode == STORE_ADMIN)
        TRY(ask(db, "SELECT count(*) FROM daemon", &daemons, err));
    CHECK(daemons == 0, err, ISCHIA_E_STATE,
          "the daemons that serve the database are of another version than this program");
    if (version == 0) TRY(make_schema(db, err));
    return apply(db, version, err);
}

/* All in one transaction, under the lock of those who write. */
static enum ischia_code migrate(struct db *db, enum store_mode mode, struct ischia_error *err)
{
    TRY(pg_execute(db, "BEGIN; SELECT pg_advisory_xact_lock(1232298856)", NULL, err));
    enum ischia_code code = migrate_locked(db, mode, err);
    if (code == ISCHIA_OK) return pg_execute(db, "COMMIT", NULL, err);
    (void)!pg_execute(db, "ROLLBACK", NULL, NULL);
    return code;
}

/* --------------------------------------------------------------------------- open, close */

static enum ischia_code check_location(const char *location, struct ischia_error *err)
{
    char *words = NULL;
    PQconninfoOption *options = PQconninfoParse(location, &words);
    if (options != NULL) {
        PQconninfoFree(options);
        return ISCHIA_OK;
    }
    const enum ischia_code code =
        FAIL(err, ISCHIA_E_INPUT, "the location of the store is no PostgreSQL address: %.*s",
             words == NULL ? 0 : (int)strcspn(words, "\n"), words == NULL ? "" : words);
    PQfreemem(words);
    return code;
}

static void note_version(struct pg_place *place, const struct db *db)
{
    const int number = PQserverVersion(pg_connection(db));
    (void)snprintf(place->version, sizeof place->version, "PostgreSQL %d.%d", number / 10000,
                   number % 10000);
}

static enum ischia_code open_place(struct store *store, const struct store_options *options,
                                   struct ischia_error *err)
{
    struct pg_place *place = calloc(1, sizeof *place);
    CHECK(place != NULL, err, ISCHIA_E_MEMORY, "no memory for the store");
    store->place = place;
    place->mode = options->mode;
    place->location = strdup(options->location);
    CHECK(place->location != NULL, err, ISCHIA_E_MEMORY, "no memory for the store");
    TRY(check_location(place->location, err));
    TRY(pg_open(place, PG_WRITER, &store->writer, err));
    TRY(migrate(store->writer, options->mode, err));
    note_version(place, store->writer);
    return options->mode == STORE_SERVE ? fleet_start(store, err) : ISCHIA_OK;
}

static void close_place(struct store *store)
{
    struct pg_place *place = place_of(store);
    if (place == NULL) return;
    fleet_stop(place->fleet);
    pg_close(store->writer);
    free(place->location);
    free(place);
}

static enum ischia_code add_connection(struct store *store, struct db **ret_db,
                                       struct ischia_error *err)
{
    return pg_open(place_of(store), PG_READER, ret_db, err);
}

/* ----------------------------------------------------------------------------- the rest */

static int64_t size_bytes(struct store *store, struct db *db)
{
    int64_t size = 0;
    (void)store;
    if (db_number(db, "SELECT pg_database_size(current_database())", &size, NULL) != ISCHIA_OK)
        return 0;
    return size;
}

/* A server has tools of its own, which know its log and its replicas. */
static enum ischia_code backup(struct store *store, const char *path, struct ischia_error *err)
{
    (void)store, (void)path;
    return FAIL(err, ISCHIA_E_INPUT,
                "the store is on a PostgreSQL server: use pg_dump --schema=ischia, or the server's "
                "own backup (docs/OPERATIONS.md)");
}

static enum ischia_code restore(const char *location, const char *path, struct ischia_error *err)
{
    (void)location, (void)path;
    return FAIL(err, ISCHIA_E_INPUT,
                "the store is on a PostgreSQL server: use pg_restore, or bring a backup of a file "
                "there with `ischiad store migrate` (docs/OPERATIONS.md)");
}

const struct engine engine_postgresql = {
    .is_postgresql = true,
    .batch_max = PG_BATCH_MAX,
    .open = open_place,
    .close = close_place,
    .connect = add_connection,
    .disconnect = pg_close,
    .begin = pg_begin,
    .commit = pg_commit,
    .roll_back = pg_roll_back,
    .is_in_transaction = pg_is_in_transaction,
    .is_lost = pg_is_lost,
    .step = pg_step,
    .run = pg_run,
    .end = pg_end,
    .integer = pg_integer,
    .bytes = pg_bytes,
    .changed = pg_changed,
    .size_bytes = size_bytes,
    .version = version,
    .backup = backup,
    .restore = restore,
    .watch = fleet_watch,
    .tell_progress = fleet_tell_progress,
};
