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
 * Reading streams and never allocates: a row lives in the reader until the next one is read.
 */
enum { CSV_COLUMNS_MAX = 512, CSV_ROW_BYTES_MAX = 65536 };

struct csv_row {
    long line;                          /* where the row starts in the file, 1 ... */
    int count;                          /* of fields                                */
    const char *field[CSV_COLUMNS_MAX]; /* unquoted, valid UTF-8; borrowed from the reader */
};

struct csv_reader {
    FILE *in;           /* borrowed                                              */
    long line;          /* of the next row                                       */
    long long consumed; /* bytes of the file behind us: for progress             */
    size_t start;       /* of what is not consumed yet, in buffer                */
    size_t end;
    bool at_end; /* the file has no more than is in buffer                */
    char buffer[CSV_ROW_BYTES_MAX + 1];
};

/* The stream stays the caller's; nothing is read yet. */
void csv_reader_init(struct csv_reader *ret, FILE *in);

/*
 * Reads the next row; blank lines are skipped. *ret_end is true, and the row has no fields, when
 * there is none left. ISCHIA_E_INPUT: a quote out of place or not closed, invalid UTF-8, a NUL;
 * ISCHIA_E_LIMIT: too long or too many columns. For both row->line says where, and the reader
 * stands at the next line, so that reading may go on: a stray quote costs one line, not the rest of
 * the file. ISCHIA_E_IO ends it.
 */
ISCHIA_MUST_CHECK enum ischia_code csv_read(struct csv_reader *reader, struct csv_row *row,
                                            bool *ret_end, struct ischia_error *err);

/* Writing: the fields of a row one after the other, then the end of the line (LF). A field is
 * quoted when it must be. `first` leaves out the comma before it. */
void csv_put_text(struct text_out *out, const char *utf8, bool first);
/* A text that somebody typed: one that a spreadsheet would run as a formula has an apostrophe
 * before it (OWASP, CSV injection). */
void csv_put_typed(struct text_out *out, const char *utf8, bool first);
void csv_put_number(struct text_out *out, double value,
                    bool first); /* not finite: an empty field */
void csv_put_integer(struct text_out *out, long long value, bool first);
void csv_end_row(struct text_out *out);

#endif
