/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_JSON_SCAN_H
#define ISCHIA_API_JSON_SCAN_H

#include <stdbool.h>
#include <stddef.h>

#include "solver/error.h"

/* What is JSON, and is more than a reader takes all the same. */
struct json_scan_seen {
    int depth;    /* how deep arrays and objects are nested                             */
    bool nul;     /* a string holds \u0000                                             */
    char key[41]; /* then: the last key before its end, for a message; "" none          */
};

enum { JSON_SCAN_DEPTH_MAX = 64 }; /* bounds the recursion of who walks the tree */

/*
 * Checks that the bytes are exactly one JSON value (RFC 8259) and white space, without allocating.
 * ISCHIA_E_INPUT with line, column (in bytes, from 1) and what was expected when they are not, or
 * when arrays and objects are nested more than JSON_SCAN_DEPTH_MAX deep (the message then names
 * depth_max, what the reader takes). What passes can be given to cJSON: no number is longer than
 * cJSON's buffer. A string that holds \u0000 ends there for cJSON: the reader refuses it.
 */
ISCHIA_MUST_CHECK enum ischia_code json_scan(const char *text, size_t length, int depth_max,
                                             struct json_scan_seen *ret, struct ischia_error *err);

#endif
