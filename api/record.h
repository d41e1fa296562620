/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_RECORD_H
#define ISCHIA_API_RECORD_H

#include "api/assessment_doc.h"
#include "api/case_doc.h"
#include "api/risk.h"
#include "solver/result.h"
#include "solver/study/uncertainty.h"

/*
 * One assessment as record systems see it: what FHIR resources, HL7 v2 messages and CDS cards are
 * written from. The origin is what only the sending system understands, given back as it came.
 */
enum { ORIGIN_TEXT_BYTES = 256, ORIGIN_DIGITS_BYTES = 64 };

struct origin {
    char reference[ORIGIN_TEXT_BYTES];         /* FHIR: "Patient/123"; "": none               */
    char identifier_system[ORIGIN_TEXT_BYTES]; /* of the person, FHIR Identifier              */
    char identifier_value[ORIGIN_TEXT_BYTES];
    char pid[ORIGIN_TEXT_BYTES];    /* HL7 v2: PID-3 as it came, escapes and all          */
    char placer[ORIGIN_TEXT_BYTES]; /* HL7 v2: OBR-2 as it came                           */
    char digits[ISCHIA_PARAM_COUNT][ORIGIN_DIGITS_BYTES]; /* inputs as written; "": shortest */
};

/* True when there is anything in it. */
bool origin_is_given(const struct origin *origin);
/* The origin as one JSON text, the caller's to free; origin_read reads it back. */
ISCHIA_MUST_CHECK enum ischia_code origin_text(char **ret_text, const struct origin *origin,
                                               struct ischia_error *err);
/* ISCHIA_E_INPUT when it is not one that origin_text wrote; *ret is untouched then. */
ISCHIA_MUST_CHECK enum ischia_code origin_read(struct origin *ret, const char *json,
                                               struct ischia_error *err);

struct record {
    char id[ASSESSMENT_ID_BYTES];
    long long version; /* grows with every change */
    enum assessment_status status;
    char created_at[ASSESSMENT_TIME_BYTES];
    char finished_at[ASSESSMENT_TIME_BYTES]; /* "": not yet                                 */
    char updated_at[ASSESSMENT_TIME_BYTES];
    struct ischia_request request;
    struct origin origin;
    struct ischia_result result; /* valid when succeeded */
    struct risk risk;            /* likewise             */
    bool has_uncertainty;        /* the request gave standard deviations, and it succeeded */
    struct ischia_uncertainty uncertainty;
    char problem[ISCHIA_ERROR_MESSAGE_BYTES]; /* why it failed; ""                         */
};

/* The digits of a number of the record: as the sender wrote them, or the shortest. "" when the
 * record has no such number (yet). Returns buffer or the origin's own text. */
const char *record_digits(const struct record *record, int measure, char buffer[TEXT_NUMBER_BYTES]);

/* "left ischial tuberosity", or without the side. */
const char *record_site(const struct record *record);

#endif
