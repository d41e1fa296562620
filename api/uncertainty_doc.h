/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_UNCERTAINTY_DOC_H
#define ISCHIA_API_UNCERTAINTY_DOC_H

#include <stdbool.h>
#include <stddef.h>

#include "api/json.h"
#include "solver/study/uncertainty.h"

/*
 * The member "uncertainty" of a result object (docs/UNCERTAINTY.md). Without an interval it says
 * why, and every number of the interval is null.
 */

/* Writes the member into the result object that is open in out. */
void uncertainty_doc_put(struct json_out *out, const struct ischia_uncertainty *u);

/* Reads what that wrote from a result object; *ret_present false when it has no such member.
 * ISCHIA_E_INPUT: a member is missing, of the wrong kind or out of bounds; else as json_parse. */
ISCHIA_MUST_CHECK enum ischia_code uncertainty_doc_read(struct ischia_uncertainty *ret,
                                                        bool *ret_present, const char *result_json,
                                                        size_t length, struct ischia_error *err);

/* The inputs in the order of their total Sobol' index, largest first; returns how many stand for
 * at least a twentieth of the spread each: what to measure better. 0 when there are no indices. */
int uncertainty_order(const struct ischia_uncertainty *u,
                      enum ischia_param ret_order[ISCHIA_PARAM_COUNT]);

#endif
