/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The outbox of what record systems are still to be told, and what they answered to cards. */
#include <string.h>

#include "server/store/engine.h"

/* -------------------------------------------------------------------------------- outbox */

/* One change of the outbox: the statements run in order, each with the target as its parameter. */
struct target_write {
    const char *target;
    enum sql sql[2];
    int count;
};

static enum ischia_code target_run(struct store *store, struct db *db, void *operation,
                                   struct ischia_error *err)
{
    const struct target_write *change = operation;
    (void)store;
    for (int i = 0; i < change->count; i++) {
        struct query query;
        query_begin(&query, db, change->sql[i]);
        query_put_text(&query, change->target);
        TRY(query_run(&query, err));
    }
    return ISCHIA_OK;
}

static enum ischia_code change_target(struct store *store, struct target_write *change,
                                      struct ischia_error *err)
{
    struct write write = {.run = target_run, .operation = change};
    return write_run(store, &write, err);
}

enum ischia_code store_outbox_open(struct store *store, const char *target,
                                   struct ischia_error *err)
{
    struct target_write change = {target, {SQL_OUTBOX_OPEN}, 1};
    return change_target(store, &change, err);
}

enum ischia_code store_outbox_close(struct store *store, const char *target,
                                    struct ischia_error *err)
{
    struct target_write change = {target, {SQL_OUTBOX_CLOSE, SQL_OUTBOX_CLEAR}, 2};
    return change_target(store, &change, err);
}

enum ischia_code store_outbox_fill(struct store *store, const char *target,
                                   struct ischia_error *err)
{
    struct target_write change = {target, {SQL_OUTBOX_FILL, SQL_OUTBOX_MOVE}, 2};
    return change_target(store, &change, err);
}

/* The first seven columns of SQL_OUTBOX_NEXT and SQL_OUTBOX_LIST. */
static enum ischia_code read_delivery(struct query *query, struct store_delivery *ret,
                                      int64_t *ret_due_ms, struct ischia_error *err)
{
    ret->seq = query_integer(query, 0);
    ret->change_seq = query_integer(query, 1);
    TRY(query_blob(query, 2, ret->id.byte, UUID_BYTES, err));
    ret->kind = (enum store_change_kind)query_integer(query, 3);
    ret->created_ms = query_integer(query, 4);
    ret->attempts = (int)query_integer(query, 5);
    *ret_due_ms = query_integer(query, 6);
    return ISCHIA_OK;
}

static enum ischia_code next_from(struct db *db, const char *target, struct store_delivery *ret,
                                  int64_t *ret_due_ms, bool *ret_found, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_OUTBOX_NEXT);
    query_put_text(&query, target);
    enum ischia_code code = query_step(&query, ret_found, err);
    if (code == ISCHIA_OK && *ret_found) code = read_delivery(&query, ret, ret_due_ms, err);
    query_end(&query);
    return code;
}

enum ischia_code store_outbox_next(struct store *store, const char *target, int64_t now_ms,
                                   struct store_delivery *ret, int64_t *ret_due_ms,
                                   enum store_answer *ret_answer, struct ischia_error *err)
{
    struct db *db = NULL;
    struct store_delivery delivery = {0};
    int64_t due_ms = 0;
    bool found = false;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = next_from(db, target, &delivery, &due_ms, &found, err);
    reader_give(store, db);
    TRY(code);
    *ret_due_ms = due_ms;
    *ret_answer = found && due_ms <= now_ms ? STORE_DONE : STORE_NOT_FOUND;
    if (*ret_answer == STORE_DONE) *ret = delivery;
    return ISCHIA_OK;
}

struct row_write {
    int64_t seq, due_ms;
    bool done, give_up;
    const char *problem;
};

static enum ischia_code row_run(struct store *store, struct db *db, void *operation,
                                struct ischia_error *err)
{
    const struct row_write *row = operation;
    struct query query;
    (void)store;
    query_begin(&query, db, row->done ? SQL_OUTBOX_DONE : SQL_OUTBOX_RETRY);
    if (!row->done) {
        query_put_integer(&query, row->due_ms);
        query_put_integer(&query, row->give_up);
        query_put_text(&query, row->problem);
    }
    query_put_integer(&query, row->seq);
    return query_run(&query, err);
}

