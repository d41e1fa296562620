/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/reply.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/fhir.h"
#include "server/http/gzip.h"
#include "server/http/query.h"
#include "server/log.h"

/* The path alone: a query may hold a subject. A client may send any byte in it; what is no part of
 * a URI is written as an escape, so that the document is UTF-8 whatever was asked for. */
static void set_instance(struct problem *problem, const struct http_request *request)
{
    enum { ESCAPE_BYTES = 3 };
    char *to = problem->instance;
    const char *end = problem->instance + sizeof problem->instance - ESCAPE_BYTES;
    if (request == NULL || problem->instance[0] != '\0') return;
    for (const char *c = request->target; *c != '\0' && *c != '?' && to < end; c++)
        if (*c > ' ' && *c < 0x7F)
            *to++ = *c;
        else
            to += snprintf(to, ESCAPE_BYTES + 1, "%%%02X", (unsigned char)*c);
    *to = '\0';
}

/* Each protocol has its own form of an error. */
static const struct error_form {
    const char *prefix, *type, *no_memory;
    enum ischia_code (*text)(char **, const struct problem *, struct ischia_error *);
} error_forms[] = {
    {"/fhir", FHIR_MEDIA_TYPE,
     "{\"resourceType\":\"OperationOutcome\",\"issue\":[{\"severity\":\"error\","
     "\"code\":\"transient\",\"details\":{\"text\":\"Out of memory\"}}]}",
     fhir_outcome_text},
    {"/", PROBLEM_MEDIA_TYPE,
     "{\"type\":\"/docs#problem-out-of-memory\",\"title\":\"Out of memory\",\"status\":503}",
     problem_doc_text},
};

static const struct error_form *error_form(const struct http_request *request)
{
    const struct error_form *form = error_forms;
    const size_t length = strlen(form->prefix);
    if (request == NULL || strncmp(request->target, form->prefix, length) != 0 ||
        strchr("/?", request->target[length]) == NULL)
        form++;
    return form;
}

enum language reply_language(const struct http_request *request)
{
    return request == NULL ? LANGUAGE_EN : (enum language)request->language;
}

void reply_put_language(const struct http_request *request, struct http_response *ret)
{
    for (int i = 0; i < ret->header_count; i++)
        if (strcmp(ret->header[i].name, "Content-Language") == 0) return; /* a page that failed */
    http_header_static(ret, "Content-Language", language_tags[reply_language(request)]);
    http_header_static(ret, "Vary", "Accept-Language");
}

const char *reply_state(enum language language, enum queue_state state)
{
    static const enum word words[QUEUE_STATE_COUNT] = {
        [QUEUE_QUEUED] = WORD_DAEMON_STATE_QUEUED,
        [QUEUE_RUNNING] = WORD_DAEMON_STATE_RUNNING,
        [QUEUE_SUCCEEDED] = WORD_DAEMON_STATE_SUCCEEDED,
        [QUEUE_FAILED] = WORD_DAEMON_STATE_FAILED,
        [QUEUE_CANCELLED] = WORD_DAEMON_STATE_CANCELLED,
    };
    return words_get(language, words[state]);
}

void reply_problem(const struct http_request *request, struct problem *problem,
                   struct http_response *ret)
{
    const struct error_form *form = error_form(request);
    struct ischia_error err;
    char *text = NULL;
    ret->status = problem_kinds[problem->kind].status;
    ret->action = HTTP_SEND;
    ret->etag[0] = '\0';
    set_instance(problem, request);
    problem->language = reply_language(request);
    http_header_static(ret, "Cache-Control", "no-store");
    reply_put_language(request, ret);
    if (form->text(&text, problem, &err) == ISCHIA_OK) {
        http_body(ret, form->type, text, strlen(text));
        return;
    }
    ret->status = 503;
    http_body_static(ret, form->type, form->no_memory, strlen(form->no_memory));
}

void reply_refusal(const struct http_request *request, struct http_response *ret,
                   enum problem_kind kind, enum word word, const struct word_value *values)
{
    struct problem problem;
    problem_say(&problem, kind, reply_language(request), word, values);
    reply_problem(request, &problem, ret);
}

void reply_refusal_english(const struct http_request *request, struct http_response *ret,
                           enum problem_kind kind, const char *format, ...)
{
    struct problem problem;
    char detail[sizeof problem.detail];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(detail, sizeof detail, format, arguments);
    va_end(arguments);
    problem_init(&problem, kind, "%s", detail);
    reply_problem(request, &problem, ret);
}

static enum problem_kind failure_kind(enum ischia_code code)
{
    if (code == ISCHIA_E_MEMORY || code == ISCHIA_E_STATE || code == ISCHIA_E_IO)
        return PROBLEM_UNAVAILABLE;
    return PROBLEM_INTERNAL;
}

void reply_failure(const struct http_request *request, struct http_response *ret,
                   const struct ischia_error *err)
{
    struct log_value message;
    LOG_ERROR("request failed", "code=%s detail=%s where=%s:%d", ischia_code_name(err->code),
              log_quote(&message, err->message), err->file == NULL ? "?" : err->file, err->line);
    http_header_static(ret, "Retry-After", "5");
    reply_refusal(request, ret, failure_kind(err->code), WORD_DAEMON_REFUSAL_FAILURE, NULL);
}

void reply_no_assessment(const struct call *call, struct http_response *ret)
{
    reply_refusal(call->request, ret, PROBLEM_NOT_FOUND, WORD_DAEMON_REFUSAL_NO_ASSESSMENT, NULL);
}

void reply_no_study(const struct call *call, struct http_response *ret)
{
    reply_refusal(call->request, ret, PROBLEM_NOT_FOUND, WORD_DAEMON_REFUSAL_NO_STUDY, NULL);
}

void reply_text(const struct http_request *request, struct http_response *ret, int status,
                const char *type, struct text_out *out)
{
    struct ischia_error err;
    char *text = NULL;
    size_t length = 0;
    if (text_out_take(out, &text, &length, &err) != ISCHIA_OK) {
        reply_failure(request, ret, &err);
        return;
    }
    ret->status = status;
    http_body(ret, type, text, length);
}

/* The packed form of a body has a tag of its own: the 304 names the one that the client has. Where
 * it has both, the one that it would be sent. */
static void name_known_form(const struct http_request *request, const char *known, char *etag)
{
    char packed[HTTP_ETAG_BYTES];
    const char *encodings = http_request_header(request, "Accept-Encoding");
    const bool accepted = encodings != NULL && gzip_accepted(encodings);
    memcpy(packed, etag, sizeof packed);
    gzip_mark_etag(packed, sizeof packed);
    if (strstr(known, packed) != NULL && (accepted || strstr(known, etag) == NULL))
        memcpy(etag, packed, sizeof packed);
}

bool reply_not_modified(const struct http_request *request, struct http_response *ret)
{
    const char *known = http_request_header(request, "If-None-Match");
    if (known == NULL || !query_etag_matches(known, ret->etag)) return false;
    ret->status = 304;
    ret->compressible = true; /* as the body would be: it says so in Vary */
    name_known_form(request, known, ret->etag);
    return true;
}
