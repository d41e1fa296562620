/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_FHIR_H
#define ISCHIA_API_FHIR_H

#include <stdbool.h>
#include <stddef.h>

#include "api/faults.h"
#include "api/json.h"
#include "api/problem_doc.h"
#include "api/record.h"

/*
 * FHIR R4 (4.0.1), JSON only: reading what $assess is given, writing resources. Pure documents; the
 * routes are in server/http/handle_fhir*.c. Numbers come from api/measure.h, row by row.
 */
#define FHIR_VERSION    "4.0.1"
#define FHIR_MEDIA_TYPE "application/fhir+json"

/* Our own codes. A URN, so that two installations mean the same by it. */
#define FHIR_MEASURE_SYSTEM    "urn:ischia:measure"    /* the numbers: api/measure.h     */
#define FHIR_BAND_SYSTEM       "urn:ischia:band"       /* which thresholds are crossed   */
#define FHIR_ASSESSMENT_SYSTEM "urn:ischia:assessment" /* one code: what is done         */
#define FHIR_ASSESSMENT_CODE   "tissue-strain"
#define FHIR_SUBJECT_SYSTEM    "urn:ischia:subject" /* the pseudonymous ids of /v1    */
#define FHIR_UCUM_SYSTEM       "http://unitsofmeasure.org"
#define FHIR_SNOMED_SYSTEM     "http://snomed.info/sct"
#define FHIR_SNOMED_SITE       "69030007" /* ischial tuberosity structure  */
#define FHIR_DEVICE_ID         "ischia"

enum { FHIR_ID_BYTES = 65 };

/* ---- reading ---- */

struct fhir_input {
    struct ischia_request request; /* subject stays "": the caller makes it of the origin */
    struct origin origin;
};

/*
 * Parameters, or a Bundle with Observations, or Parameters with such a Bundle. Good when the code
 * is ISCHIA_OK and faults->count is 0. Pointers of faults are FHIRPath expressions. Errors as
 * json_parse with json_limits_record.
 */
ISCHIA_MUST_CHECK enum ischia_code fhir_read_assess(struct fhir_input *ret, const char *json,
                                                    size_t length, struct doc_faults *faults,
                                                    struct ischia_error *err);

/* True for "Patient/" and an id of FHIR; *ret_id is where the id begins, and nothing follows it. */
bool fhir_is_local_patient(const char *reference, const char **ret_id);

/* ---- writing: each writes one resource as a value under key (NULL inside arrays) ---- */

enum fhir_type {
    FHIR_RISK_ASSESSMENT,
    FHIR_OBSERVATION,
    FHIR_DIAGNOSTIC_REPORT,
    FHIR_PROVENANCE,
    FHIR_DEVICE,
    FHIR_OPERATION_DEFINITION,
    FHIR_CODE_SYSTEM,
    FHIR_STRUCTURE_DEFINITION,
    FHIR_TYPE_COUNT
};
extern const char *const fhir_type_names[FHIR_TYPE_COUNT];

/* "…-eps-max" -> the id of the assessment (36 characters) and the measure; false for others. */
bool fhir_observation_id(const char *id, char ret_assessment[ASSESSMENT_ID_BYTES],
                         int *ret_measure);

/* The central resource: basis, prediction, caveats. */
void fhir_put_risk_assessment(struct json_out *out, const char *key, const struct record *record);
/* The record has this number (record_digits is not ""). */
void fhir_put_observation(struct json_out *out, const char *key, const struct record *record,
                          int measure);
/* html: the report to attach, "" for none. contained: the Observations and the Device come inside,
 * for a server that has nothing else of ours. */
void fhir_put_diagnostic_report(struct json_out *out, const char *key, const struct record *record,
                                const char *html, bool contained);
/* What was made of what, by which Device. */
void fhir_put_provenance(struct json_out *out, const char *key, const struct record *record);
/* This software and its version. */
void fhir_put_device(struct json_out *out, const char *key);

/* The members of the object that is open in out. base: "https://host/fhir". */
void fhir_put_capability_statement(struct json_out *out, const char *base);
/* The definition with this type and id; false (and nothing written) when there is none. */
bool fhir_put_definition(struct json_out *out, enum fhir_type type, const char *id);
/* Ids of the definitions of a type, NULL behind the last. */
const char *fhir_definition_id(enum fhir_type type, size_t index);

/* Every error of every route under /fhir: the members of the object that is open in out. */
void fhir_put_outcome(struct json_out *out, const struct problem *problem);
/* The whole object on one line, the caller's to free. */
ISCHIA_MUST_CHECK enum ischia_code fhir_outcome_text(char **ret_text, const struct problem *problem,
                                                     struct ischia_error *err);

/* The resources of one assessment as a Bundle's entries: RiskAssessment, Observations,
 * DiagnosticReport, Provenance, Device. */
void fhir_put_entries(struct json_out *out, const char *base, const struct record *record,
                      const char *html);

#endif
