/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_PROBLEM_DOC_H
#define ISCHIA_API_PROBLEM_DOC_H

#include <stddef.h>

#include "api/faults.h"
#include "api/json.h"
#include "solver/result.h"

/* RFC 9457 problem documents: every error of every route, and why an assessment failed. */
#define PROBLEM_MEDIA_TYPE "application/problem+json"

/* Every kind of problem there is; docs and OpenAPI list this table. */
enum problem_kind {
    PROBLEM_NOT_JSON,          /* 400 the body is not JSON (or not a form) at all        */
    PROBLEM_BAD_REQUEST,       /* 400 a query parameter or header is wrong               */
    PROBLEM_UNAUTHORIZED,      /* 401                                                    */
    PROBLEM_FORBIDDEN,         /* 403                                                    */
    PROBLEM_NOT_FOUND,         /* 404                                                    */
    PROBLEM_METHOD,            /* 405                                                    */
    PROBLEM_NOT_ACCEPTABLE,    /* 406                                                    */
    PROBLEM_TIMEOUT,           /* 408 the request did not arrive in time                 */
    PROBLEM_CONFLICT,          /* 409 not in the present state                           */
    PROBLEM_PRECONDITION,      /* 412 what the answer would be made of is missing        */
    PROBLEM_TOO_LARGE,         /* 413                                                    */
    PROBLEM_MEDIA_TYPE_WRONG,  /* 415                                                    */
    PROBLEM_INVALID,           /* 422 the document says something wrong: see errors      */
    PROBLEM_IDEMPOTENCY,       /* 422 the key was used with another body                 */
    PROBLEM_QUEUE_FULL,        /* 429                                                    */
    PROBLEM_RATE,              /* 429 this client asks too often                         */
    PROBLEM_HEADERS_TOO_LARGE, /* 431                                                    */
    PROBLEM_INTERNAL,          /* 500                                                    */
    PROBLEM_UNAVAILABLE,       /* 503 shutting down, or the store cannot be written      */
    PROBLEM_STORAGE,           /* 507 no room left                                       */
    /* Why an assessment failed: */
    PROBLEM_NOT_CONVERGED, /* 422 the solver found no equilibrium, and says how far it came */
    PROBLEM_OUT_OF_MEMORY, /* 503                                                    */
    PROBLEM_TIME_LIMIT,    /* 504                                                    */
    PROBLEM_WORKER_DIED,   /* 500                                                    */
    PROBLEM_KIND_COUNT
};

struct problem_info {
    const char *type; /* URI reference: the anchor that explains it in the daemon's docs page */
    enum word title;
    int status;
};
extern const struct problem_info problem_kinds[PROBLEM_KIND_COUNT];

struct problem {
    enum problem_kind kind;
    char detail[ISCHIA_ERROR_MESSAGE_BYTES]; /* this occurrence, in words; "" none            */
    char instance[160];                      /* URI reference of this occurrence; "" none     */
    char reason[24];                         /* ischia_reason_name of a solve that ended; ""  */
    double last_converged_fraction;          /* of F, 0 ... 1; NaN: does not apply            */
    struct doc_faults faults;                /* "errors", only written when there are some    */
    enum language language;                  /* of the title                                  */
};

/* A problem with a detail in English (printf-style) and nothing else. */
__attribute__((format(printf, 3, 4))) void problem_init(struct problem *ret, enum problem_kind kind,
                                                        const char *format, ...);

/* A problem with title and detail in the words of a language. */
void problem_say(struct problem *ret, enum problem_kind kind, enum language language,
                 enum word word, const struct word_value *values);

/* The problem of a call that failed: by err->code, with its message (see problem_kind_of). */
void problem_from_error(struct problem *ret, const struct ischia_error *err);
enum problem_kind problem_kind_of(enum ischia_code code);

/* The problem of a solve that ended without converging: reason, what was tried, fraction of F. */
void problem_from_result(struct problem *ret, const struct ischia_case *c,
                         const struct ischia_result *result);

/* The problem of a document with faults (copied), in their language. */
void problem_from_faults(struct problem *ret, const struct doc_faults *faults);

/* Writes the members of the problem object that is open in out. */
void problem_doc_write(struct json_out *out, const struct problem *problem);
/* The whole object on one line, the caller's to free. */
ISCHIA_MUST_CHECK enum ischia_code problem_doc_text(char **ret_text, const struct problem *problem,
                                                    struct ischia_error *err);
/* Reads what problem_doc_write wrote; errors as json_parse, and ISCHIA_E_INPUT for a document that
 * is not one of ours. *ret is untouched on error. */
ISCHIA_MUST_CHECK enum ischia_code problem_doc_read(struct problem *ret, const char *json,
                                                    size_t length, struct ischia_error *err);

#endif
