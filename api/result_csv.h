/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_RESULT_CSV_H
#define ISCHIA_API_RESULT_CSV_H

#include <stdbool.h>

#include "api/text.h"
#include "solver/result.h"

/* The result columns of CSV files, in the order of docs/API.md: `ischia cohort` and
 * GET /v1/assessments write them from this one table. */
enum { RESULT_CSV_COLUMN_COUNT = 18 };
extern const char *const result_csv_columns[RESULT_CSV_COLUMN_COUNT]; /* "status", "reason", ... */

/* The column names, each preceded by a comma unless `first`. */
void result_csv_put_header(struct text_out *out, bool first);

/*
 * status: "succeeded", "failed", "refused", ...; reason: "" or why, in words. A result that did not
 * converge has only newton_iterations and wall_s, NULL has nothing: the other fields are empty.
 * No line end.
 */
void result_csv_put(struct text_out *out, const char *status, const char *reason,
                    const struct ischia_result *result, bool first);

#endif
