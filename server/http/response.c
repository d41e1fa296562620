/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/http/gzip.h"
#include "server/http/http.h"

/* Responses as plain structs: what handlers fill in before http.c sends it. */

void http_response_init(struct http_response *ret, int status)
{
    memset(ret, 0, offsetof(struct http_response, header));
    ret->action = HTTP_SEND;
    ret->status = status;
    ret->bytes = "";
    ret->header_count = 0;
    ret->arena_used = 0;
}

void http_response_finish(struct http_response *response)
{
    if (response->release != NULL) response->release(response->owner);
    response->release = NULL;
    if (response->action == HTTP_STREAM) response->stream.close(response->stream.state);
    response->action = HTTP_SEND;
}

void http_header_static(struct http_response *response, const char *name, const char *value)
{
    if (response->header_count == HTTP_HEADERS_MAX) return;
    response->header[response->header_count].name = name;
    response->header[response->header_count].value = value;
    response->header_count++;
}

void http_header(struct http_response *response, const char *name, const char *format, ...)
{
    char *value = response->arena + response->arena_used;
    const size_t room = sizeof response->arena - response->arena_used;
    va_list arguments;
    va_start(arguments, format);
    const int n = vsnprintf(value, room, format, arguments);
    va_end(arguments);
    if (n < 0 || (size_t)n >= room) return;
    response->arena_used += (size_t)n + 1;
    http_header_static(response, name, value);
}

void http_body(struct http_response *response, const char *type, char *bytes, size_t size)
{
    http_body_static(response, type, bytes, size);
    response->release = free;
    response->owner = bytes;
    response->compressible = true;
}

void http_body_static(struct http_response *response, const char *type, const char *bytes,
                      size_t size)
{
    response->type = type;
    response->bytes = bytes;
    response->size = size;
}

void http_response_pack(struct http_response *response, bool accepted)
{
    char *packed = NULL;
    size_t size = 0;
    if (!response->compressible) return;
    http_header_static(response, "Vary", "Accept-Encoding");
    if (!accepted || response->status == 304) return;
    if (response->packed != NULL) {
        response->bytes = response->packed;
        response->size = response->packed_size;
    } else {
        if (!gzip_helps(response->size)) return;
        if (gzip_pack(response->bytes, response->size, &packed, &size) != ISCHIA_OK) return;
        if (response->release != NULL) response->release(response->owner);
        response->bytes = packed;
        response->size = size;
        response->release = free;
        response->owner = packed;
    }
    http_header_static(response, "Content-Encoding", "gzip");
    gzip_mark_etag(response->etag, sizeof response->etag);
}
