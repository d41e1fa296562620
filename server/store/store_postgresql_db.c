/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One connection to the server.
 *
 * A connection that is lost comes back at its next use outside a transaction, never within one:
 * what is left of a transaction must not run on another connection, where each of its statements
 * would be a transaction of its own. A commit counts only when the server has called it COMMIT: of
 * a transaction that has failed it says ROLLBACK, and calls that a success.
 */
#include <assert.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "server/store/store_postgresql.h"

enum { OWED_MAX = 256 }; /* their answers fit into any socket's buffer */
enum { ANSWER_MS = 20000, BEAT_ANSWER_MS = 3000, AGAIN_MS = 500, TEXT_MAX = 8192 };

/* Writers queue here; any number of ours will do. The same in the documentation. */
#define ORDER_LOCK "pg_advisory_xact_lock(1232298856)"

struct pg_db {
    struct db db;
    struct pg_place *place;
    enum pg_role role;
    PGconn *connection; /* NULL: lost */
    bool fresh;
    bool prepared[SQL_COUNT];
    bool streaming;      /* rows of the present query are still to come */
    bool in_transaction; /* begun and not ended, whatever became of the connection */
    int owed;            /* statements sent whose answers have not been taken: then it is in libpq's
                 pipeline mode, else not */
    int64_t daemon;      /* as the session knows it */
    int64_t changed;     /* rows, by the last statement */
    int64_t again_at_ms; /* no attempt to connect before; monotonic */
    struct ischia_error why; /* it could not be made */
};

static struct pg_db *own_of(struct db *db) { return (struct pg_db *)db; }
static const struct pg_db *own_of_const(const struct db *db) { return (const struct pg_db *)db; }

PGconn *pg_connection(const struct db *db) { return own_of_const(db)->connection; }

static int64_t monotonic_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* ------------------------------------------------------------------------------- failing */

static void drop(struct pg_db *own)
{
    PQfinish(own->connection);
    own->connection = NULL;
    own->streaming = false;
    own->owed = 0;
    memset(own->prepared, 0, sizeof own->prepared);
}

bool pg_is_lost(const struct db *db)
{
    PGconn *connection = pg_connection(db);
    return connection == NULL || PQstatus(connection) != CONNECTION_OK;
}

/* The server's words in one line, without what it says about rows: that may be a person's. */
static enum ischia_code fail(const struct pg_db *own, const PGresult *result, const char *doing,
                             struct ischia_error *err)
{
    const char *state = result == NULL ? NULL : PQresultErrorField(result, PG_DIAG_SQLSTATE);
    const char *words = result == NULL ? NULL : PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY);
    if (words == NULL)
        words = own->connection == NULL ? "no answer in time" : PQerrorMessage(own->connection);
    return FAIL(err, ISCHIA_E_IO, "the store cannot %s: %.*s [PostgreSQL %s]", doing,
                (int)strcspn(words, "\n"), words, state == NULL ? "connection" : state);
}

/* ---------------------------------------------------------------------------- connecting */

/* Wait for the socket, not for ever: a server that hangs, or a cable that was cut, must not take a
 * thread with it. False: nothing came in time. */
static bool await_answer(struct pg_db *own)
{
    const int64_t until_ms = monotonic_ms() + (own->role == PG_BEAT ? BEAT_ANSWER_MS : ANSWER_MS);
    while (PQisBusy(own->connection)) {
        struct pollfd ready = {.fd = PQsocket(own->connection), .events = POLLIN};
        const int64_t left_ms = until_ms - monotonic_ms();
        if (left_ms <= 0) return false;
        if (poll(&ready, 1, (int)left_ms) > 0 && PQconsumeInput(own->connection) == 0) return true;
    }
    return true;
}

/* The next result, NULL after the last; *ret_silent: the server said nothing and was given up. */
static PGresult *next_result(struct pg_db *own, bool *ret_silent)
{
    *ret_silent = own->connection == NULL || !await_answer(own);
    if (!*ret_silent) return PQgetResult(own->connection);
    drop(own);
    return NULL;
}

