/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_LINK_H
#define ISCHIA_SERVER_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

#include "solver/error.h"

/*
 * A connection that may be encrypted: a socket, and TLS 1.2 or later on top of it when asked for.
 * Blocking, with a time limit on every wait. One thread a link; link_cut may come from another.
 */
struct link;
struct link_tls; /* certificates: made once, shared by links */

/* What this side shows (both NULL: nothing), and whose certificates it takes: ca is PEM text (NULL:
 * the system's). For a server a ca means that clients must show a certificate of it. */
ISCHIA_MUST_CHECK enum ischia_code link_tls_create(struct link_tls **ret, const char *certificate,
                                                   const char *key, const char *ca,
                                                   struct ischia_error *err);
void link_tls_destroy(struct link_tls *tls); /* NULL allowed */

/* Takes over a connected socket of a client; tls NULL: plain. On an error fd is closed. */
ISCHIA_MUST_CHECK enum ischia_code link_accept(struct link **ret, int fd, struct link_tls *tls,
                                               int timeout_ms, struct ischia_error *err);
/* Connects to "host:port"; with tls the certificate must be for that host. */
ISCHIA_MUST_CHECK enum ischia_code link_connect(struct link **ret, const char *address,
                                                struct link_tls *tls, int timeout_ms,
                                                struct ischia_error *err);
void link_close(struct link *link); /* NULL allowed */
/* Ends every read and write of it, now and later; any thread. */
void link_cut(struct link *link);

/* At least one byte, 0 at the end, -1 when it broke, -2 when timeout_ms went by. */
enum { LINK_BROKEN = -1, LINK_TIMED_OUT = -2 };
ssize_t link_read(struct link *link, char *bytes, size_t size, int timeout_ms);
/* All of the bytes, or false. */
bool link_write(struct link *link, const char *bytes, size_t size, int timeout_ms);

#endif
