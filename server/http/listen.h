/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_LISTEN_H
#define ISCHIA_SERVER_LISTEN_H

#include <stdbool.h>
#include <stddef.h>

#include "solver/error.h"

/* Addresses: to listen on, and of the other end. */

enum { LISTEN_ADDRESS_BYTES = 64 };
struct sockaddr;

/* "host:port" or "[v6]:port" -> a socket that listens, without blocking; *ret_fd is the caller's.
 * ret_address is what it is bound to, in the same form ("127.0.0.1:43211" for port 0). */
ISCHIA_MUST_CHECK enum ischia_code listen_open(const char *address, int *ret_fd,
                                               char ret_address[LISTEN_ADDRESS_BYTES],
                                               struct ischia_error *err);

/* True when every address that the text stands for is a loopback address. */
ISCHIA_MUST_CHECK enum ischia_code listen_is_loopback(const char *address, bool *ret,
                                                      struct ischia_error *err);

/* Numeric text of a peer, without its port; IPv4 inside IPv6 as IPv4. "?" when it has none. */
void listen_peer_text(const struct sockaddr *peer, char *ret, size_t size);

/* 127.0.0.0/8, ::1: for peers and for X-Forwarded-For. */
bool listen_text_is_loopback(const char *numeric);

#endif
