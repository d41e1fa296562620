/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Any bytes as CSV: no crash; every byte is consumed; each row read is the same when it has been
 * written and read again; lines go up.
 */
#include "tests/fuzz/fuzz.h"

#include <string.h>

#include "api/csv.h"

static struct csv_reader reader, again;

static void read_back(const struct csv_row *row)
{
    struct csv_row back;
    struct text_out out;
    bool end;
    text_out_init(&out);
    text_put_string(&out, "x\n"); /* so that a byte order mark in the row stays in it */
    for (int i = 0; i < row->count; i++) csv_put_text(&out, row->field[i], i == 0);
    csv_end_row(&out);
    MUST(!out.failed);
    FILE *file = fmemopen(out.text, out.length, "r");
    MUST(file != NULL);
    csv_reader_init(&again, file);
    /* A row of one empty field is a blank line, and quoting may make a row too long. */
    const bool blank = row->count == 1 && row->field[0][0] == '\0';
    if (!blank && out.length < CSV_ROW_BYTES_MAX) {
        MUST(csv_read(&again, &back, &end, NULL) == ISCHIA_OK && !end);
        MUST(csv_read(&again, &back, &end, NULL) == ISCHIA_OK && !end);
        MUST(back.count == row->count);
        for (int i = 0; i < row->count; i++) MUST(strcmp(back.field[i], row->field[i]) == 0);
    }
    (void)fclose(file);
    text_out_finish(&out);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t copy[1 << 20];
    struct csv_row row;
    bool end = size == 0 || size > sizeof copy;
    long line = 0;
    if (end) return 0;
    memcpy(copy, data, size);
    FILE *file = fmemopen(copy, size, "r");
    MUST(file != NULL);
    csv_reader_init(&reader, file);
    while (!end) {
        const enum ischia_code code = csv_read(&reader, &row, &end, NULL);
        MUST(code == ISCHIA_OK || code == ISCHIA_E_INPUT || code == ISCHIA_E_LIMIT);
        MUST(row.line > line || end);
        line = row.line;
        if (code == ISCHIA_OK && !end) read_back(&row);
        if (code != ISCHIA_OK) end = false;
    }
    MUST(reader.consumed == (long long)size);
    (void)fclose(file);
    return 0;
}