static bool is_good(const PGresult *result)
{
    const ExecStatusType status = PQresultStatus(result);
    return status == PGRES_TUPLES_OK || status == PGRES_COMMAND_OK ||
           status == PGRES_SINGLE_TUPLE || status == PGRES_EMPTY_QUERY;
}

/* Takes all results of what was sent; *ret_last is the caller's to clear, also on failure. */
static enum ischia_code collect(struct pg_db *own, const char *doing, int64_t *ret_number,
                                char ret_tag[16], struct ischia_error *err)
{
    enum ischia_code code = ISCHIA_OK;
    bool silent = false;
    for (PGresult *result; (result = next_result(own, &silent)) != NULL; PQclear(result)) {
        if (code == ISCHIA_OK && !is_good(result)) code = fail(own, result, doing, err);
        if (ret_tag != NULL) (void)snprintf(ret_tag, 16, "%s", PQcmdStatus(result));
        if (ret_number != NULL && PQntuples(result) > 0 && PQnfields(result) > 0)
            *ret_number = strtoll(PQgetvalue(result, PQntuples(result) - 1, 0), NULL, 10);
    }
    if (silent && code == ISCHIA_OK) code = fail(own, NULL, doing, err);
    return code;
}

enum ischia_code pg_execute(struct db *db, const char *text, int64_t *ret, struct ischia_error *err)
{
    struct pg_db *own = own_of(db);
    if (own->connection == NULL || PQsendQuery(own->connection, text) == 0)
        return fail(own, NULL, "be used", err);
    return collect(own, "be used", ret, NULL, err);
}

/* Takes the answers that are owed, after all of them were asked for. Statements behind one that
 * failed are not carried out. */
static enum ischia_code take_owed(struct pg_db *own, struct ischia_error *err)
{
    enum ischia_code code = ISCHIA_OK;
    const int owed = own->owed;
    bool silent = false;
    own->owed = 0;
    for (int i = 0; i < owed && !silent; i++) {
        PGresult *result = next_result(own, &silent);
        if (code == ISCHIA_OK && !is_good(result)) code = fail(own, result, "be used", err);
        PQclear(result);
        if (!silent) PQclear(next_result(own, &silent)); /* NULL: the end of this one */
    }
    return code;
}

/* Takes the mark behind the last answer. A connection on which it does not come is of no use. */
static enum ischia_code leave_pipeline(struct pg_db *own, enum ischia_code code,
                                       struct ischia_error *err)
{
    bool silent = false;
    PGresult *mark = next_result(own, &silent);
    const bool good =
        PQresultStatus(mark) == PGRES_PIPELINE_SYNC && PQexitPipelineMode(own->connection) != 0;
    PQclear(mark);
    if (!good && code == ISCHIA_OK) code = fail(own, NULL, "be used", err);
    if (!good) drop(own);
    return code;
}

static enum ischia_code ask_for_owed(struct pg_db *own, struct ischia_error *err)
{
    if (PQpipelineSync(own->connection) != 0) return ISCHIA_OK;
    const enum ischia_code code = fail(own, NULL, "be used", err);
    drop(own);
    return code;
}

static enum ischia_code settle(struct pg_db *own, struct ischia_error *err)
{
    if (own->owed == 0) return ISCHIA_OK;
    TRY(ask_for_owed(own, err));
    const enum ischia_code code = take_owed(own, err);
    return leave_pipeline(own, code, err);
}

/* What the server remarks goes into its own log; ours is of one line an event. */
static void ignore_notice(void *context, const PGresult *result) { (void)context, (void)result; }

/* What a session of ours is. A transaction that hangs in the middle, because its daemon does, must
 * not hold up all the others. */
