/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/json.h"

void json_out_init(struct json_out *ret, int indent)
{
    *ret = (struct json_out){.indent = indent};
    text_out_init(&ret->text);
}

void json_out_finish(struct json_out *out)
{
    text_out_finish(&out->text);
    *out = (struct json_out){.indent = out->indent};
}

static void put_line_break(struct json_out *out)
{
    static const char spaces[] = "                                                                ";
    if (out->indent == 0) return;
    const size_t wanted = (size_t)out->indent * (size_t)out->depth, most = sizeof spaces - 1;
    text_put(&out->text, "\n", 1);
    text_put(&out->text, spaces, wanted < most ? wanted : most);
}

/* Two-character escapes where JSON has them; other control characters as \u00XX. */
static void put_escaped_byte(struct text_out *text, unsigned char c)
{
    static const char *const escapes[128] = {
        ['"'] = "\\\"", ['\\'] = "\\\\", ['\b'] = "\\b", ['\f'] = "\\f",
        ['\n'] = "\\n", ['\r'] = "\\r",  ['\t'] = "\\t", [0x7F] = "\\u007f",
    };
    char unicode[8];
    if (escapes[c] != NULL) {
        text_put_string(text, escapes[c]);
        return;
    }
    (void)snprintf(unicode, sizeof unicode, "\\u%04x", c);
    text_put_string(text, unicode);
}

static bool needs_escape(unsigned char c) { return c < 0x20 || c == '"' || c == '\\' || c == 0x7F; }

static void put_quoted(struct text_out *text, const char *utf8)
{
    const char *plain = utf8; /* start of the run that needs no escape */
    text_put(text, "\"", 1);
    for (; *utf8 != '\0'; utf8++) {
        if (!needs_escape((unsigned char)*utf8)) continue;
        text_put(text, plain, (size_t)(utf8 - plain));
        put_escaped_byte(text, (unsigned char)*utf8);
        plain = utf8 + 1;
    }
    text_put(text, plain, (size_t)(utf8 - plain));
    text_put(text, "\"", 1);
}

/* What stands before every value: comma, line break, key. */
static void begin_value(struct json_out *out, const char *key)
{
    if (out->has_member) text_put(&out->text, ",", 1);
    if (out->depth > 0) put_line_break(out);
    if (key != NULL) {
        put_quoted(&out->text, key);
        text_put_string(&out->text, out->indent == 0 ? ":" : ": ");
    }
    out->has_member = true;
}

static void put_bare(struct json_out *out, const char *key, const char *value)
{
    begin_value(out, key);
    text_put_string(&out->text, value);
}

static void open_container(struct json_out *out, const char *key, const char *bracket)
{
    put_bare(out, key, bracket);
    out->depth++;
    out->has_member = false;
}

static void close_container(struct json_out *out, const char *bracket)
{
    assert(out->depth > 0);
    out->depth--;
    if (out->has_member) put_line_break(out);
    text_put_string(&out->text, bracket);
    out->has_member = true;
}

void json_open_object(struct json_out *out, const char *key) { open_container(out, key, "{"); }
void json_close_object(struct json_out *out) { close_container(out, "}"); }
void json_open_array(struct json_out *out, const char *key) { open_container(out, key, "["); }
void json_close_array(struct json_out *out) { close_container(out, "]"); }

void json_put_null(struct json_out *out, const char *key) { put_bare(out, key, "null"); }

void json_put_bool(struct json_out *out, const char *key, bool value)
{
    put_bare(out, key, value ? "true" : "false");
}

void json_put_number(struct json_out *out, const char *key, double value)
{
    if (!isfinite(value)) {
        out->not_finite = true;
        return;
    }
    begin_value(out, key);
    text_put_number(&out->text, value);
}

void json_put_number_or_null(struct json_out *out, const char *key, double value)
{
    if (isnan(value))
        json_put_null(out, key);
    else
        json_put_number(out, key, value);
}

void json_put_integer(struct json_out *out, const char *key, long long value)
{
    char digits[24];
    (void)snprintf(digits, sizeof digits, "%lld", value);
    put_bare(out, key, digits);
}

void json_put_string(struct json_out *out, const char *key, const char *utf8)
{
    if (utf8 == NULL) {
        json_put_null(out, key);
        return;
    }
    begin_value(out, key);
    put_quoted(&out->text, utf8);
}

void json_put_raw(struct json_out *out, const char *key, const char *json)
{
    put_bare(out, key, json);
}

enum ischia_code json_out_take(struct json_out *out, char **ret_text, size_t *ret_length,
                               struct ischia_error *err)
{
    assert(out->depth == 0);
    const bool not_finite = out->not_finite;
    out->has_member = out->not_finite = false;
    if (not_finite) {
        text_out_finish(&out->text);
        return FAIL(err, ISCHIA_E_NUMERIC, "a number that is not finite cannot be written as JSON");
    }
    return text_out_take(&out->text, ret_text, ret_length, err);
}
