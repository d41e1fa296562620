/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_OUTBOUND_H
#define ISCHIA_SERVER_OUTBOUND_H

#include "server/config.h"
#include "server/store/store.h"

/*
 * Telling record systems how assessments ended: a webhook, a FHIR server, an HL7 v2 peer. What is
 * to be told is in the store's outbox, so that a target that is down, or a daemon that is killed,
 * loses nothing: it is tried again, with pauses that double, until the target has confirmed it or
 * outbound_days have gone by. A target may be told twice (its answer was lost), never not at all;
 * the message id, the identifier and the control id are the same both times.
 */
struct outbound;

/* Starts a thread for each target that the options name, and forgets the outboxes of the others.
 * config and store stay the caller's and outlive it. ISCHIA_E_INPUT, ISCHIA_E_IO: a key, secret or
 * certificate file is not usable. */
ISCHIA_MUST_CHECK enum ischia_code outbound_create(struct outbound **ret,
                                                   const struct config *config, struct store *store,
                                                   struct ischia_error *err);
/* An assessment has ended: look now instead of within a second. Any thread; NULL allowed. */
void outbound_wake(struct outbound *outbound);
/* Ends deliveries under way; what was not confirmed stays in the outbox. NULL allowed. */
void outbound_destroy(struct outbound *outbound);

#endif
