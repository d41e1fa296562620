/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/csv.h"

#include <errno.h>
#include <math.h>
#include <string.h>

/* ---- reading ---- */

void csv_reader_init(struct csv_reader *ret, FILE *in)
{
    ret->in = in;
    ret->line = 1;
    ret->consumed = 0;
    ret->start = ret->end = 0;
    ret->at_end = false;
}

/* Makes room and reads on until the buffer is full or the file ends. */
static enum ischia_code fill(struct csv_reader *r, struct ischia_error *err)
{
    memmove(r->buffer, r->buffer + r->start, r->end - r->start);
    r->end -= r->start;
    r->start = 0;
    r->end += fread(r->buffer + r->end, 1, CSV_ROW_BYTES_MAX - r->end, r->in);
    r->at_end = r->end < CSV_ROW_BYTES_MAX;
    CHECK(!ferror(r->in), err, ISCHIA_E_IO, "cannot read the CSV file: %s", strerror(errno));
    return ISCHIA_OK;
}

static void consume(struct csv_reader *r, size_t length)
{
    const char *bytes = r->buffer + r->start;
    for (size_t i = 0; i < length; i++) r->line += bytes[i] == '\n';
    r->start += length;
    r->consumed += (long long)length;
}

/* Only the first line of what could not be understood is given up. */
static enum ischia_code give_up_line(struct csv_reader *r, struct ischia_error *err)
{
    for (;;) {
        const char *bytes = r->buffer + r->start;
        const char *newline = memchr(bytes, '\n', r->end - r->start);
        if (newline != NULL) {
            consume(r, (size_t)(newline - bytes) + 1);
            return ISCHIA_OK;
        }
        consume(r, r->end - r->start);
        if (r->at_end) return ISCHIA_OK;
        TRY(fill(r, err));
    }
}

/* What a first look at a row finds, before anything is changed. */
struct row_shape {
    size_t length; /* with its line end; 0: the bytes end before the row does */
    int columns;
    bool open;      /* a quote is open where the bytes end    */
    bool misplaced; /* a quote stands where none may          */
};

enum place { FIELD_START, IN_PLAIN, IN_QUOTES, AFTER_QUOTE, AFTER_RETURN };

/* Where a byte other than a line end leads; -1: it may not stand here. */
static int next_place(enum place place, char c)
{
    switch (place) {
    case FIELD_START:
        return c == '"' ? IN_QUOTES : c == ',' ? FIELD_START : IN_PLAIN;
    case IN_PLAIN:
        return c == '"' ? -1 : c == ',' ? FIELD_START : IN_PLAIN;
    case IN_QUOTES:
        return c == '"' ? AFTER_QUOTE : IN_QUOTES;
    case AFTER_QUOTE:
        return c == '"' ? IN_QUOTES : c == ',' ? FIELD_START : c == '\r' ? AFTER_RETURN : -1;
    case AFTER_RETURN:
        break;
    }
    return -1;
}

static struct row_shape look(const char *bytes, size_t length)
{
    struct row_shape shape = {.columns = 1};
    enum place place = FIELD_START;
    for (size_t i = 0; i < length; i++) {
        if (bytes[i] == '\n' && place != IN_QUOTES) {
            shape.length = i + 1;
            return shape;
        }
        const int next = next_place(place, bytes[i]);
        if (next < 0) {
            shape.misplaced = true;
            return shape;
        }
        shape.columns += bytes[i] == ',' && next == FIELD_START;
        place = (enum place)next;
    }
    shape.open = place == IN_QUOTES;
    return shape;
}

static size_t without_line_end(const char *bytes, size_t length)
{
    if (length > 0 && bytes[length - 1] == '\n') length--;
    if (length > 0 && bytes[length - 1] == '\r') length--;
    return length;
}

/* Removes the quotes of the field that starts at `text`, in place; returns where it ended. */
static char *unquote(char *text)
{
    char *to = text, *from = text + 1;
    while (*from != '"' || from[1] == '"') {
        if (*from == '"') from++;
        *to++ = *from++;
    }
    *to = '\0';
    return from + 1;
}

/* Cuts a row that has been looked at, without its line end, into fields in place. */
static void cut(struct csv_row *row, char *text)
{
    for (char *field = text, *end; field != NULL; field = end) {
        row->field[row->count++] = field;
        end = *field == '"' ? unquote(field) : field + strcspn(field, ",");
        const bool more = *end == ',';
        *end = '\0';
        end = more ? end + 1 : NULL;
    }
}

