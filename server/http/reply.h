/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_REPLY_H
#define ISCHIA_SERVER_REPLY_H

#include "api/problem_doc.h"
#include "api/text.h"
#include "server/http/http.h"
#include "server/http/service.h"

/* Answers that every route gives. `request` may be NULL where there is none. */

/* What the client reads, as routes.c found out; English when request is NULL. */
enum language reply_language(const struct http_request *request);
/* Says in which language the body is, and that it depends on the request. */
void reply_put_language(const struct http_request *request, struct http_response *ret);

/* A state in words. */
const char *reply_state(enum language language, enum queue_state state);

/* The problem, with its status and the request's path (never its query) as instance. */
void reply_problem(const struct http_request *request, struct problem *problem,
                   struct http_response *ret);
/* A problem with nothing but a detail, in the client's language; values as for words_fill. */
void reply_refusal(const struct http_request *request, struct http_response *ret,
                   enum problem_kind kind, enum word word, const struct word_value *values);
/* The same in English (printf-style): for protocols that only programs speak. */
__attribute__((format(printf, 4, 5))) void
reply_refusal_english(const struct http_request *request, struct http_response *ret,
                      enum problem_kind kind, const char *format, ...);
/* A call that failed for reasons of ours: 500, 503 or 507, logged; the details stay in the log. */
void reply_failure(const struct http_request *request, struct http_response *ret,
                   const struct ischia_error *err);
/* 404: no such assessment, no such study. */
void reply_no_assessment(const struct call *call, struct http_response *ret);
void reply_no_study(const struct call *call, struct http_response *ret);

/* Hands the text over as the body; what failed while it was written is a failure. */
void reply_text(const struct http_request *request, struct http_response *ret, int status,
                const char *type, struct text_out *out);

/* True, with ret made a 304, when the client has this representation already, packed or not; ret's
 * ETag is then that of the form it has. */
bool reply_not_modified(const struct http_request *request, struct http_response *ret);

#endif