static enum ischia_code set_up_session(struct pg_db *own, struct ischia_error *err)
{
    (void)PQsetNoticeReceiver(own->connection, ignore_notice, NULL);
    (void)PQsetErrorVerbosity(own->connection, PQERRORS_TERSE);
    TRY(pg_execute(&own->db,
                   "SET search_path = ischia; SET client_min_messages = warning;"
                   "SET idle_in_transaction_session_timeout = '5s'; SET lock_timeout = '15s'",
                   NULL, err));
    if (own->role != PG_BEAT) return ISCHIA_OK;
    return pg_execute(&own->db, "SET synchronous_commit = off", NULL, err);
}

/* Defaults come before the location, which overrules them. */
static PGconn *dial(const char *location)
{
    static const char *const names[] = {"connect_timeout",
                                        "keepalives_idle",
                                        "keepalives_interval",
                                        "keepalives_count",
                                        "tcp_user_timeout",
                                        "fallback_application_name",
                                        "target_session_attrs",
                                        "client_encoding",
                                        "dbname",
                                        NULL};
    const char *values[] = {"3",       "2",          "1",    "3",      "5000",
                            "ischiad", "read-write", "UTF8", location, NULL};
    return PQconnectdbParams(names, values, 1);
}

static enum ischia_code connect_again(struct pg_db *own, struct ischia_error *err)
{
    drop(own);
    if (monotonic_ms() < own->again_at_ms) return FAIL(err, own->why.code, "%s", own->why.message);
    own->connection = dial(own->place->location);
    enum ischia_code code = ISCHIA_OK;
    if (own->connection == NULL || PQstatus(own->connection) != CONNECTION_OK)
        code = fail(own, NULL, "reach its database", &own->why);
    else
        code = set_up_session(own, &own->why);
    if (code != ISCHIA_OK) {
        drop(own);
        own->again_at_ms = monotonic_ms() + AGAIN_MS;
        return FAIL(err, own->why.code, "%s", own->why.message);
    }
    own->fresh = true;
    own->daemon = 0;
    return ISCHIA_OK;
}

/* Tells the session which daemon it works for. */
static enum ischia_code introduce(struct pg_db *own, struct ischia_error *err)
{
    char text[64];
    const int64_t daemon = atomic_load(&own->place->daemon);
    if (own->daemon == daemon) return ISCHIA_OK;
    (void)snprintf(text, sizeof text, "SET ischia.daemon = '%lld'", (long long)daemon);
    TRY(pg_execute(&own->db, text, NULL, err));
    own->daemon = daemon;
    return ISCHIA_OK;
}

enum ischia_code pg_ensure(struct db *db, bool *ret_fresh, struct ischia_error *err)
{
    struct pg_db *own = own_of(db);
    CHECK(own->role == PG_BEAT || !atomic_load(&own->place->is_down), err, ISCHIA_E_IO,
          "the store cannot reach its database: the server does not answer");
    if (pg_is_lost(db)) TRY(connect_again(own, err));
    enum ischia_code code = introduce(own, err);
    if (code != ISCHIA_OK && pg_is_lost(db)) { /* it was, and nobody had noticed */
        TRY(connect_again(own, err));
        code = introduce(own, err);
    }
    TRY(code);
    if (ret_fresh != NULL) *ret_fresh = own->fresh;
    if (ret_fresh != NULL) own->fresh = false;
    return ISCHIA_OK;
}

enum ischia_code pg_open(struct pg_place *place, enum pg_role role, struct db **ret_db,
                         struct ischia_error *err)
{
    struct pg_db *own = calloc(1, sizeof *own);
    CHECK(own != NULL, err, ISCHIA_E_MEMORY, "no memory for a database connection");
    own->db.engine = &engine_postgresql;
    own->place = place;
    own->role = role;
    const enum ischia_code code = pg_ensure(&own->db, NULL, err);
    if (code != ISCHIA_OK) {
        pg_close(&own->db);
        return code;
    }
    *ret_db = &own->db;
    return ISCHIA_OK;
}

