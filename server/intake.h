/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_INTAKE_H
#define ISCHIA_SERVER_INTAKE_H

#include "api/case_doc.h"
#include "api/record.h"
#include "server/store/store.h"

/*
 * A request, from whichever door it came, as the store takes it: HTTP, FHIR and HL7 v2 all pass
 * here, so that equal numbers are the same case.
 */
struct intake {
    struct store_new what; /* without client, key and digest; its texts are below */
    struct ischia_request request;
    struct origin origin;
    char *case_json, *warnings_json, *origin_json;
};

/* origin: NULL when there is none. Where the request has no subject, it is made of the origin's
 * person. On success *ret must be finished, and must not be moved. */
ISCHIA_MUST_CHECK enum ischia_code
intake_init(struct intake *ret, const struct ischia_request *request, const struct origin *origin,
            struct ischia_error *err);
void intake_finish(struct intake *intake);

/* What a worker is given, and what makes two requests the same: nothing about the person. *ret is
 * the caller's to free. */
ISCHIA_MUST_CHECK enum ischia_code intake_case_text(const struct ischia_request *request,
                                                    char **ret, struct ischia_error *err);

/*
 * The pseudonymous subject of a person: the id of "Patient/ID" and the id of a PID-3 that names no
 * authority, as they are; any other reference, identifier or PID-3 as "x-" and 32 digits of its
 * SHA-256, so that equal ids of two systems are never taken for one person. "" when none is given.
 */
void intake_subject(const struct origin *origin, char ret[ISCHIA_SUBJECT_BYTES]);

/* A row of the store as record systems see it; the caller's copy, without further ownership.
 * ISCHIA_E_INPUT when the row holds what this program cannot read. */
ISCHIA_MUST_CHECK enum ischia_code
intake_record(struct record *ret, const struct store_assessment *row, struct ischia_error *err);

#endif
