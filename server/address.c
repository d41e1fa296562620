/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/address.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

enum { PORT_MAX = 65535 };

static bool is_port(const char *text)
{
    const size_t digits = strspn(text, "0123456789");
    return digits > 0 && digits <= 5 && text[digits] == '\0' && strtol(text, NULL, 10) <= PORT_MAX;
}

enum ischia_code address_split(const char *text, struct address_text *ret, struct ischia_error *err)
{
    const char *colon = strrchr(text, ':'), *host = text;
    size_t length = colon == NULL ? 0 : (size_t)(colon - text);
    if (length > 0 && host[0] == '[' && host[length - 1] == ']') {
        host++;
        length -= 2;
    }
    CHECK(length > 0 && length < sizeof ret->host, err, ISCHIA_E_INPUT,
          "'%.80s' is not HOST:PORT, such as 127.0.0.1:8080 or [::1]:8080", text);
    CHECK(is_port(colon + 1), err, ISCHIA_E_INPUT, "the port of '%.80s' is not one of 0 to %d",
          text, PORT_MAX);
    (void)snprintf(ret->host, sizeof ret->host, "%.*s", (int)length, host);
    (void)snprintf(ret->port, sizeof ret->port, "%.5s", colon + 1);
    return ISCHIA_OK;
}

enum ischia_code address_find(const char *text, struct address *ret, struct ischia_error *err)
{
    const struct addrinfo hints = {
        .ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM, .ai_flags = AI_NUMERICSERV};
    TRY(address_split(text, &ret->text, err));
    ret->where = NULL;
    const int cause = getaddrinfo(ret->text.host, ret->text.port, &hints, &ret->where);
    CHECK(cause == 0, err, ISCHIA_E_IO, "%.80s: %s", text, gai_strerror(cause));
    return ISCHIA_OK;
}

void address_finish(struct address *address)
{
    freeaddrinfo(address->where);
    address->where = NULL;
}