void pg_close(struct db *db)
{
    if (db == NULL) return;
    drop(own_of(db));
    free(db);
}

/* -------------------------------------------------------------------------- transactions */

bool pg_is_in_transaction(const struct db *db) { return own_of_const(db)->in_transaction; }

/* Writers come one after the other, on all machines: what one has numbered is then committed before
 * the next takes a number. READ COMMITTED, so that each statement sees what those before have
 * committed. */
static enum ischia_code begin_once(struct db *db, int64_t *ret_version, struct ischia_error *err)
{
    TRY(pg_ensure(db, NULL, err));
    return pg_execute(db,
                      "BEGIN ISOLATION LEVEL READ COMMITTED; SELECT " ORDER_LOCK
                      "; SELECT version FROM schema_version",
                      ret_version, err);
}

enum ischia_code pg_begin(struct store *store, struct db *db, struct ischia_error *err)
{
    int64_t version = 0;
    (void)store;
    enum ischia_code code = begin_once(db, &version, err);
    /* lost while nobody used it: nothing has been done yet */
    if (code != ISCHIA_OK && pg_is_lost(db)) code = begin_once(db, &version, err);
    if (code == ISCHIA_OK && version != store_migration_count)
        code = FAIL(err, ISCHIA_E_STATE,
                    "the store is of schema %lld by now, this program knows %d: another version of "
                    "Ischia serves it",
                    (long long)version, store_migration_count);
    own_of(db)->in_transaction = true;
    if (code != ISCHIA_OK) pg_roll_back(db);
    return code;
}

enum ischia_code pg_commit(struct db *db, struct ischia_error *err)
{
    struct pg_db *own = own_of(db);
    char tag[16] = "";
    TRY(settle(own, err));
    if (own->connection == NULL || PQtransactionStatus(own->connection) != PQTRANS_INTRANS ||
        PQsendQuery(own->connection, "COMMIT") == 0)
        return fail(own, NULL, "commit", err);
    TRY(collect(own, "commit", NULL, tag, err));
    CHECK(strcmp(tag, "COMMIT") == 0, err, ISCHIA_E_IO,
          "the store cannot commit: the server answered %s", tag);
    own->in_transaction = false;
    return ISCHIA_OK;
}

void pg_roll_back(struct db *db)
{
    struct pg_db *own = own_of(db);
    const bool begun = own->in_transaction;
    own->in_transaction = false;
    if (begun) (void)!settle(own, NULL);
    if (pg_is_lost(db) || !begun) return;
    if (pg_execute(db, "ROLLBACK", NULL, NULL) != ISCHIA_OK) drop(own);
}

/* ------------------------------------------------------------------------------- queries */

/* ? -> $1, $2 ...; ?2 -> $2. False: no room. */
static bool number_parameters(const char *text, char ret[TEXT_MAX])
{
    size_t used = 0;
    int next = 1;
    for (; *text != '\0' && used < TEXT_MAX - 16; text++) {
        ret[used++] = *text == '?' ? '$' : *text;
        if (*text == '?' && (text[1] < '0' || text[1] > '9'))
            used += (size_t)snprintf(ret + used, 12, "%d", next++);
    }
    ret[used] = '\0';
    return *text == '\0';
}

static const char *name_of(enum sql sql, char ret[16])
{
    (void)snprintf(ret, 16, "s%d", (int)sql);
    return ret;
}

static enum ischia_code prepare(struct pg_db *own, enum sql sql, struct ischia_error *err)
{
    char text[TEXT_MAX], name[16];
    if (own->prepared[sql]) return ISCHIA_OK;
    CHECK(number_parameters(sql_for(&engine_postgresql, &sql_text[sql]), text), err, ISCHIA_E_LIMIT,
          "a statement is too long");
    if (own->connection == NULL ||
        PQsendPrepare(own->connection, name_of(sql, name), text, 0, NULL) == 0)
        return fail(own, NULL, "be read", err);
    TRY(collect(own, "be read", NULL, NULL, err));
    own->prepared[sql] = true;
    return ISCHIA_OK;
}

