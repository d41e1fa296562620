/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/text.h"

#include <assert.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- a text that grows ---- */

void text_out_init(struct text_out *ret) { *ret = (struct text_out){0}; }

void text_out_finish(struct text_out *out)
{
    if (out == NULL) return;
    free(out->text);
    *out = (struct text_out){0};
}

void text_out_clear(struct text_out *out)
{
    out->length = 0;
    out->failed = false;
    if (out->text != NULL) out->text[0] = '\0';
}

static bool reserve(struct text_out *out, size_t more)
{
    if (out->failed) return false;
    if (more < out->capacity - out->length) return true; /* one byte is kept for the NUL */
    size_t capacity = out->capacity == 0 ? 256 : out->capacity;
    while (capacity - out->length <= more && capacity <= SIZE_MAX / 2) capacity *= 2;
    char *text = capacity - out->length <= more ? NULL : realloc(out->text, capacity);
    if (text == NULL) {
        out->failed = true;
        return false;
    }
    out->text = text;
    out->capacity = capacity;
    return true;
}

void text_put(struct text_out *out, const char *bytes, size_t length)
{
    if (!reserve(out, length)) return;
    if (length > 0) memcpy(out->text + out->length, bytes, length);
    out->length += length;
    out->text[out->length] = '\0';
}

void text_put_string(struct text_out *out, const char *string)
{
    text_put(out, string, strlen(string));
}

void text_put_number(struct text_out *out, double value)
{
    char buffer[TEXT_NUMBER_BYTES];
    text_put_string(out, text_from_number(value, buffer));
}

enum ischia_code text_out_take(struct text_out *out, char **ret_text, size_t *ret_length,
                               struct ischia_error *err)
{
    text_put(out, "", 0); /* even an empty text is a text */
    if (out->failed) {
        text_out_finish(out);
        return FAIL(err, ISCHIA_E_MEMORY, "out of memory while writing a document");
    }
    *ret_text = out->text;
    if (ret_length != NULL) *ret_length = out->length;
    *out = (struct text_out){0};
    return ISCHIA_OK;
}

/* ---- numbers ---- */

/* Into buffer, with as few digits as read back as the same; returns how many. */
static int print_shortest(double value, int digits, char buffer[TEXT_NUMBER_BYTES])
{
    for (;; digits++) {
        (void)snprintf(buffer, TEXT_NUMBER_BYTES, "%.*g", digits, value);
        if (digits == 17 || strtod(buffer, NULL) == value) return digits;
    }
}

const char *text_from_number(double value, char buffer[TEXT_NUMBER_BYTES])
{
    assert(buffer != NULL && isfinite(value));
    (void)print_shortest(value, 15, buffer);
    return buffer;
}

int text_digits(double value)
{
    char buffer[TEXT_NUMBER_BYTES];
    return print_shortest(value, 6, buffer);
}

static size_t skip_digits(const char *bytes, size_t length, size_t at)
{
    while (at < length && bytes[at] >= '0' && bytes[at] <= '9') at++;
    return at;
}

/* Bytes of the RFC 8259 number at the start, 0 when there is none. */
static size_t number_length(const char *bytes, size_t length)
{
    size_t at = length > 0 && bytes[0] == '-' ? 1 : 0;
    const size_t integer = at;
    at = skip_digits(bytes, length, at);
    if (at == integer || (bytes[integer] == '0' && at > integer + 1)) return 0;
    if (at < length && bytes[at] == '.') {
        const size_t fraction = at + 1;
        at = skip_digits(bytes, length, fraction);
        if (at == fraction) return 0;
    }
    if (at < length && (bytes[at] == 'e' || bytes[at] == 'E')) {
        at++;
        if (at < length && (bytes[at] == '+' || bytes[at] == '-')) at++;
        const size_t exponent = at;
        at = skip_digits(bytes, length, exponent);
        if (at == exponent) return 0;
    }
    return at;
}

bool text_to_number(const char *bytes, size_t length, double *ret_value)
{
    char copy[TEXT_NUMBER_LENGTH_MAX + 1];
    if (length == 0 || length > TEXT_NUMBER_LENGTH_MAX) return false;
    if (number_length(bytes, length) != length) return false;
    memcpy(copy, bytes, length);
    copy[length] = '\0';
    *ret_value = strtod(copy, NULL);
    return true;
}

/* ---- numbers as people type them ---- */

static const char *const typed_spaces[] = {" ", "\t", "\r", "\n", "\xC2\xA0", "\xE2\x80\xAF"};
enum { TYPED_SPACE_COUNT = sizeof typed_spaces / sizeof typed_spaces[0] };

/* [*text, *text + result) is the text without the spaces around it. */
static size_t without_spaces(const char **text)
{
    size_t length = strlen(*text);
    for (int i = 0; i < TYPED_SPACE_COUNT; i++) {
        const size_t space = strlen(typed_spaces[i]);
        if (length < space) continue;
        const bool before = memcmp(*text, typed_spaces[i], space) == 0;
        if (!before && memcmp(*text + length - space, typed_spaces[i], space) != 0) continue;
        if (before) *text += space;
        length -= space;
        i = -1; /* look for all of them again */
    }
    return length;
}

