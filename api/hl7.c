/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The encoding: segments, fields, components, escapes, character sets. */
#include "api/hl7.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- cutting ---- */

static bool is_end(char c) { return c == '\r' || c == '\n'; }

/* Segments of text[0..length), empty lines left out. False when there are too many. */
static bool cut(struct hl7 *m, size_t length)
{
    for (size_t at = 0; at < length;) {
        size_t end = at;
        while (end < length && !is_end(m->text[end])) end++;
        if (end > at) {
            if (m->count == HL7_SEGMENTS_MAX) return false;
            m->segment[m->count].at = at;
            m->segment[m->count].length = end - at;
            m->count++;
        }
        at = end + 1;
    }
    return true;
}

/* Five different visible characters that are no letters or digits. */
static bool read_delimiters(struct hl7 *m, const char *bytes, size_t length)
{
    static const char head[] = "MSH";
    char d[5];
    if (length < 9 || memcmp(bytes, head, 3) != 0) return false;
    memcpy(d, bytes + 3, sizeof d);
    for (int i = 0; i < 5; i++) {
        if (!isgraph((unsigned char)d[i]) || isalnum((unsigned char)d[i])) return false;
        for (int k = 0; k < i; k++)
            if (d[k] == d[i]) return false;
    }
    m->field = d[0];
    m->component = d[1];
    m->repetition = d[2];
    m->escape = d[3];
    m->subcomponent = d[4];
    return bytes[8] == m->field || is_end(bytes[8]);
}

/* ---- character sets ---- */

enum charset { CHARSET_UTF8, CHARSET_ASCII, CHARSET_LATIN1, CHARSET_COUNT };

static bool find_charset(const char *name, enum charset *ret)
{
    static const struct {
        const char *name;
        enum charset charset;
    } names[] = {
        {"", CHARSET_ASCII},        {"ASCII", CHARSET_ASCII},      {"ISO IR6", CHARSET_ASCII},
        {"UNICODE", CHARSET_UTF8},  {"UTF-8", CHARSET_UTF8},       {"UNICODE UTF-8", CHARSET_UTF8},
        {"8859/1", CHARSET_LATIN1}, {"ISO IR100", CHARSET_LATIN1},
    };
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strcmp(names[i].name, name) == 0) {
            *ret = names[i].charset;
            return true;
        }
    return false;
}

/* MSH-18 in the bytes as they came. */
static void charset_name(const struct hl7 *m, const char *bytes, size_t length, char *ret,
                         size_t size)
{
    int field = 1;
    size_t at = 3, used = 0;
    while (at < length && !is_end(bytes[at]) && field < 18)
        if (bytes[at++] == m->field) field++;
    for (; field == 18 && at < length && !is_end(bytes[at]) && bytes[at] != m->field &&
           bytes[at] != m->repetition && used + 1 < size;
         at++)
        ret[used++] = bytes[at];
    ret[used] = '\0';
}

/* Makes m->text of the bytes. NULL on failure: *ret_why says why, NULL for memory. */
static bool decode(struct hl7 *m, const char *bytes, size_t *length, const char **ret_why)
{
    char name[32];
    enum charset charset;
    size_t used = 0;
    charset_name(m, bytes, *length, name, sizeof name);
    *ret_why = "the character set of MSH-18 is not ASCII, UNICODE UTF-8 or 8859/1";
    if (!find_charset(name, &charset)) return false;
    *ret_why = NULL;
    m->text = malloc(2 * *length + 1);
    if (m->text == NULL) return false;
    *ret_why = "the message has bytes that its character set (MSH-18) does not have";
    for (size_t i = 0; i < *length; i++) {
        const unsigned char c = (unsigned char)bytes[i];
        if (c == 0 || (c < 0x20 && !is_end(bytes[i]) && c != '\t')) return false;
        if (c >= 0x80 && charset == CHARSET_ASCII) return false;
        if (c >= 0x80 && charset == CHARSET_LATIN1) {
            m->text[used++] = (char)(0xC0 | c >> 6);
            m->text[used++] = (char)(0x80 | (c & 0x3F));
        } else {
            m->text[used++] = bytes[i];
        }
    }
    m->text[used] = '\0';
    *length = used;
    return text_is_utf8(m->text, used);
}

enum ischia_code hl7_parse(struct hl7 **ret, const char *bytes, size_t length,
                           struct ischia_error *err)
{
    const char *why = "the message does not begin with MSH and its five delimiters";
    CHECK(length <= HL7_MESSAGE_BYTES_MAX, err, ISCHIA_E_LIMIT, "the message is larger than %d KiB",
          HL7_MESSAGE_BYTES_MAX / 1024);
    struct hl7 *m = calloc(1, sizeof *m);
    CHECK(m != NULL, err, ISCHIA_E_MEMORY, "no memory for a message");
    bool good = read_delimiters(m, bytes, length) && decode(m, bytes, &length, &why);
    if (good && !cut(m, length)) {
        good = false;
        why = "the message has too many segments";
    }
    if (!good) hl7_destroy(m);
    CHECK(good || why != NULL, err, ISCHIA_E_MEMORY, "no memory for a message");
    CHECK(good, err, ISCHIA_E_INPUT, "%s", why);
    *ret = m;
    return ISCHIA_OK;
}

void hl7_destroy(struct hl7 *message)
{
    if (message == NULL) return;
    free(message->text);
    free(message);
}

