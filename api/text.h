/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_TEXT_H
#define ISCHIA_API_TEXT_H

#include <stdbool.h>
#include <stddef.h>

#include "solver/error.h"

/*
 * Text without a locale: a buffer that grows, numbers that survive being written and read, and the
 * checks that every reader of untrusted text needs. Nothing here calls setlocale or depends on it.
 */

/*
 * A text that grows. Writers never fail one by one: the first allocation that fails is remembered,
 * later writes do nothing, and text_out_take reports it once. The text is always NUL-terminated.
 */
struct text_out {
    char *text; /* NULL until the first write */
    size_t length;
    size_t capacity;
    bool failed;
};

void text_out_init(struct text_out *ret);
void text_out_finish(struct text_out *out); /* frees the text; NULL and zeroed allowed */
void text_out_clear(struct text_out *out);  /* empties it and keeps its memory          */
void text_put(struct text_out *out, const char *bytes, size_t length);
void text_put_string(struct text_out *out, const char *string);
void text_put_number(struct text_out *out, double value); /* as text_from_number */

/* Hands the text over: *ret_text is the caller's to free and out is empty again. ISCHIA_E_MEMORY
 * when any write failed; then outputs are untouched and out is freed. ret_length may be NULL. */
ISCHIA_MUST_CHECK enum ischia_code text_out_take(struct text_out *out, char **ret_text,
                                                 size_t *ret_length, struct ischia_error *err);

/* The shortest of %.15g, %.16g, %.17g that reads back as the same double; always with a point,
 * never a comma. value is finite (asserted). Returns buffer. */
enum { TEXT_NUMBER_BYTES = 32 };
const char *text_from_number(double value, char buffer[TEXT_NUMBER_BYTES]);
/* Significant digits, 6 to 17, with which value (finite) reads back as itself: 600.0001 is not to
 * be called 600 by who refuses it for being more. */
int text_digits(double value);

/* True, and *ret_value set, when the whole of [bytes, bytes + length) is one number as RFC 8259
 * writes it ("-1.5e3", never "+1", "1.", ".5", "0x1", "1,5", "nan") of at most
 * TEXT_NUMBER_LENGTH_MAX bytes. The value may be infinite ("1e999"): the caller judges that. */
enum { TEXT_NUMBER_LENGTH_MAX = 60 };
bool text_to_number(const char *bytes, size_t length, double *ret_value);

/* A number as people type it into a form. A comma and a point both are the decimal mark; "+7",
 * "007", ".5", "5,", a minus sign U+2212, an exponent, and no-break spaces around it are fine. A
 * text with more than one mark ("1,234.5") reads in two ways and is refused, never guessed.
 * *ret_value is set for TEXT_TYPED_NUMBER only, and may then be infinite. */
enum text_typed { TEXT_TYPED_NUMBER, TEXT_TYPED_AMBIGUOUS, TEXT_TYPED_NO_NUMBER };
enum text_typed text_to_typed_number(const char *text, double *ret_value);

/* Length of the UTF-8 sequence at bytes (1 ... 4), 0 when it is not valid UTF-8: overlong forms,
 * surrogates and values above U+10FFFF are not. length > 0 (asserted). */
size_t text_utf8_sequence(const char *bytes, size_t length);
bool text_is_utf8(const char *bytes, size_t length);
size_t text_character_count(const char *utf8); /* of a valid NUL-terminated text */

/* Copies text into a buffer of size bytes for a message: control characters become '?', and what
 * does not fit is cut between characters and marked with "...". Returns buffer; size >= 4. */
const char *text_printable(const char *utf8, char *buffer, size_t size);

/* "2026-03-01" or "2026-03-01T09:30:00Z" or with an offset and fraction: RFC 3339, real dates. */
bool text_is_date_or_time(const char *text);

/* 1 ... 64 of [A-Za-z0-9._-]. */
bool text_is_pseudonym(const char *text);

/* Restricted Damerau-Levenshtein distance in bytes, letters compared without case. Texts longer
 * than TEXT_DISTANCE_LENGTH_MAX are TEXT_DISTANCE_LENGTH_MAX apart from everything. */
enum { TEXT_DISTANCE_LENGTH_MAX = 32 };
int text_distance(const char *a, const char *b);

/* How many slips make `typed` of `word`: one is allowed in up to three letters, two in more, and
 * hyphens in front are no letters. TEXT_NO_SLIP: it is another word. */
enum { TEXT_NO_SLIP = TEXT_DISTANCE_LENGTH_MAX };
int text_slips(const char *typed, const char *word);

#endif
