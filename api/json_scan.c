/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The grammar of RFC 8259, one function a production. cJSON skips this work: it takes "01", "+1",
 * "[1,]x", raw control characters and invalid UTF-8 as they come, so nothing reaches it unchecked.
 */
#include "api/json_scan.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "api/text.h"

struct scan {
    const char *text;
    size_t length;
    size_t at;
    int depth;
    struct json_scan_seen seen;
    size_t key, key_length; /* the last key of an object, with its quotes; length 0: none  */
    const char *expected;   /* what the scan wanted to see at `at`, once it has failed     */
};

static bool wanted(struct scan *s, const char *expected)
{
    s->expected = expected;
    return false;
}

/* The byte at the current place, -1 at the end. */
static int peek(const struct scan *s)
{
    return s->at < s->length ? (unsigned char)s->text[s->at] : -1;
}

static bool take(struct scan *s, char c)
{
    if (peek(s) != c) return false;
    s->at++;
    return true;
}

static void skip_space(struct scan *s)
{
    for (int c = peek(s); c == ' ' || c == '\t' || c == '\r' || c == '\n'; c = peek(s)) s->at++;
}

static bool hex_digit(int c, unsigned *value)
{
    const int lower = c >= 'A' && c <= 'F' ? c - 'A' + 'a' : c;
    if (lower >= '0' && lower <= '9')
        *value = 16 * *value + (unsigned)(lower - '0');
    else if (lower >= 'a' && lower <= 'f')
        *value = 16 * *value + (unsigned)(lower - 'a' + 10);
    else
        return false;
    return true;
}

static bool four_hex_digits(struct scan *s, unsigned *ret)
{
    unsigned value = 0;
    for (int i = 0; i < 4; i++, s->at++)
        if (!hex_digit(peek(s), &value)) return wanted(s, "four hexadecimal digits");
    *ret = value;
    return true;
}

/* The last key, cut between characters, for a message; "" when there is none. */
static const char *last_key(const struct scan *s, char *buffer, size_t size)
{
    char key[128]; /* longer than what is shown, so that the cut is text_printable's */
    const size_t length = s->key_length < sizeof key ? s->key_length : sizeof key - 1;
    memcpy(key, s->text + s->key, length);
    key[length] = '\0';
    return text_printable(key, buffer, size);
}

static void note_nul(struct scan *s)
{
    if (!s->seen.nul) (void)last_key(s, s->seen.key, sizeof s->seen.key);
    s->seen.nul = true;
}

/* Behind "\u": a character, or a pair of surrogates that makes one. */
static bool unicode_escape(struct scan *s)
{
    static const char pair[] = "a surrogate pair (\\uD800-\\uDBFF followed by \\uDC00-\\uDFFF)";
    unsigned unit;
    if (!four_hex_digits(s, &unit)) return false;
    if (unit == 0) note_nul(s);
    if (unit < 0xD800 || unit > 0xDFFF) return true;
    if (unit >= 0xDC00 || !take(s, '\\') || !take(s, 'u')) return wanted(s, pair);
    if (!four_hex_digits(s, &unit)) return false;
    return (unit >= 0xDC00 && unit <= 0xDFFF) || wanted(s, pair);
}

static bool escape(struct scan *s)
{
    const int c = peek(s);
    if (c < 0 || strchr("\"\\/bfnrtu", c) == NULL || c == 0)
        return wanted(s, "one of \" \\ / b f n r t u after a backslash");
    s->at++;
    return c != 'u' || unicode_escape(s);
}

static bool string(struct scan *s)
{
    if (!take(s, '"')) return wanted(s, "a string in double quotes");
    while (!take(s, '"')) {
        const int c = peek(s);
        if (c < 0) return wanted(s, "the closing quote of a string");
        if (c < 0x20) return wanted(s, "a string without raw control characters");
        if (take(s, '\\')) {
            if (!escape(s)) return false;
            continue;
        }
        const size_t step = text_utf8_sequence(s->text + s->at, s->length - s->at);
        if (step == 0) return wanted(s, "valid UTF-8");
        s->at += step;
    }
    return true;
}

