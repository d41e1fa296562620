/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_CDS_H
#define ISCHIA_API_CDS_H

#include <stdbool.h>
#include <stddef.h>

#include "api/faults.h"
#include "api/json.h"
#include "api/record.h"

/*
 * CDS Hooks 2.0, as documents: what a record system asks when a chart is opened or an order is
 * chosen, the cards it gets, and what the clinician answered. The routes are in handle_cds.c.
 */
enum cds_service { CDS_PATIENT_VIEW, CDS_ORDER_SELECT, CDS_SERVICE_COUNT };
struct cds_service_info {
    const char *id, *hook, *title, *description;
};
extern const struct cds_service_info cds_services[CDS_SERVICE_COUNT];

/* Writes the members of the discovery document, which is open in out. */
void cds_put_discovery(struct json_out *out);

struct cds_request {
    char patient[ORIGIN_TEXT_BYTES];            /* "Patient/ID", from the context's patientId */
    bool has_observations;                      /* the prefetch is there: a Bundle            */
    char measured_at[ISCHIA_MEASURED_AT_BYTES]; /* of its newest measurement of ours; "": none */
};

/* Reads the body of a hook. Good when the code is ISCHIA_OK and no fault was added; without
 * has_observations the caller refuses it (412). Errors as json_parse with json_limits_record. */
ISCHIA_MUST_CHECK enum ischia_code cds_read(struct cds_request *ret, enum cds_service service,
                                            const char *json, size_t length,
                                            struct doc_faults *faults, struct ischia_error *err);

/* The card of the last assessment, into the array that is open in out. other: the last of the other
 * side, NULL when there is none. measured_at: of cds_read. origin: "https://host". */
void cds_put_card(struct json_out *out, const struct record *last, const struct record *other,
                  const char *measured_at, const char *origin);

enum { CDS_FEEDBACK_MAX = 64 };
struct cds_feedback {
    char card[ASSESSMENT_ID_BYTES];
    char *document; /* what is stored of it: one JSON object; freed by cds_feedback_finish */
};

/* Reads the body of a feedback: at most CDS_FEEDBACK_MAX items. As cds_read; *ret_count items are
 * the caller's to finish, also when faults were added. */
ISCHIA_MUST_CHECK enum ischia_code
cds_read_feedback(struct cds_feedback *ret, size_t *ret_count, const char *json, size_t length,
                  struct doc_faults *faults, struct ischia_error *err);
void cds_feedback_finish(struct cds_feedback *items, size_t count);

#endif
