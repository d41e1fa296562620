/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_DIGEST_H
#define ISCHIA_SERVER_DIGEST_H

#include <stddef.h>

/* SHA-256 over parts, each preceded by its length, so that no two lists of parts collide. */

enum { DIGEST_BYTES = 32, DIGEST_HEX_BYTES = 65 /* with the final NUL */ };

struct digest_part {
    const void *bytes; /* may be NULL when size is 0 */
    size_t size;
};

/* A part that is a NUL-terminated string; NULL counts as empty. */
struct digest_part digest_text(const char *text);

/* Digest of the parts in their order. */
void digest_parts(const struct digest_part *parts, size_t count,
                  unsigned char ret_digest[DIGEST_BYTES]);

/* SHA-256 of the bytes alone, as sha256sum prints it. */
void digest_plain(const void *bytes, size_t size, unsigned char ret_digest[DIGEST_BYTES]);

/* Lower-case hexadecimal. */
void digest_hex(const unsigned char digest[DIGEST_BYTES], char ret_hex[DIGEST_HEX_BYTES]);

#endif