static bool number(struct scan *s)
{
    double ignored;
    size_t end = s->at;
    while (end < s->length && s->text[end] != '\0' &&
           strchr("+-.0123456789eE", s->text[end]) != NULL)
        end++;
    if (end - s->at > TEXT_NUMBER_LENGTH_MAX) return wanted(s, "a number of at most 60 characters");
    if (!text_to_number(s->text + s->at, end - s->at, &ignored))
        return wanted(s, "a number such as -1.5e3 (NaN and Infinity are not JSON)");
    s->at = end;
    return true;
}

static bool word(struct scan *s, const char *name)
{
    const size_t length = strlen(name);
    if (s->length - s->at < length || memcmp(s->text + s->at, name, length) != 0)
        return wanted(s, "a value (NaN and Infinity are not JSON)");
    s->at += length;
    return true;
}

static bool value(struct scan *s);

static bool member(struct scan *s)
{
    skip_space(s);
    const size_t key = s->at;
    if (!string(s)) return false;
    s->key = key;
    s->key_length = s->at - key;
    skip_space(s);
    return take(s, ':') ? value(s) : wanted(s, "a colon");
}

/* An array or an object: items between `open` and `close`, commas between them. */
static bool container(struct scan *s, char close, bool (*item)(struct scan *s))
{
    s->at++;
    if (++s->depth > JSON_SCAN_DEPTH_MAX) return wanted(s, "less nesting");
    if (s->depth > s->seen.depth) s->seen.depth = s->depth;
    skip_space(s);
    if (!take(s, close)) {
        do {
            if (!item(s)) return false;
        } while (take(s, ','));
        if (!take(s, close)) return wanted(s, close == ']' ? "a comma or ]" : "a comma or }");
    }
    s->depth--;
    return true;
}

static bool bare_value(struct scan *s)
{
    switch (peek(s)) {
    case '{':
        return container(s, '}', member);
    case '[':
        return container(s, ']', value);
    case '"':
        return string(s);
    case 't':
        return word(s, "true");
    case 'f':
        return word(s, "false");
    case 'n':
        return word(s, "null");
    default:
        if (peek(s) == '-' || (peek(s) >= '0' && peek(s) <= '9')) return number(s);
        return wanted(s, "a value (NaN and Infinity are not JSON)");
    }
}

/* A value with the white space on both sides. */
static bool value(struct scan *s)
{
    skip_space(s);
    if (!bare_value(s)) return false;
    skip_space(s);
    return true;
}

static enum ischia_code report(const struct scan *s, struct ischia_error *err)
{
    char key[41];
    size_t line = 1, column = 1;
    char found[8] = "the end";
    for (size_t i = 0; i < s->at; i++, column++)
        if (s->text[i] == '\n') {
            line++;
            column = 0;
        }
    const int c = peek(s);
    if (c >= 0)
        (void)snprintf(found, sizeof found, c > 0x20 && c < 0x7F ? "'%c'" : "0x%02X", (unsigned)c);
    return FAIL(err, ISCHIA_E_INPUT, "not JSON: line %zu, column %zu%s%s: expected %s, found %s",
                line, column, s->key_length > 0 ? ", at or after " : "",
                last_key(s, key, sizeof key), s->expected, found);
}

enum ischia_code json_scan(const char *text, size_t length, int depth_max,
                           struct json_scan_seen *ret, struct ischia_error *err)
{
    struct scan s = {.text = text, .length = length};
    skip_space(&s);
    CHECK(s.at < length, err, ISCHIA_E_INPUT, "not JSON: the document is empty");
    CHECK(length < 3 || memcmp(text, "\xEF\xBB\xBF", 3) != 0, err, ISCHIA_E_INPUT,
          "not JSON: the document starts with a byte order mark; save it as plain UTF-8");
    if (value(&s)) {
        *ret = s.seen;
        if (s.at == length) return ISCHIA_OK;
        s.expected = "nothing more after the value";
    }
    if (s.depth > JSON_SCAN_DEPTH_MAX)
        return FAIL(err, ISCHIA_E_INPUT, "not accepted: nested more than %d deep", depth_max);
    return report(&s, err);
}