/* ---- fields ---- */

bool hl7_is(const struct hl7 *m, int segment, const char *name)
{
    const size_t length = m->segment[segment].length;
    const char *text = m->text + m->segment[segment].at;
    return length >= 3 && memcmp(text, name, 3) == 0 && (length == 3 || text[3] == m->field);
}

struct slice {
    const char *text;
    size_t length;
};

/* Part `index` (from 0) of a slice cut at a delimiter; empty behind the last. */
static struct slice part(struct slice whole, char delimiter, int index)
{
    const char *end = whole.text + whole.length, *at = whole.text;
    for (; index > 0; index--) {
        const char *next = memchr(at, delimiter, (size_t)(end - at));
        if (next == NULL) return (struct slice){end, 0};
        at = next + 1;
    }
    const char *stop = memchr(at, delimiter, (size_t)(end - at));
    return (struct slice){at, (size_t)((stop == NULL ? end : stop) - at)};
}

/* A field with all its repetitions. MSH-1 is the delimiter itself, so MSH counts one less. */
static struct slice field_of(const struct hl7 *m, int segment, int field)
{
    const struct slice whole = {m->text + m->segment[segment].at, m->segment[segment].length};
    return part(whole, m->field, hl7_is(m, segment, "MSH") ? field - 1 : field);
}

bool hl7_repeats(const struct hl7 *m, int segment, int field)
{
    const struct slice f = field_of(m, segment, field);
    return memchr(f.text, m->repetition, f.length) != NULL;
}

static int hex_value(char c)
{
    const char *const digits = "0123456789ABCDEF";
    const char *at = c == '\0' ? NULL : strchr(digits, toupper((unsigned char)c));
    return at == NULL ? -1 : (int)(at - digits);
}

/* What stands between two escape characters, as text; false when it stands for something else. */
static bool unescape(const struct hl7 *m, struct slice name, char *ret, size_t size, size_t *used)
{
    const char plain[] = {'F',           m->field, 'S',       m->component, 'R',
                          m->repetition, 'E',      m->escape, 'T',          m->subcomponent};
    if (name.length == 1) {
        for (size_t i = 0; i < sizeof plain; i += 2) {
            if (name.text[0] != plain[i] || *used + 1 >= size) continue;
            ret[(*used)++] = plain[i + 1];
            return true;
        }
        return false;
    }
    if (name.length < 3 || name.text[0] != 'X' || name.length % 2 == 0) return false;
    for (size_t i = 1; i < name.length; i += 2) {
        const int high = hex_value(name.text[i]), low = hex_value(name.text[i + 1]);
        const int value = high * 16 + low;
        if (high < 0 || low < 0 || value < 0x20 || *used + 1 >= size) return false;
        ret[(*used)++] = (char)value;
    }
    return true;
}

bool hl7_get(const struct hl7 *m, int segment, int field, int component, char *ret, size_t size)
{
    const struct slice c =
        part(part(field_of(m, segment, field), m->repetition, 0), m->component, component - 1);
    size_t used = 0;
    bool good = true;
    for (size_t i = 0; good && i < c.length; i++) {
        const char *close = c.text[i] != m->escape || i + 1 == c.length
                                ? NULL
                                : memchr(c.text + i + 1, m->escape, c.length - i - 1);
        if (c.text[i] != m->escape) {
            good = used + 1 < size;
            if (good) ret[used++] = c.text[i];
            continue;
        }
        const struct slice name = {c.text + i + 1,
                                   close == NULL ? 0 : (size_t)(close - c.text) - i - 1};
        good = close != NULL && unescape(m, name, ret, size, &used);
        i += name.length + 1;
    }
    good = good && text_is_utf8(ret, used);
    ret[good ? used : 0] = '\0';
    return good;
}

bool hl7_raw(const struct hl7 *m, int segment, int field, char *ret, size_t size)
{
    const char theirs[] = {m->component, m->escape, m->subcomponent}, ours[] = {'^', '\\', '&'};
    /* hl7_get would undo escapes; only MSH-2 holds delimiters that are none, and nobody asks. */
    const struct slice f = part(field_of(m, segment, field), m->repetition, 0);
    ret[0] = '\0';
    if (f.length >= size) return false;
    for (size_t i = 0; i < f.length; i++) {
        const char *at = memchr(theirs, f.text[i], sizeof theirs);
        if (at == NULL && strchr("|^~\\&", f.text[i]) != NULL) {
            ret[0] = '\0'; /* plain text for them, a delimiter for us */
            return false;
        }
        ret[i] = at == NULL ? f.text[i] : ours[at - theirs];
    }
    ret[f.length] = '\0';
    return true;
}

void hl7_put_text(struct text_out *out, const char *utf8)
{
    static const struct {
        char c;
        const char *escape;
    } escapes[] = {{'|', "\\F\\"}, {'^', "\\S\\"},    {'~', "\\R\\"},   {'\\', "\\E\\"},
                   {'&', "\\T\\"}, {'\r', "\\.br\\"}, {'\n', "\\.br\\"}};
    for (; *utf8 != '\0'; utf8++) {
        const char *escape = NULL;
        for (size_t i = 0; i < sizeof escapes / sizeof escapes[0]; i++)
            if (escapes[i].c == *utf8) escape = escapes[i].escape;
        if (escape != NULL)
            text_put_string(out, escape);
        else
            text_put(out, utf8, 1);
    }
}
