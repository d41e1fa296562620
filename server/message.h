/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_MESSAGE_H
#define ISCHIA_SERVER_MESSAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "solver/error.h"

/* The JSON lines between ischiad and a worker (see frame.h), written and read in one place. */

enum {
    MESSAGE_TEXT_BYTES = 96, /* of a phrase, a name, a version */
    MESSAGE_JOB_MAX = 1 << 30
};

enum message_kind {
    MESSAGE_HELLO,    /* worker: ready                                                        */
    MESSAGE_PROGRESS, /* worker                                                               */
    MESSAGE_RESULT,   /* worker: a line with the result object and a blob follow              */
    MESSAGE_PROBLEM,  /* worker: a line with the problem object follows                       */
    MESSAGE_RENDERED, /* worker: a blob follows                                               */
    MESSAGE_SOLVE,    /* daemon                                                               */
    MESSAGE_RENDER,   /* daemon: a blob follows                                               */
    MESSAGE_KIND_COUNT
};

/* One message; only the members of its kind are meaningful. */
struct message {
    enum message_kind kind;
    int job; /* 1 ... MESSAGE_JOB_MAX; all but hello                                          */
    /* hello */
    int protocol, model_version;
    char program[MESSAGE_TEXT_BYTES], model[MESSAGE_TEXT_BYTES];
    /* progress */
    double fraction, F_N;
    int load_step, newton_iteration;
    char text[MESSAGE_TEXT_BYTES];
    /* render */
    char as[MESSAGE_TEXT_BYTES], language[MESSAGE_TEXT_BYTES];
    /* solve, render: the case object. Writing: what is sent. Reading: malloc'ed, the caller's. */
    char *case_json;
};

/* One line without line break, the caller's to free. */
ISCHIA_MUST_CHECK enum ischia_code message_write(const struct message *message, char **ret_json,
                                                 size_t *ret_size, struct ischia_error *err);

/* ISCHIA_E_INPUT when it is not one of these messages, whole and in range; *ret is untouched. */
ISCHIA_MUST_CHECK enum ischia_code message_read(const char *json, size_t size, struct message *ret,
                                                struct ischia_error *err);

/* True when the line is one JSON object, without duplicate keys. */
bool message_is_object(const char *json, size_t size);

#endif
