/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_PAGE_H
#define ISCHIA_SERVER_PAGE_H

#include <stddef.h>

#include "api/faults.h"
#include "api/text.h"
#include "api/words.h"
#include "server/http/assets.h"
#include "server/http/http.h"
#include "server/http/service.h"

/* HTML that needs no JavaScript. Everything that did not come from our own tables is escaped. */

/* Adds markup of ours as it is. */
void page_put(struct text_out *out, const char *html);
/* Adds text with the characters that mean something in HTML escaped. */
void page_escape(struct text_out *out, const char *text);
/* The same, printf-style: markup in the format is escaped too. Cut after 1 KiB. */
__attribute__((format(printf, 2, 3))) void page_format(struct text_out *out, const char *format,
                                                       ...);
/* Adds a word, escaped. */
void page_word(struct text_out *out, enum language language, enum word word);
/* The same with values, as words_fill takes them; cut after 1 KiB. */
void page_fill(struct text_out *out, enum language language, enum word word,
               const struct word_value *values);
/* Starts a document in an empty out. */
void page_begin(struct text_out *out, enum language language, const char *title);
/* The same page in the other languages; address: without a query. Not printed. */
void page_languages(struct text_out *out, enum language language, const char *address);
/* Closes what page_begin opened. */
void page_end(struct text_out *out);

/* The plain form, made from the parameter table. body: what was sent (NULL: nothing) to fill it
 * with; faults: shown beside their fields, and then the status is 422. */
void page_form(struct call *call, const char *body, size_t size, const struct doc_faults *faults,
               struct http_response *ret);

/* An embedded file, with its tag, compressed for those who take it; 404 when asset is NULL. */
void page_asset(struct call *call, const struct asset *asset, struct http_response *ret);

#endif
