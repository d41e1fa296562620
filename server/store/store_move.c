/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * From store to store. Every table is read in full and written row by row in one transaction of the
 * target, so that it holds all or nothing. What triggers keep (tally, token_epoch) keeps itself.
 */
#include <stdio.h>
#include <string.h>

#include "server/store/engine.h"

/* In an order in which what is referred to comes first. kinds: one letter a column, i integer, n
 * the same or NULL, t text, b bytes. `number`: the column that the engine numbers by itself. */
static const struct table {
    const char *name, *columns, *kinds, *number;
} tables[] = {
    {"change", "seq, kind, id, at_ms", "iibi", "seq"},
    {"solution", "rowid, case_key, created_ms, result_json, field", "ibitb", "rowid"},
    {"assessment",
     "seq, id, state, priority, attempt, crashes, cached, change_seq, created_ms, started_ms, "
     "finished_ms, solution, case_key, subject, side, label, measured_at, case_json, "
     "warnings_json, problem_json",
     "ibiiiiiiiiinbttttttt", NULL},
    {"idempotency", "client, key, body_digest, created_ms, assessment", "ttbii", NULL},
    {"token", "id, name, digest, scopes, created_ms, expires_ms, revoked_ms", "ttbiiii", NULL},
    {"audit", "seq, at_ms, who, what, subject, outcome, detail, hash", "iitttttb", NULL},
    {"origin", "assessment, reference, document", "itt", NULL},
    {"outbox", "seq, target, change_seq, id, kind, created_ms, due_ms, attempts, given_up, problem",
     "itibiiiiit", "seq"},
    {"outbox_target", "target, change_seq", "ti", NULL},
    {"feedback", "seq, at_ms, service, card, document", "iitbt", "seq"},
    {"study",
     "seq, id, name, columns_json, responses_json, cancelled, created_ms, started_ms, "
     "finished_ms, client, idempotency_key, body_digest",
     "ibtttiiiittb", "seq"},
    {"study_point",
     "study, line, state, refused, attempt, crashes, case_key, case_json, cells_json, "
     "outcome_json",
     "iiiiiibttt", NULL},
};
enum { TABLE_COUNT = sizeof tables / sizeof tables[0], MOVE_TEXT_BYTES = 1024 };

struct move {
    struct db *from;
    int64_t rows;
};

static void put_column(struct query *to, struct query *from, int column, char kind)
{
    size_t size = 0;
    const void *bytes = kind == 'i' ? "" : from->db->engine->bytes(from, column, &size);
    if (bytes == NULL)
        query_put_text(to, NULL);
    else if (kind == 'i' || kind == 'n')
        query_put_integer(to, query_integer(from, column));
    else if (kind == 't')
        query_put_text(to, bytes);
    else
        query_put_blob(to, bytes, size);
}

static void insert_text(const struct table *table, char ret[MOVE_TEXT_BYTES])
{
    char marks[3 * QUERY_VALUES_MAX] = "?";
    for (size_t i = 1; i < strlen(table->kinds); i++) (void)strncat(marks, ", ?", 4);
    (void)snprintf(ret, MOVE_TEXT_BYTES, "INSERT INTO %s (%s) VALUES (%s)", table->name,
                   table->columns, marks);
}

static enum ischia_code move_row(struct query *from, struct db *to, const struct table *table,
                                 const char *text, struct ischia_error *err)
{
    struct query insert;
    query_begin_text(&insert, to, text);
    for (int i = 0; table->kinds[i] != '\0'; i++) put_column(&insert, from, i, table->kinds[i]);
    return query_run(&insert, err);
}

static enum ischia_code move_rows(struct move *move, struct db *to, const struct table *table,
                                  struct ischia_error *err)
{
    char select[MOVE_TEXT_BYTES], insert[MOVE_TEXT_BYTES];
    struct query from;
    enum ischia_code code;
    bool row = true;
    (void)snprintf(select, sizeof select, "SELECT %s FROM %s ORDER BY 1", table->columns,
                   table->name);
    insert_text(table, insert);
    query_begin_text(&from, move->from, select);
    from.rows_stream = true;
    for (;; move->rows++) {
        code = query_step(&from, &row, err);
        if (code == ISCHIA_OK && row) code = move_row(&from, to, table, insert, err);
        if (code != ISCHIA_OK || !row) break;
    }
    query_end(&from);
    return code;
}

