/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/hl7/address.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>

enum ischia_code address_find(const char *text, struct address *ret, struct ischia_error *err)
{
    const struct addrinfo hints = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM};
    const char *colon = strrchr(text, ':');
    const bool bracket = text[0] == '[';
    const size_t length = colon == NULL ? 0 : (size_t)(colon - text);
    CHECK(length > (bracket ? 2U : 0U) && length < sizeof ret->host, err, ISCHIA_E_INPUT,
          "'%.80s' is not HOST:PORT", text);
    (void)snprintf(ret->host, sizeof ret->host, "%.*s", (int)(bracket ? length - 2 : length),
                   text + bracket);
    ret->where = NULL;
    const int cause = getaddrinfo(ret->host, colon + 1, &hints, &ret->where);
    CHECK(cause == 0, err, ISCHIA_E_IO, "%.80s: %s", text, gai_strerror(cause));
    return ISCHIA_OK;
}

void address_finish(struct address *address)
{
    freeaddrinfo(address->where);
    address->where = NULL;
}
