/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/digest.h"
#include "server/store/engine.h"

/* -------------------------------------------------------------------------------- tokens */

struct token_write {
    struct store_token token;
    enum store_answer answer;
};

static enum ischia_code token_add_run(struct store *store, struct db *db, void *operation,
                                      struct ischia_error *err)
{
    struct token_write *add = operation;
    struct query query;
    query_begin(&query, db, SQL_TOKEN_ADD);
    query_put_text(&query, add->token.id);
    query_put_text(&query, add->token.name);
    query_put_blob(&query, add->token.digest, STORE_DIGEST_BYTES);
    query_put_integer(&query, add->token.scopes);
    query_put_integer(&query, store_now_ms(store));
    query_put_integer(&query, add->token.expires_ms);
    int64_t added = 0;
    TRY(query_change(&query, &added, err));
    add->answer = added == 1 ? STORE_DONE : STORE_CONFLICT;
    return ISCHIA_OK;
}

enum ischia_code store_token_add(struct store *store, const struct store_token *token,
                                 enum store_answer *ret_answer, struct ischia_error *err)
{
    struct token_write add = {.token = *token};
    struct write write = {.run = token_add_run, .operation = &add};
    TRY(write_run(store, &write, err));
    *ret_answer = add.answer;
    return ISCHIA_OK;
}

static enum ischia_code read_token(struct query *query, struct store_token *ret,
                                   struct ischia_error *err)
{
    query_copy_text(query, 0, ret->id, sizeof ret->id);
    query_copy_text(query, 1, ret->name, sizeof ret->name);
    TRY(query_blob(query, 2, ret->digest, STORE_DIGEST_BYTES, err));
    ret->scopes = (uint32_t)query_integer(query, 3);
    ret->created_ms = query_integer(query, 4);
    ret->expires_ms = query_integer(query, 5);
    ret->revoked_ms = query_integer(query, 6);
    return ISCHIA_OK;
}

static enum ischia_code find_token(struct db *db, const char *id, struct store_token *ret,
                                   bool *ret_found, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_TOKEN_GET);
    query_put_text(&query, id);
    enum ischia_code code = query_step(&query, ret_found, err);
    if (code == ISCHIA_OK && *ret_found) code = read_token(&query, ret, err);
    query_end(&query);
    return code;
}

enum ischia_code store_token_get(struct store *store, const char *id, struct store_token *ret,
                                 enum store_answer *ret_answer, struct ischia_error *err)
{
    struct db *db = NULL;
    struct store_token token = {0};
    bool found = false;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = find_token(db, id, &token, &found, err);
    reader_give(store, db);
    TRY(code);
    *ret_answer = found ? STORE_DONE : STORE_NOT_FOUND;
    if (found) *ret = token;
    return ISCHIA_OK;
}

static enum ischia_code token_revoke_run(struct store *store, struct db *db, void *operation,
                                         struct ischia_error *err)
{
    struct token_write *revoke = operation;
    struct store_token present = {0};
    bool found = false;
    TRY(find_token(db, revoke->token.id, &present, &found, err));
    revoke->answer = found ? STORE_CONFLICT : STORE_NOT_FOUND;
    if (!found || present.revoked_ms != 0) return ISCHIA_OK;
    struct query query;
    query_begin(&query, db, SQL_TOKEN_REVOKE);
    query_put_integer(&query, store_now_ms(store));
    query_put_text(&query, revoke->token.id);
    TRY(query_run(&query, err));
    revoke->answer = STORE_DONE;
    return ISCHIA_OK;
}

enum ischia_code store_token_revoke(struct store *store, const char *id,
                                    enum store_answer *ret_answer, struct ischia_error *err)
{
    struct token_write revoke = {0};
    struct write write = {.run = token_revoke_run, .operation = &revoke};
    *ret_answer = STORE_NOT_FOUND;
    if (strlen(id) >= sizeof revoke.token.id) return ISCHIA_OK;
    (void)stpcpy(revoke.token.id, id);
    TRY(write_run(store, &write, err));
    *ret_answer = revoke.answer;
    return ISCHIA_OK;
}

/* The triggers move the epoch for what is added or changed, not for what goes. */
static enum ischia_code token_forget_run(struct store *store, struct db *db, void *operation,
                                         struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_TOKEN_FORGET);
    query_put_integer(&query, store_now_ms(store));
    TRY(query_change(&query, operation, err));
    query_begin(&query, db, SQL_TOKEN_EPOCH_MOVE);
    return query_run(&query, err);
}

