/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/gzip.h"

#include <limits.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <zlib.h>

enum { SMALLEST_BYTES = 1200, LEVEL = 5, WINDOW_BITS = 15, GZIP_FORMAT = 16, MEMORY_LEVEL = 8 };

bool gzip_accepted(const char *accept_encoding)
{
    const char *at = accept_encoding;
    while (*at != '\0') {
        at += strspn(at, " \t,");
        const size_t length = strcspn(at, ",");
        const size_t name = strcspn(at, " \t;,");
        const bool matches =
            (name == 4 && strncasecmp(at, "gzip", 4) == 0) || (name == 1 && at[0] == '*');
        const char *q = memmem(at, length, "q=", 2);
        if (matches) return q == NULL || strtod(q + 2, NULL) > 0;
        at += length;
    }
    return false;
}

bool gzip_helps(size_t size) { return size >= SMALLEST_BYTES && size <= UINT_MAX / 2; }

enum ischia_code gzip_pack(const char *bytes, size_t size, char **ret, size_t *ret_size)
{
    z_stream stream;
    memset(&stream, 0, sizeof stream);
    if (deflateInit2(&stream, LEVEL, Z_DEFLATED, WINDOW_BITS + GZIP_FORMAT, MEMORY_LEVEL,
                     Z_DEFAULT_STRATEGY) != Z_OK)
        return ISCHIA_E_MEMORY;
    const size_t bound = deflateBound(&stream, size);
    char *packed = malloc(bound);
    if (packed != NULL) {
        stream.next_in = (Bytef *)(uintptr_t)bytes;
        stream.avail_in = (uInt)size;
        stream.next_out = (Bytef *)packed;
        stream.avail_out = (uInt)bound;
        if (deflate(&stream, Z_FINISH) != Z_STREAM_END) {
            free(packed);
            packed = NULL;
        }
    }
    const size_t packed_size = stream.total_out;
    (void)deflateEnd(&stream);
    if (packed == NULL) return ISCHIA_E_MEMORY;
    *ret = packed;
    *ret_size = packed_size;
    return ISCHIA_OK;
}

void gzip_mark_etag(char *etag, size_t size)
{
    static const char mark[] = "-gzip\"";
    const size_t length = strlen(etag);
    if (length < 2 || length + sizeof mark > size) return;
    memcpy(etag + length - 1, mark, sizeof mark);
}
