/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_JSON_H
#define ISCHIA_API_JSON_H

#include <stdbool.h>
#include <stddef.h>

#include "api/faults.h"
#include "api/text.h"
#include "solver/error.h"

/*
 * JSON as RFC 8259 writes it, and nothing else: the strict gate in front of cJSON, which accepts
 * more. Also the writer: numbers with the fewest digits that read back the same.
 */

/* ---- reading ---- */

struct json; /* one value of a parsed document, owned by the document's root */

enum json_type {
    JSON_NULL,
    JSON_BOOL,
    JSON_NUMBER,
    JSON_STRING,
    JSON_ARRAY,
    JSON_OBJECT,
    JSON_TYPE_COUNT
};
extern const char *const json_type_names[JSON_TYPE_COUNT]; /* with an article: "a number" */

struct json_limits {
    size_t bytes_max; /* of the whole document                                  */
    int depth_max;    /* of arrays and objects within each other; at most 64    */
    int members_max;  /* of one object                                          */
};
extern const struct json_limits
    json_limits_request;                            /* 64 KiB, 16, 256: what a client may send    */
extern const struct json_limits json_limits_record; /* 256 KiB, 32, 256: what record systems send */
extern const struct json_limits json_limits_stored; /* 16 MiB, 16, 256: what we wrote ourselves   */

/*
 * Parses exactly one JSON value, white space around it allowed. *ret is the caller's: json_destroy.
 *
 * ISCHIA_E_INPUT: not JSON (bad syntax, NaN, trailing bytes, invalid UTF-8, a raw NUL, a lone
 * surrogate, empty) or nested more than 64 deep; the message gives line and column. ISCHIA_E_LIMIT:
 * more than bytes_max. ISCHIA_E_MEMORY. On error *ret is untouched.
 * ISCHIA_OK with something added to *faults: it is JSON but has duplicate keys ("duplicate"), too
 * many members or levels ("too_many"), "\u0000" in a string, which ends there ("malformed"), or a
 * number beyond the range of a double ("not_finite"); *ret is set all the same so that the reader
 * can find the other faults too.
 */
ISCHIA_MUST_CHECK enum ischia_code json_parse(struct json **ret, const char *text, size_t length,
                                              const struct json_limits *limits,
                                              struct doc_faults *faults, struct ischia_error *err);
void json_destroy(struct json *root); /* NULL allowed */

/* Notes the digits of every number as they stand in the text that root was parsed from, so that
 * json_digits can give them back: 7.10 stays "7.10". ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code json_keep_digits(struct json *root, const char *text,
                                                    size_t length, struct ischia_error *err);
/* Of a JSON_NUMBER after json_keep_digits; else NULL. */
const char *json_digits(const struct json *value);

/* Looking at a value; strings live as long as the document. */
enum json_type json_type_of(const struct json *value);
bool json_bool(const struct json *value);     /* JSON_BOOL (asserted)                 */
double json_number(const struct json *value); /* JSON_NUMBER (asserted); finite unless reported */
const char *json_string(const struct json *value); /* JSON_STRING (asserted): UTF-8         */
const char *json_key(const struct json *member);   /* of a member of an object; else NULL   */
size_t json_count(const struct json *value);       /* of an array's or object's members     */

/* Members in document order: for (m = json_first(v); m != NULL; m = json_next(m)). NULL for an
 * empty one, for values that are neither array nor object, and for NULL. */
const struct json *json_first(const struct json *value);
const struct json *json_next(const struct json *member);
/* The first member with this key, NULL when there is none or object is NULL or not an object. */
const struct json *json_member(const struct json *object, const char *key);

const char *json_library_version(void); /* of cJSON, as it runs: "1.7.15" */

/* ---- writing ---- */

/*
 * Writes one document into a text_out. Inside an object every call has a key; inside an array and
 * at the top the key is NULL. Failures are remembered and reported once, by json_out_take. A number
 * that is not finite is such a failure: use json_put_number_or_null where NaN means "none".
 */
struct json_out {
    struct text_out text;
    int indent;      /* spaces a level; 0: all on one line, without spaces */
    int depth;       /* open arrays and objects                             */
    bool not_finite; /* a number could not be written                      */
    bool has_member; /* the innermost open one already has a member         */
};

void json_out_init(struct json_out *ret, int indent);
void json_out_finish(struct json_out *out); /* frees; zeroed allowed */
void json_open_object(struct json_out *out, const char *key);
void json_close_object(struct json_out *out);
void json_open_array(struct json_out *out, const char *key);
void json_close_array(struct json_out *out);
void json_put_null(struct json_out *out, const char *key);
void json_put_bool(struct json_out *out, const char *key, bool value);
void json_put_number(struct json_out *out, const char *key, double value);
void json_put_number_or_null(struct json_out *out, const char *key, double value); /* NaN: null */
void json_put_integer(struct json_out *out, const char *key, long long value);
void json_put_string(struct json_out *out, const char *key, const char *utf8); /* NULL: null */
/* json: a complete value that json_out or json_parse has already vouched for; copied as it is. */
void json_put_raw(struct json_out *out, const char *key, const char *json);

/* The finished document (every array and object closed, asserted), as text_out_take; out is empty
 * afterwards. ISCHIA_E_NUMERIC when a number was not finite. */
ISCHIA_MUST_CHECK enum ischia_code json_out_take(struct json_out *out, char **ret_text,
                                                 size_t *ret_length, struct ischia_error *err);

#endif