enum ischia_code store_outbox_done(struct store *store, int64_t seq, struct ischia_error *err)
{
    struct row_write row = {.seq = seq, .done = true};
    struct write write = {.run = row_run, .operation = &row};
    return write_run(store, &write, err);
}

enum ischia_code store_outbox_retry(struct store *store, int64_t seq, int64_t due_ms, bool give_up,
                                    const char *problem, struct ischia_error *err)
{
    struct row_write row = {.seq = seq, .due_ms = due_ms, .give_up = give_up, .problem = problem};
    struct write write = {.run = row_run, .operation = &row};
    return write_run(store, &write, err);
}

static enum ischia_code list_outbox(struct db *db, store_on_outbox *on_row, void *context,
                                    struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_OUTBOX_LIST);
    enum ischia_code code;
    for (bool more = true;;) {
        struct store_outbox_row row = {0};
        code = query_step(&query, &more, err);
        if (code == ISCHIA_OK && more)
            code = read_delivery(&query, &row.delivery, &row.due_ms, err);
        if (code != ISCHIA_OK || !more) break;
        query_copy_text(&query, 7, row.target, sizeof row.target);
        row.given_up = query_integer(&query, 8) != 0;
        query_copy_text(&query, 9, row.problem, sizeof row.problem);
        if (!on_row(context, &row)) break;
    }
    query_end(&query);
    return code;
}

enum ischia_code store_outbox_list(struct store *store, store_on_outbox *on_row, void *context,
                                   struct ischia_error *err)
{
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = list_outbox(db, on_row, context, err);
    reader_give(store, db);
    return code;
}

static enum ischia_code revive_run(struct store *store, struct db *db, void *operation,
                                   struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_OUTBOX_REVIVE);
    query_put_integer(&query, store_now_ms(store));
    int64_t revived = 0;
    TRY(query_change(&query, &revived, err));
    *(int *)operation = (int)revived;
    return ISCHIA_OK;
}

enum ischia_code store_outbox_revive(struct store *store, int *ret_count, struct ischia_error *err)
{
    struct write write = {.run = revive_run, .operation = ret_count};
    return write_run(store, &write, err);
}

/* ------------------------------------------------------------------------------ feedback */

struct feedback_write {
    const struct store_feedback *rows;
    size_t count;
};

static enum ischia_code feedback_run(struct store *store, struct db *db, void *operation,
                                     struct ischia_error *err)
{
    const struct feedback_write *add = operation;
    for (size_t i = 0; i < add->count; i++) {
        struct query query;
        query_begin(&query, db, SQL_FEEDBACK_ADD);
        query_put_integer(&query, store_now_ms(store));
        query_put_text(&query, add->rows[i].service);
        query_put_blob(&query, add->rows[i].card.byte, UUID_BYTES);
        query_put_text(&query, add->rows[i].document);
        TRY(query_run(&query, err));
    }
    return ISCHIA_OK;
}

enum ischia_code store_feedback_add(struct store *store, const struct store_feedback *rows,
                                    size_t count, struct ischia_error *err)
{
    struct feedback_write add = {rows, count};
    struct write write = {.run = feedback_run, .operation = &add};
    return write_run(store, &write, err);
}

static enum ischia_code list_feedback(struct db *db, store_on_feedback *on_row, void *context,
                                      struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_FEEDBACK_LIST);
    enum ischia_code code;
    for (bool more = true;;) {
        struct store_feedback row = {0};
        code = query_step(&query, &more, err);
        if (code != ISCHIA_OK || !more) break;
        row.at_ms = query_integer(&query, 0);
        row.service = query_peek_text(&query, 1);
        code = query_blob(&query, 2, row.card.byte, UUID_BYTES, err);
        row.document = query_peek_text(&query, 3);
        if (code != ISCHIA_OK || !on_row(context, &row)) break;
    }
    query_end(&query);
    return code;
}

enum ischia_code store_feedback_list(struct store *store, store_on_feedback *on_row, void *context,
                                     struct ischia_error *err)
{
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = list_feedback(db, on_row, context, err);
    reader_give(store, db);
    return code;
}
