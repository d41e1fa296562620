/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_CASE_PLACES_H
#define ISCHIA_API_CASE_PLACES_H

#include "api/case_doc.h"

/*
 * A case that is read out of somebody else's document: the values go through case_doc_fields, and
 * their faults are reported where the document has them.
 */
enum { CASE_PLACES_MAX = 24 };
struct case_places {
    struct case_doc_fields fields;
    struct doc_faults found; /* of fields: pointers are "/muM" */
    char found_at[DOC_FAULTS_MAX][DOC_POINTER_BYTES];
    struct {
        char key[16], where[DOC_POINTER_BYTES];
        bool refused;
    } place[CASE_PLACES_MAX];
    int count;
};

/* In place: it must not be moved. *request is filled as by case_doc_fields. */
void case_places_init(struct case_places *ret, struct ischia_request *request);
/* A value, as case_doc_fields_set, and where in the document it stands. */
void case_places_set(struct case_places *places, const char *key, const char *value,
                     const char *where);
/* A key that was given, but refused by the caller: it is not reported as missing too. */
void case_places_refuse(struct case_places *places, const char *key, const char *where);
/* Where a key was given first; NULL when it was not. */
const char *case_places_find(const struct case_places *places, const char *key);
/* Checks the whole and adds every fault to *faults. What was never given is reported at `before`
 * alone when `after` is NULL, else at before + key + after. */
void case_places_end(struct case_places *places, struct doc_faults *faults, const char *before,
                     const char *after);

#endif
