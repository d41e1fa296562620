/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/text.h"
#include "server/store/engine.h"

/* ------------------------------------------------------------------------ one assessment */

void store_assessment_finish(struct store_assessment *a)
{
    free(a->subject);
    free(a->side);
    free(a->label);
    free(a->measured_at);
    free(a->case_json);
    free(a->warnings_json);
    free(a->problem_json);
    free(a->result_json);
    free(a->origin_json);
    *a = (struct store_assessment){0};
}

/* The columns of sql_assessment_columns, in their order. */
enum {
    COLUMN_FIRST_TEXT = 10,
    COLUMN_PROBLEM = 16,
    COLUMN_RESULT = 17,
    COLUMN_HAS_FIELD = 18,
    COLUMN_ORIGIN = 19
};

static enum ischia_code read_numbers(struct query *query, struct store_assessment *ret,
                                     struct ischia_error *err)
{
    TRY(query_blob(query, 0, ret->id.byte, UUID_BYTES, err));
    ret->seq = query_integer(query, 1);
    ret->change_seq = query_integer(query, 2);
    ret->state = (enum queue_state)query_integer(query, 3);
    ret->priority = (enum queue_priority)query_integer(query, 4);
    ret->created_ms = query_integer(query, 5);
    ret->started_ms = query_integer(query, 6);
    ret->finished_ms = query_integer(query, 7);
    ret->attempt = query_integer(query, 8);
    ret->cached = query_integer(query, 9) != 0;
    ret->has_field = query_integer(query, COLUMN_HAS_FIELD) != 0;
    return ISCHIA_OK;
}

/* On error *ret holds what there is: the caller finishes it. */
static enum ischia_code read_assessment(struct query *query, bool with_texts, bool with_documents,
                                        struct store_assessment *ret, struct ischia_error *err)
{
    TRY(read_numbers(query, ret, err));
    char **const text[] = {&ret->subject,     &ret->side,      &ret->label,
                           &ret->measured_at, &ret->case_json, &ret->warnings_json};
    for (int i = 0; with_texts && i < (int)(sizeof text / sizeof text[0]); i++)
        TRY(query_text(query, COLUMN_FIRST_TEXT + i, text[i], err));
    if (with_texts) TRY(query_text(query, COLUMN_ORIGIN, &ret->origin_json, err));
    if (!with_documents) return ISCHIA_OK;
    TRY(query_text(query, COLUMN_PROBLEM, &ret->problem_json, err));
    return query_text(query, COLUMN_RESULT, &ret->result_json, err);
}

static enum ischia_code get_from(struct db *db, const struct uuid *id, bool texts,
                                 struct store_assessment *ret, bool *ret_found,
                                 struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_GET);
    query_put_blob(&query, id->byte, UUID_BYTES);
    enum ischia_code code = query_step(&query, ret_found, err);
    if (code == ISCHIA_OK && *ret_found) code = read_assessment(&query, texts, texts, ret, err);
    query_end(&query);
    return code;
}

static enum ischia_code get(struct store *store, const struct uuid *id, bool texts,
                            struct store_assessment *ret, enum store_answer *ret_answer,
                            struct ischia_error *err)
{
    struct db *db = NULL;
    struct store_assessment found = {0};
    bool is_there = false;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = get_from(db, id, texts, &found, &is_there, err);
    reader_give(store, db);
    if (code != ISCHIA_OK) {
        store_assessment_finish(&found);
        return code;
    }
    *ret_answer = is_there ? STORE_DONE : STORE_NOT_FOUND;
    if (is_there) *ret = found;
    return ISCHIA_OK;
}

enum ischia_code store_get(struct store *store, const struct uuid *id, struct store_assessment *ret,
                           enum store_answer *ret_answer, struct ischia_error *err)
{
    return get(store, id, true, ret, ret_answer, err);
}

enum ischia_code store_peek(struct store *store, const struct uuid *id,
                            struct store_assessment *ret, enum store_answer *ret_answer,
                            struct ischia_error *err)
{
    return get(store, id, false, ret, ret_answer, err);
}