enum ischia_code store_token_forget(struct store *store, int64_t *ret_count,
                                    struct ischia_error *err)
{
    int64_t count = 0;
    struct write write = {.run = token_forget_run, .operation = &count};
    TRY(write_run(store, &write, err));
    *ret_count = count;
    return ISCHIA_OK;
}

static enum ischia_code show_tokens(struct db *db, store_on_token *on_token, void *context,
                                    struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_TOKEN_LIST);
    enum ischia_code code;
    for (bool more = true;;) {
        struct store_token token = {0};
        code = query_step(&query, &more, err);
        if (code == ISCHIA_OK && more) code = read_token(&query, &token, err);
        if (code != ISCHIA_OK || !more || !on_token(context, &token)) break;
    }
    query_end(&query);
    return code;
}

enum ischia_code store_token_list(struct store *store, store_on_token *on_token, void *context,
                                  struct ischia_error *err)
{
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = show_tokens(db, on_token, context, err);
    reader_give(store, db);
    return code;
}

enum ischia_code store_token_epoch(struct store *store, int64_t *ret_epoch,
                                   struct ischia_error *err)
{
    struct db *db = NULL;
    struct query query;
    TRY(reader_take(store, &db, err));
    query_begin(&query, db, SQL_TOKEN_EPOCH);
    const enum ischia_code code = query_number(&query, 0, ret_epoch, err);
    reader_give(store, db);
    return code;
}

/* --------------------------------------------------------------------------------- audit */

/* A row's hash: SHA-256 over the hash before it and every field, each with its length before it
 * (digest.h), numbers in decimal. The first row follows 32 zero bytes. */
static void chain(const unsigned char before[STORE_DIGEST_BYTES], const struct store_audit *row,
                  unsigned char ret_hash[STORE_DIGEST_BYTES])
{
    char seq[24], at_ms[24];
    (void)snprintf(seq, sizeof seq, "%lld", (long long)row->seq);
    (void)snprintf(at_ms, sizeof at_ms, "%lld", (long long)row->at_ms);
    const struct digest_part parts[] = {
        {before, STORE_DIGEST_BYTES}, digest_text(seq),         digest_text(at_ms),
        digest_text(row->who),        digest_text(row->what),   digest_text(row->subject),
        digest_text(row->outcome),    digest_text(row->detail),
    };
    digest_parts(parts, sizeof parts / sizeof parts[0], ret_hash);
}

/* Asked once in a transaction: nobody else writes meanwhile. */
static enum ischia_code find_head(struct db *db, struct audit_head *head, struct ischia_error *err)
{
    struct query query;
    bool row = false;
    if (head->known) return ISCHIA_OK;
    *head = (struct audit_head){0};
    query_begin(&query, db, SQL_AUDIT_HEAD);
    enum ischia_code code = query_step(&query, &row, err);
    if (code == ISCHIA_OK && row) {
        head->seq = query_integer(&query, 0);
        code = query_blob(&query, 1, head->hash, STORE_DIGEST_BYTES, err);
    }
    query_end(&query);
    head->known = code == ISCHIA_OK;
    return code;
}

static enum ischia_code audit_run(struct store *store, struct db *db, void *operation,
                                  struct ischia_error *err)
{
    struct store_audit *row = operation;
    struct audit_head *head = &store->audit_head;
    TRY(find_head(db, head, err));
    row->seq = ++head->seq;
    row->at_ms = store_now_ms(store);
    chain(head->hash, row, row->hash);
    memcpy(head->hash, row->hash, STORE_DIGEST_BYTES);
    struct query query;
    query_begin(&query, db, SQL_AUDIT_ADD);
    query_put_integer(&query, row->seq);
    query_put_integer(&query, row->at_ms);
    query_put_text(&query, row->who);
    query_put_text(&query, row->what);
    query_put_text(&query, row->subject);
    query_put_text(&query, row->outcome);
    query_put_text(&query, row->detail);
    query_put_blob(&query, row->hash, STORE_DIGEST_BYTES);
    return query_run(&query, err);
}

