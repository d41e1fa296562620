/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/uuid.h"

#include <errno.h>
#include <string.h>
#include <sys/random.h>

enum { RANDOM_FROM = 6 }; /* the first six bytes are the time */

enum ischia_code uuid_make(int64_t unix_ms, struct uuid *ret, struct ischia_error *err)
{
    struct uuid id;
    for (int i = 0; i < RANDOM_FROM; i++)
        id.byte[i] = (unsigned char)((uint64_t)unix_ms >> (8 * (RANDOM_FROM - 1 - i)));
    /* Fewer than 257 bytes come whole or not at all, and only a signal before the kernel's pool is
     * ready can interrupt it. */
    ssize_t got;
    do got = getrandom(id.byte + RANDOM_FROM, UUID_BYTES - RANDOM_FROM, 0);
    while (got < 0 && errno == EINTR);
    CHECK(got == UUID_BYTES - RANDOM_FROM, err, ISCHIA_E_IO, "no randomness for an id: %s",
          strerror(errno));
    id.byte[6] = (unsigned char)(0x70 | (id.byte[6] & 0x0f)); /* version 7 */
    id.byte[8] = (unsigned char)(0x80 | (id.byte[8] & 0x3f)); /* variant 10 */
    *ret = id;
    return ISCHIA_OK;
}

static bool has_dash_before(int byte) { return byte == 4 || byte == 6 || byte == 8 || byte == 10; }

void uuid_format(const struct uuid *id, char ret_text[UUID_TEXT_BYTES])
{
    static const char digits[] = "0123456789abcdef";
    char *out = ret_text;
    for (int i = 0; i < UUID_BYTES; i++) {
        if (has_dash_before(i)) *out++ = '-';
        *out++ = digits[id->byte[i] >> 4];
        *out++ = digits[id->byte[i] & 0x0f];
    }
    *out = '\0';
}

static int hex_value(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

bool uuid_parse(const char *text, struct uuid *ret)
{
    if (strnlen(text, UUID_TEXT_BYTES) != UUID_TEXT_BYTES - 1) return false;
    struct uuid id;
    for (int i = 0; i < UUID_BYTES; i++) {
        if (has_dash_before(i) && *text++ != '-') return false;
        const int high = hex_value(text[0]), low = hex_value(text[1]);
        if (high < 0 || low < 0) return false;
        id.byte[i] = (unsigned char)(high << 4 | low);
        text += 2;
    }
    *ret = id;
    return true;
}

bool uuid_equal(const struct uuid *a, const struct uuid *b)
{
    return memcmp(a->byte, b->byte, UUID_BYTES) == 0;
}