static enum ischia_code copy_field(struct query *query, unsigned char **ret_bytes, size_t *ret_size,
                                   enum store_answer *ret_answer, struct ischia_error *err)
{
    bool row = false;
    TRY(query_step(query, &row, err));
    *ret_answer = row ? STORE_CONFLICT : STORE_NOT_FOUND;
    if (!row) return ISCHIA_OK;
    size_t size = 0;
    const void *bytes = query->db->engine->bytes(query, 0, &size);
    if (bytes == NULL && size == 0) return ISCHIA_OK;
    unsigned char *copy = malloc(size > 0 ? size : 1);
    if (copy == NULL || bytes == NULL) {
        free(copy);
        return FAIL(err, ISCHIA_E_MEMORY, "no memory for a stored field");
    }
    if (size > 0) memcpy(copy, bytes, size);
    *ret_bytes = copy;
    *ret_size = size;
    *ret_answer = STORE_DONE;
    return ISCHIA_OK;
}

enum ischia_code store_get_field(struct store *store, const struct uuid *id,
                                 unsigned char **ret_bytes, size_t *ret_size,
                                 enum store_answer *ret_answer, struct ischia_error *err)
{
    struct db *db = NULL;
    struct query query;
    TRY(reader_take(store, &db, err));
    query_begin(&query, db, SQL_FIELD);
    query_put_blob(&query, id->byte, UUID_BYTES);
    const enum ischia_code code = copy_field(&query, ret_bytes, ret_size, ret_answer, err);
    query_end(&query);
    reader_give(store, db);
    return code;
}

/* ------------------------------------------------------------------------------- listing */

/* A cursor is "c" and the seq of the last row shown, in hexadecimal. */
static bool read_cursor(const char *cursor, int64_t *ret_before)
{
    uint64_t seq = 0;
    const size_t length = strnlen(cursor, STORE_CURSOR_BYTES);
    if (length < 2 || length > 17 || cursor[0] != 'c') return false;
    for (const char *c = cursor + 1; *c != '\0'; c++) {
        const char *const digits = "0123456789abcdef";
        const char *digit = strchr(digits, *c);
        if (digit == NULL) return false;
        seq = seq << 4 | (uint64_t)(digit - digits);
    }
    if (seq == 0 || seq > INT64_MAX) return false;
    *ret_before = (int64_t)seq;
    return true;
}

static int64_t upper(int64_t bound_ms) { return bound_ms == 0 ? INT64_MAX : bound_ms; }

/* The values of sql_alternative. */
static void put_alternative(struct query *query, const struct store_alternative *a)
{
    switch (a->kind) {
    case STORE_HAS_ID:
        query_put_blob(query, a->id.byte, UUID_BYTES);
        return;
    case STORE_OF_PERSON:
        query_put_text(query, a->subject);
        query_put_text(query, a->reference);
        return;
    case STORE_IN_STATES:
        query_put_integer(query, (int64_t)a->states);
        return;
    case STORE_ENDED: /* finished_ms is 0 until the end */
        query_put_integer(query, a->from_ms == 0 ? 1 : a->from_ms);
        break;
    default:
        query_put_integer(query, a->from_ms);
        break;
    }
    query_put_integer(query, upper(a->before_ms));
}

static void put_alternative_text(struct text_out *out, const struct db *db,
                                 const struct store_filter *filter, int i)
{
    const struct store_alternative *a = &filter->alternative[i];
    const bool first = i == 0 || a->condition != a[-1].condition;
    const bool last = i + 1 == filter->alternative_count || a->condition != a[1].condition;
    text_put_string(out, first ? " AND (" : " OR ");
    text_put_string(out, sql_for(db->engine, &sql_alternative[a->kind]));
    if (last) text_put_string(out, ")");
}

