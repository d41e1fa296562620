/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_RESULT_DOC_H
#define ISCHIA_API_RESULT_DOC_H

#include <stddef.h>

#include "api/json.h"
#include "solver/case.h"
#include "solver/result.h"
#include "solver/study/uncertainty.h"

/*
 * The "result" object. A result that did not converge is written with null for strain, clusters,
 * seat, threshold_force_N and risk (nothing is made up); its load_curve holds the points that did
 * converge and numerics says the reason, the last converged force and what was tried.
 * Beside the names of docs/API.md: muscle_volume_mm3 (beside clusters), and in numerics: reason,
 * factorisations, det_F_min, last_converged_F_N, detail.
 */

/* Name and version of the model that computed a stored result. */
struct result_model {
    char name[48];
    int version;
};

/* Writes the members of the result object that is open in out. c: the case that gave it. */
void result_doc_write(struct json_out *out, const struct ischia_case *c,
                      const struct ischia_result *result);

/* The whole object as one text (indent as json_out), the caller's to free. uncertainty: NULL when
 * the inputs were taken as exact; else its member (uncertainty_doc.h) comes last. */
ISCHIA_MUST_CHECK enum ischia_code
result_doc_text(char **ret_text, const struct ischia_case *c, const struct ischia_result *result,
                const struct ischia_uncertainty *uncertainty, int indent, struct ischia_error *err);

/*
 * Reads what result_doc_write wrote, bit for bit; keys it does not know are ignored. Errors as
 * json_parse; ISCHIA_E_INPUT also when a member is missing, of the wrong kind or outside its
 * physical range (first fault in the message). ret_model: NULL allowed. Outputs untouched on error.
 */
ISCHIA_MUST_CHECK enum ischia_code
result_doc_read(struct ischia_result *ret, struct result_model *ret_model, const char *json,
                size_t length, const struct json_limits *limits, struct ischia_error *err);

#endif
