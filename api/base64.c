/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/base64.h"

#include <string.h>

static const char usual[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
static const char for_urls[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

/* Three bytes are four characters; at the end, fewer. */
static void put(struct text_out *out, const void *bytes, size_t size, const char *digits,
                bool padded)
{
    const unsigned char *b = bytes;
    for (size_t i = 0; i < size; i += 3) {
        const size_t left = size - i;
        const unsigned triple = (unsigned)b[i] << 16 | (left > 1 ? (unsigned)b[i + 1] << 8 : 0U) |
                                (left > 2 ? (unsigned)b[i + 2] : 0U);
        char four[4] = {digits[triple >> 18], digits[triple >> 12 & 63], digits[triple >> 6 & 63],
                        digits[triple & 63]};
        const size_t used = left > 2 ? 4 : left + 1;
        memset(four + used, '=', 4 - used);
        text_put(out, four, padded ? 4 : used);
    }
}

void base64_put(struct text_out *out, const void *bytes, size_t size)
{
    put(out, bytes, size, usual, true);
}

void base64url_put(struct text_out *out, const void *bytes, size_t size)
{
    put(out, bytes, size, for_urls, false);
}

bool base64url_decode(const char *text, size_t length, unsigned char *ret, size_t room,
                      size_t *ret_size)
{
    unsigned bits = 0;
    int held = 0;
    size_t used = 0;
    if (length % 4 == 1) return false;
    for (size_t i = 0; i < length; i++) {
        const char *digit = text[i] == '\0' ? NULL : strchr(for_urls, text[i]);
        if (digit == NULL) return false;
        bits = (bits << 6 | (unsigned)(digit - for_urls)) & 0xFFFFFF;
        held += 6;
        if (held < 8) continue;
        held -= 8;
        if (used == room) return false;
        ret[used++] = (unsigned char)(bits >> held);
    }
    *ret_size = used;
    return (bits & ((1U << held) - 1)) == 0; /* left-over bits are zero in the one right spelling */
}