static bool is_mark(char c) { return c == '.' || c == ','; }

/* Bytes of the digits and marks at the start, none of them needed. */
static size_t skip_digits_and_marks(const char *bytes, size_t length, int *ret_marks)
{
    size_t at = 0;
    for (*ret_marks = 0; at < length; at++) {
        if (!is_mark(bytes[at]) && (bytes[at] < '0' || bytes[at] > '9')) break;
        if (is_mark(bytes[at])) (*ret_marks)++;
    }
    return at;
}

/* A sign, digits with marks among them, an exponent: what strtod() reads once the mark is '.'. */
static enum text_typed typed_kind(const char *bytes, size_t length)
{
    int marks;
    const size_t sign = length > 0 && (bytes[0] == '+' || bytes[0] == '-') ? 1 : 0;
    const size_t digits = skip_digits_and_marks(bytes + sign, length - sign, &marks);
    size_t at = sign + digits;
    if (digits <= (size_t)marks) return TEXT_TYPED_NO_NUMBER;
    if (at < length && (bytes[at] == 'e' || bytes[at] == 'E')) {
        at++;
        if (at < length && (bytes[at] == '+' || bytes[at] == '-')) at++;
        const size_t exponent = at;
        at = skip_digits(bytes, length, exponent);
        if (at == exponent) return TEXT_TYPED_NO_NUMBER;
    }
    if (at != length) return TEXT_TYPED_NO_NUMBER;
    return marks > 1 ? TEXT_TYPED_AMBIGUOUS : TEXT_TYPED_NUMBER;
}

enum text_typed text_to_typed_number(const char *text, double *ret_value)
{
    static const char minus[] = "\xE2\x88\x92"; /* U+2212 */
    char copy[TEXT_NUMBER_LENGTH_MAX + 1];
    size_t length = without_spaces(&text);
    const bool negative = strncmp(text, minus, sizeof minus - 1) == 0;
    if (negative) {
        text += sizeof minus - 2; /* its last byte is where the ASCII sign goes */
        length -= sizeof minus - 2;
    }
    if (length > TEXT_NUMBER_LENGTH_MAX) return TEXT_TYPED_NO_NUMBER;
    memcpy(copy, text, length);
    copy[length] = '\0';
    if (negative) copy[0] = '-';
    const enum text_typed kind = typed_kind(copy, length);
    if (kind != TEXT_TYPED_NUMBER) return kind;
    char *comma = strchr(copy, ',');
    if (comma != NULL) *comma = '.';
    *ret_value = strtod(copy, NULL);
    return kind;
}

/* ---- UTF-8 ---- */

/* What the first byte of a sequence promises, and the least and greatest second byte: this is
 * what excludes overlong forms, surrogates and values above U+10FFFF (Unicode, table 3-7). */
static const struct utf8_form {
    unsigned char first_min, first_max, second_min, second_max, length;
} utf8_forms[] = {
    {0x00, 0x7F, 0, 0, 1},       {0xC2, 0xDF, 0x80, 0xBF, 2}, {0xE0, 0xE0, 0xA0, 0xBF, 3},
    {0xE1, 0xEC, 0x80, 0xBF, 3}, {0xED, 0xED, 0x80, 0x9F, 3}, {0xEE, 0xEF, 0x80, 0xBF, 3},
    {0xF0, 0xF0, 0x90, 0xBF, 4}, {0xF1, 0xF3, 0x80, 0xBF, 4}, {0xF4, 0xF4, 0x80, 0x8F, 4},
};

static bool form_matches(const struct utf8_form *form, const unsigned char *bytes, size_t length)
{
    if (bytes[0] < form->first_min || bytes[0] > form->first_max) return false;
    if (form->length == 1) return true;
    if (length < form->length) return false;
    if (bytes[1] < form->second_min || bytes[1] > form->second_max) return false;
    for (size_t i = 2; i < form->length; i++)
        if ((bytes[i] & 0xC0) != 0x80) return false;
    return true;
}

size_t text_utf8_sequence(const char *bytes, size_t length)
{
    assert(length > 0);
    for (size_t i = 0; i < sizeof utf8_forms / sizeof utf8_forms[0]; i++)
        if (form_matches(&utf8_forms[i], (const unsigned char *)bytes, length))
            return utf8_forms[i].length;
    return 0;
}

bool text_is_utf8(const char *bytes, size_t length)
{
    for (size_t at = 0, step; at < length; at += step) {
        step = text_utf8_sequence(bytes + at, length - at);
        if (step == 0) return false;
    }
    return true;
}

size_t text_character_count(const char *utf8)
{
    size_t count = 0;
    for (; *utf8 != '\0'; utf8++)
        if (((unsigned char)*utf8 & 0xC0) != 0x80) count++;
    return count;
}

/* C0, DEL, and C1 (U+0080 ... U+009F), which some terminals obey as well. */
static bool is_control(const char *bytes, size_t step)
{
    const unsigned char *b = (const unsigned char *)bytes;
    return (step == 1 && (b[0] < 0x20 || b[0] == 0x7F)) ||
           (step == 2 && b[0] == 0xC2 && b[1] < 0xA0);
}

