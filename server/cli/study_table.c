/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/study_table.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/csv.h"
#include "api/text.h"
#include "server/cli/files.h"

void study_table_finish(struct study_table *table)
{
    const size_t cells = table->cell != NULL ? (table->rows + 1) * (size_t)table->columns : 0;
    for (size_t i = 0; i < cells; i++) free(table->cell[i]);
    free(table->cell);
    *table = (struct study_table){0};
}

/* Adds a line; the first one sets the number of columns. `lines` counts the header too. */
static enum ischia_code add_line(struct study_table *t, size_t lines, const struct csv_row *row,
                                 struct ischia_error *err)
{
    if (lines == 0) t->columns = row->count;
    CHECK(row->count <= t->columns, err, ISCHIA_E_INPUT,
          "line %ld has %d fields, the header has %d", row->line, row->count, t->columns);
    const size_t columns = (size_t)t->columns;
    char **larger = reallocarray(t->cell, (lines + 1) * columns, sizeof *larger);
    CHECK(larger != NULL, err, ISCHIA_E_MEMORY, "out of memory for line %ld", row->line);
    t->cell = larger;
    memset(&larger[lines * columns], 0, columns * sizeof *larger);
    t->rows = lines;
    for (int c = 0; c < t->columns; c++) {
        larger[lines * columns + (size_t)c] = strdup(c < row->count ? row->field[c] : "");
        CHECK(larger[lines * columns + (size_t)c] != NULL, err, ISCHIA_E_MEMORY,
              "out of memory for line %ld", row->line);
    }
    return ISCHIA_OK;
}

static enum ischia_code read_lines(struct study_table *t, FILE *in, struct ischia_error *err)
{
    static struct csv_reader reader; /* 64 KiB; one file is read at a time */
    struct csv_row row;
    enum ischia_code code = ISCHIA_OK;
    size_t lines = 0;
    bool end = false;
    csv_reader_init(&reader, in);
    while (code == ISCHIA_OK) {
        code = csv_read(&reader, &row, &end, err);
        if (code != ISCHIA_OK || end) break;
        code = add_line(t, lines++, &row, err);
    }
    TRY(code);
    CHECK(lines > 0, err, ISCHIA_E_INPUT, "there is no header line");
    return ISCHIA_OK;
}

enum ischia_code study_table_read(struct study_table *ret, const char *path,
                                  struct ischia_error *err)
{
    struct study_table table = {0};
    struct ischia_error cause;
    FILE *in = NULL;
    TRY(file_open(path, &in, err));
    const enum ischia_code code = read_lines(&table, in, &cause);
    file_close(in);
    if (code == ISCHIA_OK) {
        *ret = table;
        return ISCHIA_OK;
    }
    study_table_finish(&table);
    return FAIL(err, code, "%s: %.400s", file_name(path), cause.message);
}

int study_table_column(const struct study_table *table, const char *name)
{
    for (int c = 0; c < table->columns; c++)
        if (strcmp(table->cell[c], name) == 0) return c;
    return -1;
}

const char *study_table_text(const struct study_table *table, size_t row, int column)
{
    return table->cell[(row + 1) * (size_t)table->columns + (size_t)column];
}

double study_table_number(const struct study_table *table, size_t row, int column)
{
    const char *text = study_table_text(table, row, column);
    double value;
    if (!text_to_number(text, strlen(text), &value) || !isfinite(value)) return (double)NAN;
    return value;
}

bool study_table_succeeded(const struct study_table *table, size_t row)
{
    const int status = study_table_column(table, "status");
    return status < 0 || strcmp(study_table_text(table, row, status), "succeeded") == 0;
}
