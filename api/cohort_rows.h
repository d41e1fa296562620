/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_COHORT_ROWS_H
#define ISCHIA_API_COHORT_ROWS_H

#include <stdbool.h>

#include "api/case_doc.h"
#include "api/csv.h"

/* What columns called sd, sd.R1 ... sd.F are to the reader: like any other; the standard deviations
 * of a row's inputs; those, and a file without a column sd has typical ones. */
enum cohort_sd { COHORT_SD_KEPT, COHORT_SD_READ, COHORT_SD_TYPICAL };

/*
 * A cohort file: a header that names the columns, then one side a row. Columns: R1 or R1_mm and so
 * on, resolution, model, and options as skin.mu or model.friction; all others are kept as they are.
 */
struct cohort_columns {
    enum cohort_sd sd;
    bool has_sd; /* rows may have standard deviations, and the header the columns of an interval */
    int count;
    const char *key[CSV_COLUMNS_MAX]; /* what a column means to us, static; NULL: an extra column */
    char *header;                     /* the columns as they are written again                    */
};

/* Reads the header row. ISCHIA_E_INPUT, and a fault for each, when a column for one of the seven is
 * missing, one is there twice, or one has the name of a result column. */
ISCHIA_MUST_CHECK enum ischia_code
cohort_columns_init(struct cohort_columns *ret, const struct csv_row *row, enum cohort_sd sd,
                    struct doc_faults *faults, struct ischia_error *err);
void cohort_columns_finish(struct cohort_columns *columns);

/* Reads a row: its fields as they are written again (ret_echo, the caller's to free) and its case,
 * over defaults for what the file has no column for. Faults are added for what is wrong with it.
 * ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code
cohort_row_read(const struct cohort_columns *columns, const struct case_doc_defaults *defaults,
                const struct csv_row *row, char **ret_echo, struct ischia_request *ret,
                struct doc_faults *faults, struct ischia_error *err);

#endif
