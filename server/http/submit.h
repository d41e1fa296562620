/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_SUBMIT_H
#define ISCHIA_SERVER_SUBMIT_H

#include "api/record.h"
#include "server/http/service.h"

/* What every route that accepts an assessment does: the key, the queue, the wait for the commit. */

/* The Idempotency-Key, NULL when there is none. False: ret is the refusal. */
bool submit_read_key(struct call *call, const char **ret_key, struct http_response *ret);

/* Hands the request to the queue and parks the call until the commit; call->deferred then has the
 * answer. origin and key may be NULL. When that cannot be done, ret is the failure. */
void submit_enqueue(struct call *call, const struct ischia_request *request,
                    const struct origin *origin, const char *key, struct http_response *ret);

/* Parks the call again while the commit is still to come. True: it has come. */
bool submit_is_committed(struct call *call, struct http_response *ret);

/* Notes what was accepted in call->id, once. False: ret is the refusal (key conflict, queue full,
 * store failure). */
bool submit_take_accepted(struct call *call, struct http_response *ret);

/* Seconds of Prefer: wait as a deadline for call_wait; 0: it was not asked for. */
int64_t submit_wait_deadline(const struct call *call);

#endif
