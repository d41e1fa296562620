/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_UUID_H
#define ISCHIA_SERVER_UUID_H

#include <stdbool.h>
#include <stdint.h>

#include "solver/error.h"

/* UUIDs of version 7 (RFC 9562): milliseconds, then random bits. */

enum { UUID_BYTES = 16, UUID_TEXT_BYTES = 37 /* with the final NUL */ };

struct uuid {
    unsigned char byte[UUID_BYTES];
};

/* A new one for the given Unix time. ISCHIA_E_IO when the system gives no randomness. */
ISCHIA_MUST_CHECK enum ischia_code uuid_make(int64_t unix_ms, struct uuid *ret,
                                             struct ischia_error *err);

/* The lower-case 8-4-4-4-12 form. */
void uuid_format(const struct uuid *id, char ret_text[UUID_TEXT_BYTES]);

/* Reads exactly that form, either case, any version; false (and *ret untouched) otherwise. */
bool uuid_parse(const char *text, struct uuid *ret);

/* The same 16 bytes. */
bool uuid_equal(const struct uuid *a, const struct uuid *b);

#endif