struct parameters {
    const char *value[QUERY_VALUES_MAX];
    int length[QUERY_VALUES_MAX], format[QUERY_VALUES_MAX];
    char number[QUERY_VALUES_MAX][24];
};

static void list_parameters(const struct query *query, struct parameters *ret)
{
    for (int i = 0; i < query->count; i++) {
        const struct value *value = &query->value[i];
        const bool is_number = value->kind == VALUE_INTEGER;
        if (is_number)
            (void)snprintf(ret->number[i], sizeof ret->number[i], "%lld",
                           (long long)value->integer);
        ret->value[i] = is_number                   ? ret->number[i]
                        : value->kind == VALUE_NULL ? NULL
                                                    : (const char *)value->bytes;
        ret->length[i] = (int)value->size; /* of a blob; a text ends in NUL */
        ret->format[i] = value->kind == VALUE_BLOB;
    }
}

/* Sends the statement with its values; rows come in binary form. */
static enum ischia_code send_query(struct pg_db *own, const struct query *query,
                                   struct ischia_error *err)
{
    struct parameters p;
    char text[TEXT_MAX], name[16];
    int sent = 0;
    list_parameters(query, &p);
    if (query->sql != SQL_COUNT) {
        TRY(prepare(own, query->sql, err));
        sent = PQsendQueryPrepared(own->connection, name_of(query->sql, name), query->count,
                                   p.value, p.length, p.format, 1);
    } else {
        CHECK(number_parameters(query->text, text), err, ISCHIA_E_LIMIT, "a statement is too long");
        sent = own->connection == NULL ? 0
                                       : PQsendQueryParams(own->connection, text, query->count,
                                                           NULL, p.value, p.length, p.format, 1);
    }
    return sent != 0 ? ISCHIA_OK : fail(own, NULL, "be used", err);
}

/* Takes the next result into query->state: all rows, or of a stream one. */
static enum ischia_code take_result(struct pg_db *own, struct query *query,
                                    struct ischia_error *err)
{
    bool silent = false;
    PQclear(query->state);
    query->row = -1;
    query->state = next_result(own, &silent);
    if (!is_good(query->state)) {
        const enum ischia_code code = fail(own, query->state, "be used", err);
        own->streaming = false;
        (void)!collect(own, "be used", NULL, NULL, NULL); /* the end of it */
        return code;
    }
    own->changed = strtoll(PQcmdTuples(query->state), NULL, 10);
    if (PQresultStatus(query->state) == PGRES_SINGLE_TUPLE) return ISCHIA_OK;
    own->streaming = false;
    return collect(own, "be used", NULL, NULL, err); /* the end of it */
}

/* The answer to a statement that was sent behind others whose answers are owed. */
static enum ischia_code take_behind(struct pg_db *own, struct query *query,
                                    struct ischia_error *err)
{
    bool silent = false;
    TRY(ask_for_owed(own, err));
    enum ischia_code code = take_owed(own, err);
    query->row = -1;
    query->state = next_result(own, &silent);
    if (code == ISCHIA_OK && !is_good(query->state)) code = fail(own, query->state, "be used", err);
    if (code == ISCHIA_OK) own->changed = strtoll(PQcmdTuples(query->state), NULL, 10);
    if (!silent) PQclear(next_result(own, &silent)); /* NULL: the end of it */
    return leave_pipeline(own, code, err);
}

/* Whether a statement can be sent behind others at once. */
static bool fits_behind(const struct pg_db *own, const struct query *query)
{
    const bool known = query->sql == SQL_COUNT || own->prepared[query->sql];
    return known && !query->rows_stream && own->owed < OWED_MAX;
}

