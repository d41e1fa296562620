/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_CSV_H
#define ISCHIA_API_CSV_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "api/text.h"
#include "solver/error.h"

/*
 * CSV as RFC 4180 writes it: comma, double quotes, CRLF or LF, an optional byte order mark.
 * Reading streams: memory for one row at a time.
 */
enum { CSV_COLUMNS_MAX = 512, CSV_ROW_BYTES_MAX = 65536 };

struct csv_row {
    long line;  /* where the row starts in the file, 1 ... */
    int count;  /* of fields                               */
    char *text; /* the fields, unquoted, each ended by NUL */
    size_t text_length;
    size_t field_offset[CSV_COLUMNS_MAX]; /* into text */
    size_t text_capacity;
};

struct csv_reader {
    FILE *in; /* borrowed */
    long line;
    long long bytes_read;
    bool at_start;
};

void csv_reader_init(struct csv_reader *ret, FILE *in);

void csv_row_init(struct csv_row *ret);
void csv_row_finish(struct csv_row *row);                     /* zeroed allowed */
const char *csv_field(const struct csv_row *row, int column); /* "" beyond the last field */

/*
 * Reads the next row; blank lines are skipped. *ret_end is true, and the row has no fields, when
 * there is none left. ISCHIA_E_INPUT: a quote out of place, invalid UTF-8, a NUL; ISCHIA_E_LIMIT: too
 * long or too many columns; both name the line, set row->line, and leave the reader at the start of
 * the next line, so that reading may go on. ISCHIA_E_IO and ISCHIA_E_MEMORY end it.
 */
ISCHIA_MUST_CHECK enum ischia_code csv_read(struct csv_reader *reader, struct csv_row *row,
                                            bool *ret_end, struct ischia_error *err);

/* Writing: fields of a row one after the other, then the end of the line (LF). A field is quoted
 * when it must be. */
void csv_put_text(struct text_out *out, const char *utf8, bool first);
void csv_put_number(struct text_out *out, double value, bool first); /* NaN: an empty field */
void csv_put_integer(struct text_out *out, long long value, bool first);
void csv_end_row(struct text_out *out);

#endif