/* A server keeps the next number apart from the rows; a file does not. */
static enum ischia_code set_number(struct db *to, const struct table *table,
                                   struct ischia_error *err)
{
    char text[MOVE_TEXT_BYTES];
    int64_t ignored;
    if (table->number == NULL || !to->engine->is_postgresql) return ISCHIA_OK;
    (void)snprintf(text, sizeof text,
                   "SELECT setval(pg_get_serial_sequence('%s', '%s'), coalesce(max(%s), 0) + 1, "
                   "false) FROM %s",
                   table->name, table->number, table->number, table->name);
    return db_number(to, text, &ignored, err);
}

static enum ischia_code check_empty(struct db *to, struct ischia_error *err)
{
    for (int i = 0; i < TABLE_COUNT; i++) {
        char text[128];
        int64_t there = 0;
        (void)snprintf(text, sizeof text, "SELECT count(*) FROM %s", tables[i].name);
        TRY(db_number(to, text, &there, err));
        CHECK(there == 0, err, ISCHIA_E_STATE,
              "the store to move to is not empty (%s); nothing was changed", tables[i].name);
    }
    return ISCHIA_OK;
}

static enum ischia_code move_run(struct store *store, struct db *db, void *operation,
                                 struct ischia_error *err)
{
    struct move *move = operation;
    int requeued = 0;
    move->rows = 0;
    TRY(check_empty(db, err));
    for (int i = 0; i < TABLE_COUNT; i++) {
        TRY(move_rows(move, db, &tables[i], err));
        TRY(set_number(db, &tables[i], err));
    }
    return recover_run(store, db, &requeued, err);
}

/* A file is locked by whoever opens it to serve; on a server the others can be counted. */
static enum ischia_code check_alone(struct store *store, struct db *db, struct ischia_error *err)
{
    int64_t others = 0;
    if (store->engine->watch == NULL) return ISCHIA_OK;
    TRY(db_number(db,
                  "SELECT count(*) FROM daemon WHERE id <> own_daemon() AND "
                  "beat_at > clock_timestamp() - interval '5 s'",
                  &others, err));
    CHECK(others == 0, err, ISCHIA_E_STATE, "a daemon is using one of the stores: stop it first");
    return ISCHIA_OK;
}

static enum ischia_code move_between(struct store *from, struct store *to, int64_t *ret_rows,
                                     struct ischia_error *err)
{
    struct move move = {0};
    TRY(reader_take(from, &move.from, err));
    enum ischia_code code = check_alone(from, move.from, err);
    if (code == ISCHIA_OK) {
        struct write write = {.run = move_run, .operation = &move};
        code = write_run(to, &write, err);
    }
    reader_give(from, move.from);
    if (code == ISCHIA_OK) *ret_rows = move.rows;
    return code;
}

enum ischia_code store_move(const char *from, const char *to, int64_t *ret_rows,
                            struct ischia_error *err)
{
    const struct store_options source = {.location = from, .mode = STORE_SERVE};
    const struct store_options target = {.location = to, .mode = STORE_SERVE};
    struct store *old = NULL, *fresh = NULL;
    struct db *db = NULL;
    enum ischia_code code = store_open(&source, &old, err);
    if (code == ISCHIA_OK) code = store_open(&target, &fresh, err);
    if (code == ISCHIA_OK) code = reader_take(fresh, &db, err);
    if (code == ISCHIA_OK) {
        code = check_alone(fresh, db, err);
        reader_give(fresh, db);
    }
    if (code == ISCHIA_OK) code = move_between(old, fresh, ret_rows, err);
    store_close(fresh);
    store_close(old);
    return code;
}