/* Only the conditions that are asked for: each combination then finds its index. */
static enum ischia_code list_text(const struct db *db, const struct store_filter *filter,
                                  char **ret, struct ischia_error *err)
{
    struct text_out out;
    text_out_init(&out);
    text_put_string(&out, "SELECT ");
    text_put_string(&out, sql_assessment_columns);
    text_put_string(&out, " FROM assessment a LEFT JOIN solution s ON s.rowid = a.solution "
                          "LEFT JOIN origin o ON o.assessment = a.seq WHERE a.seq < ?");
    if (filter->subject != NULL) text_put_string(&out, " AND a.subject = ?");
    if (filter->side != NULL) text_put_string(&out, " AND a.side = ?");
    if (filter->by_state) text_put_string(&out, " AND a.state = ?");
    for (int i = 0; i < filter->alternative_count; i++) put_alternative_text(&out, db, filter, i);
    text_put_string(&out, " ORDER BY a.seq DESC LIMIT ?");
    return text_out_take(&out, ret, NULL, err);
}

struct listing {
    const struct store_filter *filter;
    store_on_assessment *on_row;
    void *context;
    int64_t last_seq; /* 0: no further page */
};

/* *ret_more: go on. */
static enum ischia_code show_row(struct query *query, struct listing *listing, bool *ret_more,
                                 struct ischia_error *err)
{
    struct store_assessment row = {0};
    const enum ischia_code code =
        read_assessment(query, true, listing->filter->with_results, &row, err);
    if (code == ISCHIA_OK) {
        listing->last_seq = row.seq;
        *ret_more = listing->on_row(listing->context, &row);
    }
    store_assessment_finish(&row);
    return code;
}

/* One row more than the limit is asked for: whether it exists says if there is a next page. */
static enum ischia_code show_rows(struct query *query, struct listing *listing,
                                  struct ischia_error *err)
{
    bool more = true;
    for (int shown = 0; more; shown++) {
        bool row = false;
        TRY(query_step(query, &row, err));
        if (!row) listing->last_seq = 0;
        if (!row || shown == listing->filter->limit) return ISCHIA_OK;
        TRY(show_row(query, listing, &more, err));
    }
    return ISCHIA_OK;
}

static enum ischia_code list_from(struct db *db, struct listing *listing, int64_t before,
                                  struct ischia_error *err)
{
    const struct store_filter *filter = listing->filter;
    char *text = NULL;
    struct query query;
    TRY(list_text(db, filter, &text, err));
    query_begin_text(&query, db, text);
    query_put_integer(&query, before);
    if (filter->subject != NULL) query_put_text(&query, filter->subject);
    if (filter->side != NULL) query_put_text(&query, filter->side);
    if (filter->by_state) query_put_integer(&query, (int64_t)filter->state);
    for (int i = 0; i < filter->alternative_count; i++)
        put_alternative(&query, &filter->alternative[i]);
    query_put_integer(&query, filter->limit + 1);
    const enum ischia_code code = show_rows(&query, listing, err);
    query_end(&query);
    free(text);
    return code;
}

enum ischia_code store_list(struct store *store, const struct store_filter *filter,
                            store_on_assessment *on_row, void *context,
                            char ret_cursor[STORE_CURSOR_BYTES], struct ischia_error *err)
{
    int64_t before = INT64_MAX;
    CHECK(filter->limit >= 1 && filter->limit <= STORE_LIST_LIMIT_MAX, err, ISCHIA_E_INPUT,
          "limit is %d; accepted 1 to %d", filter->limit, STORE_LIST_LIMIT_MAX);
    CHECK(filter->alternative_count <= STORE_ALTERNATIVES_MAX, err, ISCHIA_E_INPUT,
          "more than %d alternatives", STORE_ALTERNATIVES_MAX);
    CHECK(filter->cursor == NULL || read_cursor(filter->cursor, &before), err, ISCHIA_E_INPUT,
          "the cursor is not one that a listing returned");
    struct listing listing = {.filter = filter, .on_row = on_row, .context = context};
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = list_from(db, &listing, before, err);
    reader_give(store, db);
    TRY(code);
    ret_cursor[0] = '\0';
    if (listing.last_seq != 0)
        (void)snprintf(ret_cursor, STORE_CURSOR_BYTES, "c%llx", (long long)listing.last_seq);
    return ISCHIA_OK;
}