static enum ischia_code check_shape(const struct csv_reader *r, const struct row_shape *shape,
                                    struct ischia_error *err)
{
    CHECK(!shape->misplaced, err, ISCHIA_E_INPUT, "line %ld: a double quote is out of place",
          r->line);
    CHECK(shape->length > 0 || r->at_end, err, ISCHIA_E_LIMIT,
          "line %ld: the row is longer than %d bytes%s", r->line, CSV_ROW_BYTES_MAX,
          shape->open ? " (a double quote is not closed)" : "");
    CHECK(!shape->open, err, ISCHIA_E_INPUT, "line %ld: a double quote is not closed", r->line);
    CHECK(shape->columns <= CSV_COLUMNS_MAX, err, ISCHIA_E_LIMIT, "line %ld: more than %d columns",
          r->line, CSV_COLUMNS_MAX);
    return ISCHIA_OK;
}

static enum ischia_code check_bytes(const struct csv_reader *r, const char *bytes, size_t length,
                                    struct ischia_error *err)
{
    CHECK(memchr(bytes, '\0', length) == NULL, err, ISCHIA_E_INPUT,
          "line %ld: a NUL byte, as in UTF-16; save the file as UTF-8", r->line);
    CHECK(text_is_utf8(bytes, length), err, ISCHIA_E_INPUT,
          "line %ld: not valid UTF-8; save the file as UTF-8", r->line);
    return ISCHIA_OK;
}

/* Finds the next row in the buffer, reading on as needed: *ret_length 0 at the end of the file. */
static enum ischia_code find_row(struct csv_reader *r, size_t *ret_length, struct ischia_error *err)
{
    struct row_shape shape = look(r->buffer + r->start, r->end - r->start);
    if (shape.length == 0 && !shape.misplaced && !r->at_end) {
        TRY(fill(r, err));
        shape = look(r->buffer + r->start, r->end - r->start);
    }
    TRY(check_shape(r, &shape, err));
    *ret_length = shape.length > 0 ? shape.length : r->end - r->start;
    return check_bytes(r, r->buffer + r->start, *ret_length, err);
}

static enum ischia_code skip_byte_order_mark(struct csv_reader *r, struct ischia_error *err)
{
    TRY(fill(r, err));
    if (r->end >= 3 && memcmp(r->buffer, "\xEF\xBB\xBF", 3) == 0) consume(r, 3);
    return ISCHIA_OK;
}

/* Passes on why a row was refused, once its first line is behind us. */
static enum ischia_code refuse(struct csv_reader *r, enum ischia_code code,
                               struct ischia_error *err)
{
    if (code != ISCHIA_E_IO) TRY(give_up_line(r, err));
    return code;
}

enum ischia_code csv_read(struct csv_reader *reader, struct csv_row *row, bool *ret_end,
                          struct ischia_error *err)
{
    char *bytes;
    size_t length, plain;
    row->count = 0;
    if (reader->consumed == 0 && reader->end == 0) TRY(skip_byte_order_mark(reader, err));
    do {
        row->line = reader->line;
        const enum ischia_code code = find_row(reader, &length, err);
        if (code != ISCHIA_OK) return refuse(reader, code, err);
        bytes = reader->buffer + reader->start;
        plain = without_line_end(bytes, length);
        consume(reader, length);
    } while (length > 0 && plain == 0); /* blank lines */
    *ret_end = length == 0;
    if (length == 0) return ISCHIA_OK;
    bytes[plain] = '\0';
    cut(row, bytes);
    return ISCHIA_OK;
}

/* ---- writing ---- */

static void put_separator(struct text_out *out, bool first)
{
    if (!first) text_put(out, ",", 1);
}

static void put_field(struct text_out *out, const char *before, const char *utf8)
{
    const bool plain = strpbrk(utf8, ",\"\r\n") == NULL;
    if (!plain) text_put(out, "\"", 1);
    text_put_string(out, before);
    if (plain) {
        text_put_string(out, utf8);
        return;
    }
    for (const char *quote; (quote = strchr(utf8, '"')) != NULL; utf8 = quote + 1) {
        text_put(out, utf8, (size_t)(quote - utf8) + 1);
        text_put(out, "\"", 1);
    }
    text_put_string(out, utf8);
    text_put(out, "\"", 1);
}

void csv_put_text(struct text_out *out, const char *utf8, bool first)
{
    put_separator(out, first);
    put_field(out, "", utf8);
}

void csv_put_typed(struct text_out *out, const char *utf8, bool first)
{
    const bool is_formula = utf8[0] != '\0' && strchr("=+-@\t\r", utf8[0]) != NULL;
    put_separator(out, first);
    put_field(out, is_formula ? "'" : "", utf8);
}

void csv_put_number(struct text_out *out, double value, bool first)
{
    put_separator(out, first);
    if (isfinite(value)) text_put_number(out, value);
}

void csv_put_integer(struct text_out *out, long long value, bool first)
{
    char digits[24];
    (void)snprintf(digits, sizeof digits, "%lld", value);
    csv_put_text(out, digits, first);
}

void csv_end_row(struct text_out *out) { text_put(out, "\n", 1); }