enum ischia_code store_audit_append(struct store *store, const struct store_audit *row,
                                    struct ischia_error *err)
{
    struct store_audit copy = *row;
    struct write write = {.run = audit_run, .operation = &copy};
    return write_run(store, &write, err);
}

struct audit_later {
    struct store_audit row;
    struct write write;
    char text[]; /* of row */
};

static void audit_done(struct store *store, struct write *write)
{
    struct audit_later *later = (struct audit_later *)write->operation;
    if (write->code != ISCHIA_OK) {
        (void)pthread_mutex_lock(&store->write_lock);
        store->audit_failures++;
        (void)pthread_mutex_unlock(&store->write_lock);
    }
    free(later);
}

enum ischia_code store_audit_append_later(struct store *store, const struct store_audit *row,
                                          struct ischia_error *err)
{
    struct store_audit copy = *row;
    const char **const texts[] = {&copy.who, &copy.what, &copy.subject, &copy.outcome,
                                  &copy.detail};
    const size_t count = sizeof texts / sizeof texts[0];
    size_t room = 0;
    for (size_t i = 0; i < count; i++) room += strlen(*texts[i]) + 1;
    struct audit_later *later = malloc(sizeof *later + room);
    CHECK(later != NULL, err, ISCHIA_E_MEMORY, "no memory for an audit row");
    char *free_text = later->text;
    for (size_t i = 0; i < count; i++) {
        const char *source = *texts[i];
        *texts[i] = free_text;
        free_text = stpcpy(free_text, source) + 1;
    }
    later->row = copy;
    later->write = (struct write){.run = audit_run, .operation = later, .done = audit_done};
    const enum ischia_code code = write_later(store, &later->write, err);
    if (code != ISCHIA_OK) free(later);
    return code;
}

static enum ischia_code show_audit(struct db *db, int64_t since, store_on_audit *on_row,
                                   void *context, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_AUDIT_LIST);
    query_put_integer(&query, since);
    enum ischia_code code;
    for (bool more = true;;) {
        const char *text[5] = {NULL};
        struct store_audit row = {0};
        code = query_step(&query, &more, err);
        if (code != ISCHIA_OK || !more) break;
        for (int i = 0; i < 5; i++) text[i] = query_peek_text(&query, 2 + i);
        row = (struct store_audit){.seq = query_integer(&query, 0),
                                   .at_ms = query_integer(&query, 1),
                                   .who = text[0],
                                   .what = text[1],
                                   .subject = text[2],
                                   .outcome = text[3],
                                   .detail = text[4]};
        code = query_blob(&query, 7, row.hash, STORE_DIGEST_BYTES, err);
        if (code != ISCHIA_OK || !on_row(context, &row)) break;
    }
    query_end(&query);
    return code;
}

enum ischia_code store_audit_list(struct store *store, int64_t since, store_on_audit *on_row,
                                  void *context, struct ischia_error *err)
{
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = show_audit(db, since, on_row, context, err);
    reader_give(store, db);
    return code;
}

static bool verify_row(void *context, const struct store_audit *row)
{
    struct store_audit_report *report = context;
    unsigned char expected[STORE_DIGEST_BYTES];
    report->rows++;
    chain(report->head_hash, row, expected);
    const bool holds =
        row->seq == report->head_seq + 1 && memcmp(expected, row->hash, STORE_DIGEST_BYTES) == 0;
    if (!holds && report->first_bad_seq == 0) report->first_bad_seq = row->seq;
    report->head_seq = row->seq;
    memcpy(report->head_hash, row->hash, STORE_DIGEST_BYTES);
    return true;
}

enum ischia_code store_audit_verify(struct store *store, struct store_audit_report *ret,
                                    struct ischia_error *err)
{
    struct store_audit_report report = {0};
    TRY(store_audit_list(store, 0, verify_row, &report, err));
    *ret = report;
    return ISCHIA_OK;
}

/* --------------------------------------------------------------------------------- probe */

static enum ischia_code probe_run(struct store *store, struct db *db, void *operation,
                                  struct ischia_error *err)
{
    (void)operation;
    struct query query;
    query_begin(&query, db, SQL_PROBE);
    query_put_integer(&query, store_now_ms(store));
    return query_run(&query, err);
}

enum ischia_code store_probe(struct store *store, struct ischia_error *err)
{
    struct write write = {.run = probe_run};
    return write_run(store, &write, err);
}
