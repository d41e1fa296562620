/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_STUDIES_H
#define ISCHIA_SERVER_STUDIES_H

#include "api/case_doc.h"
#include "api/text.h"
#include "server/store/studies.h"

/*
 * Studies between the documents that clients send and get and the rows of the store. A design's
 * results have the columns, and where it succeeded the bytes, of `ischia study factorial`; a
 * cohort's those of `ischia cohort`.
 */

/* A study as the store takes it, with what its texts point at. */
struct studies_new {
    struct store_study_new what; /* without client, key, digest and waiting_max */
    char name[ISCHIA_SUBJECT_BYTES];
    char *columns_json, *responses_json;
    struct store_study_point_new *point; /* its texts are owned here */
    size_t room;
};

/*
 * Reads a design (docs/STUDIES.md) and makes its points, at most points_max. It can be stored when
 * the code is ISCHIA_OK and faults->count is 0; in any case *ret is to be finished, and not to be
 * moved. ISCHIA_E_INPUT: not JSON. ISCHIA_E_LIMIT, ISCHIA_E_MEMORY.
 */
ISCHIA_MUST_CHECK enum ischia_code
studies_read_design(struct studies_new *ret, const char *json, size_t length, size_t points_max,
                    struct doc_faults *faults, struct ischia_error *err);

/* The same from a cohort as CSV. A row that is wrong is stored as refused, with the reason; only a
 * header that is wrong is a fault. */
ISCHIA_MUST_CHECK enum ischia_code
studies_read_cohort(struct studies_new *ret, const char *csv, size_t length, const char *name,
                    const struct case_doc_defaults *defaults, size_t points_max,
                    struct doc_faults *faults, struct ischia_error *err);
/* Fills in the case keys, for queue_accept_study. */
struct queue;
void studies_put_keys(struct studies_new *study, const struct queue *queue);

void studies_new_finish(struct studies_new *study); /* a zeroed one is allowed */

/* "queued", "running", "finished" or "cancelled". */
const char *studies_status(const struct store_study *study);

/* Writes the members of a study's document into the object that is open in out. */
struct json_out;
void studies_write(struct json_out *out, const struct store_study *study);

/* The results so far, whole. *ret is the caller's to free. */
ISCHIA_MUST_CHECK enum ischia_code studies_results_csv(struct store *store,
                                                       const struct store_study *study, char **ret,
                                                       size_t *ret_size, struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code studies_results_json(struct store *store,
                                                        const struct store_study *study, char **ret,
                                                        size_t *ret_size, struct ischia_error *err);

#endif
