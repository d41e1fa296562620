/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_UNCERTAINTY_CSV_H
#define ISCHIA_API_UNCERTAINTY_CSV_H

#include <stdbool.h>

#include "api/text.h"
#include "solver/study/uncertainty.h"

/*
 * What an interval adds to a row of a CSV file, behind the result columns:
 *   uncertainty        given, or why there is none
 *   eps_max_q05 ...    each quantity at 5, 50 and 95 % of the samples
 *   share_shear, share_compression, share_both   of the samples that cross the thresholds
 *   measure_better, measure_better_index         the input with the largest total Sobol' index
 */

/* The column names, each preceded by a comma. */
void uncertainty_csv_put_header(struct text_out *out);

/* u NULL: the row has no standard deviations, or no result. Fields without a value are empty. */
void uncertainty_csv_put(struct text_out *out, const struct ischia_uncertainty *u);

/* True when a column has one of these names. */
bool uncertainty_csv_has_column(const char *name);

#endif
