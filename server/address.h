/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_ADDRESS_H
#define ISCHIA_SERVER_ADDRESS_H

#include <netdb.h>

#include "solver/error.h"

/* "host:port" or "[IPv6]:port", taken apart; both as they were given, without brackets. */
struct address_text {
    char host[256];
    char port[6]; /* 0 to 65535: getaddrinfo would take a larger one, and use what is left of it */
};

/* ISCHIA_E_INPUT, and what is wrong with it. */
ISCHIA_MUST_CHECK enum ischia_code address_split(const char *text, struct address_text *ret,
                                                 struct ischia_error *err);

/* Where a peer is reached. */
struct address {
    struct address_text text; /* the host for the certificate's name, too */
    struct addrinfo *where;   /* to be tried in turn                      */
};

/* Asks for the addresses of what address_split takes. ISCHIA_E_INPUT: not that; ISCHIA_E_IO: no
 * such host. On success *ret is to be freed with address_finish. */
ISCHIA_MUST_CHECK enum ischia_code address_find(const char *text, struct address *ret,
                                                struct ischia_error *err);
void address_finish(struct address *address);

#endif
