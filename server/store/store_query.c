/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/store/engine.h"

void query_begin(struct query *ret, struct db *db, enum sql sql)
{
    *ret = (struct query){.db = db, .sql = sql, .rows_stream = sql_text[sql].rows_stream};
}

void query_begin_text(struct query *ret, struct db *db, const char *text)
{
    *ret = (struct query){.db = db, .sql = SQL_COUNT, .text = text};
}

static void put(struct query *query, struct value value)
{
    assert(query->count < QUERY_VALUES_MAX);
    query->value[query->count++] = value;
}

void query_put_integer(struct query *query, int64_t value)
{
    put(query, (struct value){.kind = VALUE_INTEGER, .integer = value});
}

void query_put_text(struct query *query, const char *text)
{
    if (text == NULL)
        put(query, (struct value){.kind = VALUE_NULL});
    else
        put(query, (struct value){.kind = VALUE_TEXT, .bytes = text, .size = strlen(text)});
}

void query_put_blob(struct query *query, const void *bytes, size_t size)
{
    if (bytes == NULL)
        put(query, (struct value){.kind = VALUE_NULL});
    else
        put(query, (struct value){.kind = VALUE_BLOB, .bytes = bytes, .size = size});
}

enum ischia_code query_step(struct query *query, bool *ret_row, struct ischia_error *err)
{
    return query->db->engine->step(query, ret_row, err);
}

void query_end(struct query *query)
{
    if (query->begun) query->db->engine->end(query);
    query->begun = false;
}

enum ischia_code query_run(struct query *query, struct ischia_error *err)
{
    bool row;
    const struct engine *engine = query->db->engine;
    const enum ischia_code code =
        engine->run != NULL ? engine->run(query, err) : query_step(query, &row, err);
    query_end(query);
    return code;
}

enum ischia_code query_change(struct query *query, int64_t *ret, struct ischia_error *err)
{
    bool row;
    const enum ischia_code code = query_step(query, &row, err);
    if (code == ISCHIA_OK) *ret = query->db->engine->changed(query->db);
    query_end(query);
    return code;
}

enum ischia_code db_run(struct db *db, enum sql sql, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, sql);
    return query_run(&query, err);
}

enum ischia_code query_number(struct query *query, int64_t otherwise, int64_t *ret,
                              struct ischia_error *err)
{
    bool row = false;
    const enum ischia_code code = query_step(query, &row, err);
    if (code == ISCHIA_OK) *ret = row ? query_integer(query, 0) : otherwise;
    query_end(query);
    return code;
}

enum ischia_code db_number(struct db *db, const char *text, int64_t *ret, struct ischia_error *err)
{
    struct query query;
    query_begin_text(&query, db, text);
    return query_number(&query, 0, ret, err);
}

int64_t query_integer(struct query *query, int column)
{
    return query->db->engine->integer(query, column);
}

const char *query_peek_text(struct query *query, int column)
{
    size_t size;
    return query->db->engine->bytes(query, column, &size);
}

enum ischia_code query_text(struct query *query, int column, char **ret, struct ischia_error *err)
{
    size_t size = 0;
    const char *text = query->db->engine->bytes(query, column, &size);
    char *copy = text == NULL ? NULL : strdup(text);
    CHECK(copy != NULL || (text == NULL && size == 0), err, ISCHIA_E_MEMORY,
          "no memory for a stored text");
    *ret = copy;
    return ISCHIA_OK;
}

void query_copy_text(struct query *query, int column, char *ret, size_t size)
{
    const char *text = query_peek_text(query, column);
    (void)snprintf(ret, size, "%s", text == NULL ? "" : text);
}

enum ischia_code query_blob(struct query *query, int column, void *ret, size_t size,
                            struct ischia_error *err)
{
    size_t there = 0;
    const void *bytes = query->db->engine->bytes(query, column, &there);
    CHECK(bytes != NULL && there == size, err, ISCHIA_E_IO,
          "the store holds a value of the wrong size (damaged?)");
    memcpy(ret, bytes, size);
    return ISCHIA_OK;
}
