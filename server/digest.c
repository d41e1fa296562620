/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/digest.h"

#include <sodium/crypto_hash_sha256.h>
#include <stdint.h>
#include <string.h>

struct digest_part digest_text(const char *text)
{
    return (struct digest_part){text, text == NULL ? 0 : strlen(text)};
}

void digest_parts(const struct digest_part *parts, size_t count,
                  unsigned char ret_digest[DIGEST_BYTES])
{
    crypto_hash_sha256_state state;
    crypto_hash_sha256_init(&state);
    for (size_t i = 0; i < count; i++) {
        unsigned char length[8];
        for (int b = 0; b < 8; b++) length[b] = (unsigned char)((uint64_t)parts[i].size >> (8 * b));
        crypto_hash_sha256_update(&state, length, sizeof length);
        if (parts[i].size > 0) crypto_hash_sha256_update(&state, parts[i].bytes, parts[i].size);
    }
    crypto_hash_sha256_final(&state, ret_digest);
}

void digest_hex(const unsigned char digest[DIGEST_BYTES], char ret_hex[DIGEST_HEX_BYTES])
{
    static const char digits[] = "0123456789abcdef";
    for (int i = 0; i < DIGEST_BYTES; i++) {
        ret_hex[2 * i] = digits[digest[i] >> 4];
        ret_hex[2 * i + 1] = digits[digest[i] & 0x0f];
    }
    ret_hex[2 * DIGEST_BYTES] = '\0';
}

void digest_plain(const void *bytes, size_t size, unsigned char ret_digest[DIGEST_BYTES])
{
    (void)crypto_hash_sha256(ret_digest, bytes, size);
}
