/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_HL7_ADDRESS_H
#define ISCHIA_SERVER_HL7_ADDRESS_H

#include <netdb.h>

#include "solver/error.h"

/* Where a peer is reached. */
struct address {
    char host[256];         /* as it was given, for the certificate's name */
    struct addrinfo *where; /* to be tried in turn */
};

/* Reads "host:port" or "[IPv6]:port" and asks for its addresses. ISCHIA_E_INPUT: not that;
 * ISCHIA_E_IO: no such host or port. On success *ret is to be freed with address_finish. */
ISCHIA_MUST_CHECK enum ischia_code address_find(const char *text, struct address *ret,
                                                struct ischia_error *err);
void address_finish(struct address *address);

#endif
