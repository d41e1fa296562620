/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_LISTENER_H
#define ISCHIA_SERVER_LISTENER_H

#include <stddef.h>

#include "server/audit.h"
#include "server/config.h"
#include "server/hl7/link.h"
#include "server/queue.h"

/*
 * The HL7 v2 door: MLLP on a port of its own. Each connection has a thread, which acknowledges a
 * message once its assessment is durably queued. The same control id (MSH-10) of the same sender
 * with the same bytes is acknowledged again without a second assessment; with other bytes it is
 * refused.
 */
struct listener;

struct listener_options {
    const char *listen;      /* "address:port"                              */
    const char *application; /* MSH-3 of what we send                       */
    const char *facility;    /* MSH-4                                       */
    struct link_tls *tls;    /* NULL: plain; the caller's                   */
    struct queue *queue;     /* the caller's, outlives the listener         */
    struct audit *audit;     /* likewise                                    */
};

/* Listens until listener_stop. ISCHIA_E_INPUT, ISCHIA_E_IO: the address; ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code listener_start(struct listener **ret,
                                                  const struct listener_options *options,
                                                  struct ischia_error *err);
const char *listener_address(const struct listener *listener); /* really listened on */
/* Ends every connection and waits for its thread: what was acknowledged is queued. NULL allowed. */
void listener_stop(struct listener *listener);

#endif