static enum ischia_code start_once(struct pg_db *own, struct query *query, struct ischia_error *err)
{
    assert(!own->streaming);
    query->begun = true;
    if (!fits_behind(own, query)) TRY(settle(own, err));
    TRY(send_query(own, query, err));
    if (own->owed > 0) return take_behind(own, query, err);
    if (query->rows_stream && PQsetSingleRowMode(own->connection) != 0) own->streaming = true;
    return take_result(own, query, err);
}

/* Outside a transaction a statement only reads, so that it can be asked again. */
static enum ischia_code start(struct pg_db *own, struct query *query, struct ischia_error *err)
{
    if (pg_is_in_transaction(&own->db)) return start_once(own, query, err);
    TRY(pg_ensure(&own->db, NULL, err));
    const enum ischia_code code = start_once(own, query, err);
    if (code == ISCHIA_OK || !pg_is_lost(&own->db)) return code;
    TRY(pg_ensure(&own->db, NULL, err));
    return start_once(own, query, err);
}

enum ischia_code pg_step(struct query *query, bool *ret_row, struct ischia_error *err)
{
    struct pg_db *own = own_of(query->db);
    if (!query->begun)
        TRY(start(own, query, err));
    else if (own->streaming && query->row + 1 == PQntuples(query->state))
        TRY(take_result(own, query, err));
    if (query->row < PQntuples(query->state)) query->row++;
    *ret_row = query->row < PQntuples(query->state);
    return ISCHIA_OK;
}

/* In a transaction nobody waits for what is of no interest: the answer is taken with that to a
 * later statement, or before the commit. A study has thousands of points, and the others wait
 * meanwhile. */
enum ischia_code pg_run(struct query *query, struct ischia_error *err)
{
    struct pg_db *own = own_of(query->db);
    bool row;
    if (!own->in_transaction || own->connection == NULL) return pg_step(query, &row, err);
    if (!fits_behind(own, query)) TRY(settle(own, err));
    if (query->sql != SQL_COUNT) TRY(prepare(own, query->sql, err));
    if (own->owed == 0 && (own->connection == NULL || PQenterPipelineMode(own->connection) == 0))
        return fail(own, NULL, "be used", err);
    const enum ischia_code code = send_query(own, query, err);
    if (code == ISCHIA_OK)
        own->owed++;
    else
        drop(own);
    return code;
}

/* A stream that is left in the middle: the server need not send the rest. */
static void stop_stream(struct pg_db *own)
{
    char words[128];
    bool silent = false;
    PGcancel *cancel = PQgetCancel(own->connection);
    if (cancel != NULL) (void)PQcancel(cancel, words, sizeof words);
    PQfreeCancel(cancel);
    for (PGresult *result; (result = next_result(own, &silent)) != NULL;) PQclear(result);
    own->streaming = false;
}

void pg_end(struct query *query)
{
    struct pg_db *own = own_of(query->db);
    PQclear(query->state);
    query->state = NULL;
    if (own->streaming) stop_stream(own);
}

/* Numbers come as two's complement, the highest byte first; a truth value as one byte. */
int64_t pg_integer(struct query *query, int column)
{
    const int size = PQgetlength(query->state, query->row, column);
    const unsigned char *bytes =
        (const unsigned char *)PQgetvalue(query->state, query->row, column);
    if (size <= 0 || size > 8) return 0;
    uint64_t value = size > 1 && bytes[0] >= 0x80 ? UINT64_MAX : 0;
    for (int i = 0; i < size; i++) value = value << 8 | bytes[i];
    return (int64_t)value;
}

const void *pg_bytes(struct query *query, int column, size_t *ret_size)
{
    *ret_size = 0;
    if (PQgetisnull(query->state, query->row, column)) return NULL;
    *ret_size = (size_t)PQgetlength(query->state, query->row, column);
    return PQgetvalue(query->state, query->row, column);
}

int64_t pg_changed(const struct db *db) { return own_of_const(db)->changed; }