const char *text_printable(const char *utf8, char *buffer, size_t size)
{
    static const char mark[] = "...";
    size_t used = 0, cut = 0; /* cut: the last place where the mark still fits */
    assert(size >= sizeof mark);
    for (size_t at = 0, length = strlen(utf8), step; at < length; at += step) {
        step = text_utf8_sequence(utf8 + at, length - at);
        const bool plain = step > 0 && !is_control(utf8 + at, step);
        const size_t width = plain ? step : 1;
        if (step == 0) step = 1;
        if (used + sizeof mark <= size) cut = used;
        if (used + width >= size) {
            memcpy(buffer + cut, mark, sizeof mark);
            return buffer;
        }
        memcpy(buffer + used, plain ? utf8 + at : "?", width);
        used += width;
    }
    buffer[used] = '\0';
    return buffer;
}

/* ---- forms of text ---- */

/* Reads exactly `digits` digits at *at into a number, and moves *at behind them. */
static bool take_digits(const char **at, int digits, int *ret)
{
    int value = 0;
    for (int i = 0; i < digits; i++, (*at)++) {
        if (**at < '0' || **at > '9') return false;
        value = 10 * value + (**at - '0');
    }
    *ret = value;
    return true;
}

static bool take_character(const char **at, char wanted)
{
    if (**at != wanted) return false;
    (*at)++;
    return true;
}

static int days_in_month(int year, int month)
{
    static const int days[12] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    const bool leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    return month == 2 && leap ? 29 : days[month - 1];
}

static bool take_date(const char **at)
{
    int year, month, day;
    if (!take_digits(at, 4, &year) || !take_character(at, '-') || !take_digits(at, 2, &month) ||
        !take_character(at, '-') || !take_digits(at, 2, &day))
        return false;
    return month >= 1 && month <= 12 && day >= 1 && day <= days_in_month(year, month);
}

static bool take_hour_and_minute(const char **at)
{
    int hour, minute;
    return take_digits(at, 2, &hour) && take_character(at, ':') && take_digits(at, 2, &minute) &&
           hour <= 23 && minute <= 59;
}

static bool take_time(const char **at)
{
    int second;
    if (!take_hour_and_minute(at) || !take_character(at, ':') || !take_digits(at, 2, &second) ||
        second > 60) /* 60: a leap second */
        return false;
    if (!take_character(at, '.')) return true;
    const size_t digits = strspn(*at, "0123456789");
    *at += digits;
    return digits > 0;
}

static bool take_offset(const char **at)
{
    if (take_character(at, 'Z') || take_character(at, 'z')) return true;
    return (take_character(at, '+') || take_character(at, '-')) && take_hour_and_minute(at);
}

bool text_is_date_or_time(const char *text)
{
    const char *at = text;
    if (!take_date(&at)) return false;
    if (*at == '\0') return true;
    if (!take_character(&at, 'T') && !take_character(&at, 't')) return false;
    return take_time(&at) && take_offset(&at) && *at == '\0';
}

static bool is_letter_or_digit(char c)
{
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
}

bool text_is_pseudonym(const char *text)
{
    size_t length = 0;
    for (; text[length] != '\0' && length <= 64; length++)
        if (!is_letter_or_digit(text[length]) && strchr("._-", text[length]) == NULL) return false;
    return length >= 1 && length <= 64;
}

/* ---- distance ---- */

static char lower(char c) { return c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : c; }

static int min3(int a, int b, int c)
{
    const int ab = a < b ? a : b;
    return ab < c ? ab : c;
}

int text_distance(const char *a, const char *b)
{
    const size_t m = strlen(a), n = strlen(b);
    int d[TEXT_DISTANCE_LENGTH_MAX + 1][TEXT_DISTANCE_LENGTH_MAX + 1];
    if (m > TEXT_DISTANCE_LENGTH_MAX || n > TEXT_DISTANCE_LENGTH_MAX)
        return TEXT_DISTANCE_LENGTH_MAX;
    for (size_t i = 0; i <= m; i++) d[i][0] = (int)i;
    for (size_t j = 0; j <= n; j++) d[0][j] = (int)j;
    for (size_t i = 1; i <= m; i++)
        for (size_t j = 1; j <= n; j++) {
            const int cost = lower(a[i - 1]) != lower(b[j - 1]);
            d[i][j] = min3(d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + cost);
            if (i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) &&
                lower(a[i - 2]) == lower(b[j - 1]) && d[i - 2][j - 2] + 1 < d[i][j])
                d[i][j] = d[i - 2][j - 2] + 1;
        }
    return d[m][n];
}

int text_slips(const char *typed, const char *word)
{
    typed += strspn(typed, "-");
    word += strspn(word, "-");
    const int length = (int)strlen(typed), distance = text_distance(typed, word);
    const int most = length <= 3 ? 1 : 2;
    return distance <= most && distance < length ? distance : TEXT_NO_SLIP;
}
