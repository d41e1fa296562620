/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_DOCUMENTS_H
#define ISCHIA_SERVER_DOCUMENTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "api/json.h"
#include "server/store/store.h"
#include "solver/error.h"

/*
 * Rows of the store as the documents that clients see, and a small cache of those that cannot
 * change any more but by being erased.
 */

enum { DOCUMENTS_TIME_BYTES = 32 };

/* "2026-03-01T09:30:00.123Z"; "" for 0. */
void documents_time(int64_t unix_ms, char ret[DOCUMENTS_TIME_BYTES]);

/* Writes the row's members into the object that is open in out. fraction: 0 … 1. ISCHIA_E_INPUT
 * when the row holds what this program cannot read. */
ISCHIA_MUST_CHECK enum ischia_code documents_write(struct json_out *out,
                                                   const struct store_assessment *row,
                                                   double fraction, struct ischia_error *err);

/* The seven inputs and options of a row, and who and when, as they were asked for. */
struct ischia_request;
ISCHIA_MUST_CHECK enum ischia_code documents_request(struct ischia_request *ret,
                                                     const struct store_assessment *row,
                                                     struct ischia_error *err);

/* A text shared by those who send it. */
struct document {
    int owners; /* atomic */
    size_t size;
    char text[];
};
void document_release(void *document); /* also fits http_response.release */

struct documents;

/* *ret is the caller's to destroy. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code documents_create(struct documents **ret,
                                                    struct ischia_error *err);
void documents_destroy(struct documents *documents); /* NULL allowed */

/* The document of an assessment as of its change_seq, with one more owner; NULL: not kept. */
struct document *documents_find(struct documents *documents, const struct uuid *id,
                                int64_t change_seq);
/* Keeps a copy of text and returns it with an owner of its own; NULL: no memory. */
struct document *documents_keep(struct documents *documents, const struct uuid *id,
                                int64_t change_seq, const char *text, size_t size);
/* Forgets one that was erased, and overwrites its bytes once nobody sends it any more. */
void documents_forget(struct documents *documents, const struct uuid *id);

#endif
