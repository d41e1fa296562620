/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_WEB_H
#define ISCHIA_SERVER_WEB_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

#include "solver/error.h"

/* HTTP as a client: one POST at a time, over http or https, without following redirects. web.c is
 * the only file that sees curl. */

enum { WEB_HEADERS_MAX = 8, WEB_ANSWER_BYTES_MAX = 64 * 1024, WEB_PROBLEM_BYTES = 160 };

struct web_post {
    const char *url;
    const char *header[WEB_HEADERS_MAX]; /* "Name: value"; NULL-ended            */
    const char *body;
    size_t size;
    const char *ca;        /* PEM file; "": the system's authorities             */
    atomic_bool *stopping; /* the transfer ends soon after it has become true    */
};

struct web_answer {
    int status;                      /* 0: there was none                         */
    char *body;                      /* cut after WEB_ANSWER_BYTES_MAX; free()     */
    char problem[WEB_PROBLEM_BYTES]; /* when status is 0: why, in curl's words     */
};

/* Once in the process, before any thread posts. ISCHIA_E_STATE: the library cannot start. */
ISCHIA_MUST_CHECK enum ischia_code web_start(struct ischia_error *err);
void web_finish(void);

/* Posts and waits for the answer, at most 30 s; never fails: ret says what happened. Any thread. */
void web_post(const struct web_post *post, struct web_answer *ret);
void web_answer_finish(struct web_answer *answer);

const char *web_library_version(void); /* of libcurl: "7.88.1" */

#endif