/* ------------------------------------------------------------------------------- changes */

static enum ischia_code show_changes(struct query *query, store_on_change *on_change, void *context,
                                     struct ischia_error *err)
{
    for (bool more = true; more;) {
        struct store_change change = {0};
        bool row = false;
        TRY(query_step(query, &row, err));
        if (!row) return ISCHIA_OK;
        change.seq = query_integer(query, 0);
        change.kind = (enum store_change_kind)query_integer(query, 1);
        TRY(query_blob(query, 2, change.id.byte, UUID_BYTES, err));
        change.at_ms = query_integer(query, 3);
        more = on_change(context, &change);
    }
    return ISCHIA_OK;
}

static enum ischia_code last_change(struct db *db, int64_t *ret_last, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_CHANGES_LAST);
    return query_number(&query, 0, ret_last, err);
}

static enum ischia_code changes_from(struct db *db, int64_t since, int limit,
                                     store_on_change *on_change, void *context, int64_t *ret_last,
                                     struct ischia_error *err)
{
    struct query query;
    /* the end first: a change made meanwhile is then beyond it, never before it and unseen */
    TRY(last_change(db, ret_last, err));
    query_begin(&query, db, SQL_CHANGES);
    query_put_integer(&query, since);
    query_put_integer(&query, limit);
    const enum ischia_code code = show_changes(&query, on_change, context, err);
    query_end(&query);
    return code;
}

enum ischia_code store_changes(struct store *store, int64_t since, int limit,
                               store_on_change *on_change, void *context, int64_t *ret_last,
                               struct ischia_error *err)
{
    CHECK(limit >= 1 && limit <= STORE_LIST_LIMIT_MAX, err, ISCHIA_E_INPUT,
          "limit is %d; accepted 1 to %d", limit, STORE_LIST_LIMIT_MAX);
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = changes_from(db, since, limit, on_change, context, ret_last, err);
    reader_give(store, db);
    return code;
}

/* ------------------------------------------------------------------------------- numbers */

static enum ischia_code read_tally(struct db *db, struct store_stats *ret, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_TALLY_ALL);
    enum ischia_code code;
    for (bool row = true;;) {
        code = query_step(&query, &row, err);
        if (code != ISCHIA_OK || !row) break;
        const int64_t state = query_integer(&query, 0);
        if (state >= 0 && state < QUEUE_STATE_COUNT) ret->count[state] = query_integer(&query, 1);
    }
    query_end(&query);
    return code;
}

static enum ischia_code read_oldest(struct db *db, struct store_stats *ret,
                                    struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_OLDEST_QUEUED);
    return query_number(&query, 0, &ret->oldest_queued_ms, err);
}

static void copy_counts(struct store *store, struct store_stats *ret)
{
    (void)pthread_mutex_lock(&store->write_lock);
    ret->writes = store->writes;
    ret->commits = store->commits;
    ret->write_failures = store->write_failures;
    ret->audit_failures = store->audit_failures;
    memcpy(ret->latency_count, store->latency_count, sizeof ret->latency_count);
    ret->latency_sum_ms = store->latency_sum_ms;
    (void)pthread_mutex_unlock(&store->write_lock);
}

enum ischia_code store_stats(struct store *store, struct store_stats *ret, struct ischia_error *err)
{
    struct store_stats stats = {0};
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    enum ischia_code code = read_tally(db, &stats, err);
    if (code == ISCHIA_OK) code = read_oldest(db, &stats, err);
    if (code == ISCHIA_OK) stats.size_bytes = store->engine->size_bytes(store, db);
    reader_give(store, db);
    TRY(code);
    copy_counts(store, &stats);
    *ret = stats;
    return ISCHIA_OK;
}
