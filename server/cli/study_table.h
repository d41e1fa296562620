/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_STUDY_TABLE_H
#define ISCHIA_SERVER_CLI_STUDY_TABLE_H

#include <stdbool.h>
#include <stddef.h>

#include "solver/error.h"

/* A whole CSV file with a header line, in memory. */
struct study_table {
    int columns;
    size_t rows;
    char **cell; /* [rows + 1][columns]; line 0 is the header; short lines end in "" */
};

/* path: "-" is standard input. ISCHIA_E_INPUT: cannot be opened, not CSV, no header, a line with
 * more fields than the header. */
ISCHIA_MUST_CHECK enum ischia_code study_table_read(struct study_table *ret, const char *path,
                                                    struct ischia_error *err);
void study_table_finish(struct study_table *table); /* a zeroed one is allowed */

/* The first column of that name, -1 when there is none. */
int study_table_column(const struct study_table *table, const char *name);
/* The cell as it stands in the file; row 0 is the first below the header. */
const char *study_table_text(const struct study_table *table, size_t row, int column);
/* NaN for a cell that is not one finite number. */
double study_table_number(const struct study_table *table, size_t row, int column);

/* False for a row that says it did not succeed; a table without a status column has only good
 * rows. */
bool study_table_succeeded(const struct study_table *table, size_t row);

#endif
