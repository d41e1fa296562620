/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_STORE_POSTGRESQL_H
#define ISCHIA_SERVER_STORE_POSTGRESQL_H

#include <libpq-fe.h>
#include <stdatomic.h>

#include "server/store/engine.h"

/*
 * Internal to the engine on a PostgreSQL server (store_postgresql*.c): the only header that sees
 * libpq-fe.h.
 *
 *   store_postgresql.c        open, close, migrations, the table of the engine
 *   store_postgresql_db.c     one connection: losing it and coming back, transactions, queries
 *   store_postgresql_fleet.c  the thread that says that this daemon lives, gives back what the dead
 *                             held, and hears what the others do
 */

struct fleet;

struct pg_place {
    char *location; /* postgresql://... */
    enum store_mode mode;
    atomic_llong daemon; /* this daemon's number in the table of the living; 0: none */
    atomic_bool is_down; /* the last beat did not arrive: others need not wait to see it */
    char version[48];    /* "PostgreSQL 15.4" */
    struct fleet *fleet; /* NULL: a short-lived command */
};

/* --------------------------------------------------------------------------- connections */

enum pg_role { PG_READER, PG_WRITER, PG_BEAT /* little that may be lost, and quickly */ };

/* *ret_db is the caller's: pg_close. Comes back by itself: each use outside a transaction first
 * makes sure of the connection. ISCHIA_E_IO: the server is not there. */
ISCHIA_MUST_CHECK enum ischia_code pg_open(struct pg_place *place, enum pg_role role,
                                           struct db **ret_db, struct ischia_error *err);
void pg_close(struct db *db); /* NULL allowed */
/* Connects again when the connection was lost; *ret_fresh (may be NULL): it is another one than at
 * the last call, so that what it listened to is to be asked for again. */
ISCHIA_MUST_CHECK enum ischia_code pg_ensure(struct db *db, bool *ret_fresh,
                                             struct ischia_error *err);
PGconn *pg_connection(const struct db *db); /* NULL while it is lost */

/* Runs a text of one or more statements without parameters. *ret (may be NULL): the first column of
 * the last row of the last statement that returned one, as a number; else it stays. */
ISCHIA_MUST_CHECK enum ischia_code pg_execute(struct db *db, const char *text, int64_t *ret,
                                              struct ischia_error *err);

/* What the engine's table says of one connection (engine.h). */
enum ischia_code pg_begin(struct store *store, struct db *db, struct ischia_error *err);
enum ischia_code pg_commit(struct db *db, struct ischia_error *err);
void pg_roll_back(struct db *db);
bool pg_is_in_transaction(const struct db *db);
bool pg_is_lost(const struct db *db);
enum ischia_code pg_step(struct query *query, bool *ret_row, struct ischia_error *err);
enum ischia_code pg_run(struct query *query, struct ischia_error *err);
void pg_end(struct query *query);
int64_t pg_integer(struct query *query, int column);
const void *pg_bytes(struct query *query, int column, size_t *ret_size);
int64_t pg_changed(const struct db *db);

/* --------------------------------------------------------------------------------- the fleet */

/* Enters this daemon into the table of the living and starts the thread. */
ISCHIA_MUST_CHECK enum ischia_code fleet_start(struct store *store, struct ischia_error *err);
/* Leaves the table; NULL allowed. */
void fleet_stop(struct fleet *fleet);
void fleet_watch(struct store *store, const struct store_watcher *watcher);
void fleet_tell_progress(struct store *store, const struct uuid *id,
                         const struct store_progress *progress);

#endif
