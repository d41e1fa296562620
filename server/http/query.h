/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_QUERY_H
#define ISCHIA_SERVER_QUERY_H

#include <stdbool.h>
#include <stddef.h>

/* What clients write into addresses and headers, read without trust. Pure functions of text. */

/* Undoes percent-encoding of text[0..length) into a string. False when an escape is broken, the
 * result holds a control character or is not UTF-8, or does not fit. plus: '+' means a blank. */
bool query_decode(const char *text, size_t length, bool plus, char *ret, size_t size);

/* Splits a target in absolute form, "http://name:port/path?query", as proxies send it. Returns what
 * stands behind the authority, and the authority itself: ret of *ret_length bytes. NULL when the
 * target has another form. */
const char *query_absolute(const char *target, const char **ret, size_t *ret_length);

enum query_answer { QUERY_ABSENT, QUERY_FOUND, QUERY_BAD };

/* The value of a query string's parameter. BAD: it is there twice, or cannot be decoded or does
 * not fit. ret is "" unless FOUND. */
enum query_answer query_find(const char *query, const char *key, char *ret, size_t size);

/* The next parameter from *at (a query string) on, decoded; *at moves behind it. ABSENT at the end;
 * BAD: it cannot be decoded, or does not fit. */
enum query_answer query_next(const char **at, char *ret_key, size_t key_size, char *ret_value,
                             size_t value_size);

/* Writes the first parameter that `known` (NULL-ended) does not list and returns true; false when
 * there is none. It is written as it stands, but as text_printable writes it: always UTF-8. */
bool query_unknown(const char *query, const char *const *known, char *ret, size_t size);

/* A whole decimal number; false when it is anything else or out of [min, max]. */
bool query_whole_number(const char *text, long long min, long long max, long long *ret);

/* Seconds of "wait=N" in a Prefer header (RFC 7240); -1 when there is none. Never above max. */
int query_prefer_wait(const char *prefer, int max);

/* Which of `types` (NULL-ended) an Accept header likes best, the first of equals; NULL header: the
 * first. -1: none. */
int query_accept(const char *accept, const char *const *types);

/* Which of `tags` (NULL-ended) an Accept-Language header likes best, by the language alone: "de-CH"
 * is "de". The first when it likes none, or is NULL. */
int query_language(const char *accept_language, const char *const *tags);

/* "application/json; charset=utf-8" is "application/json". */
bool query_media_type_is(const char *content_type, const char *type);

/* Weak comparison of If-None-Match with a tag; "-gzip" before the closing quote is overlooked. */
bool query_etag_matches(const char *if_none_match, const char *etag);

/* The host of a Host header, without port and brackets, lower case. False when it is malformed. */
bool query_host(const char *header, char *ret, size_t size);

/* True when a list separated by commas holds the word (letters compared without case). */
bool query_list_has(const char *list, const char *word);

/* The last address in X-Forwarded-For. False when there is none that fits. */
bool query_forwarded_for(const char *header, char *ret, size_t size);

#endif
