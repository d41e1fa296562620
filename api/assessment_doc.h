/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_ASSESSMENT_DOC_H
#define ISCHIA_API_ASSESSMENT_DOC_H

#include "api/case_doc.h"
#include "api/json.h"

/*
 * The assessment document of docs/API.md: one side, from queued to its end. The request's options
 * stand beside "parameters" under the names a request uses: skin, resolution, model. "warnings" are
 * those of the case (case_warnings), in English, as all words of what is kept; links other than
 * self are null until there is something behind them (field, section and report once succeeded).
 */
enum assessment_status {
    ASSESSMENT_QUEUED,
    ASSESSMENT_RUNNING,
    ASSESSMENT_SUCCEEDED,
    ASSESSMENT_FAILED,
    ASSESSMENT_CANCELLED,
    ASSESSMENT_STATUS_COUNT
};
extern const char *const assessment_status_names[ASSESSMENT_STATUS_COUNT];

enum { ASSESSMENT_ID_BYTES = 37, ASSESSMENT_TIME_BYTES = 32 };

struct assessment {
    char id[ASSESSMENT_ID_BYTES]; /* UUIDv7 in its usual text form */
    enum assessment_status status;
    char created_at[ASSESSMENT_TIME_BYTES];  /* RFC 3339, UTC, "...Z"          */
    char started_at[ASSESSMENT_TIME_BYTES];  /* "": null                       */
    char finished_at[ASSESSMENT_TIME_BYTES]; /* "": null                       */
    struct ischia_request request;
    double progress;          /* 0 ... 1                                                         */
    const char *result_json;  /* borrowed: as result_doc_text wrote it; NULL: null               */
    const char *problem_json; /* borrowed: as problem_doc_text wrote it; NULL: null              */
};

/* Writes the members of the assessment object that is open in out. The request is valid
 * (asserted). */
void assessment_doc_write(struct json_out *out, const struct assessment *assessment);

/* The whole object as one text, the caller's to free. indent as json_out. */
ISCHIA_MUST_CHECK enum ischia_code assessment_doc_text(char **ret_text,
                                                       const struct assessment *assessment,
                                                       int indent, struct ischia_error *err);

#endif
