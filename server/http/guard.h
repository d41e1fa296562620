/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_GUARD_H
#define ISCHIA_SERVER_GUARD_H

#include <stdbool.h>

#include "server/http/routes.h"

/*
 * Who may ask for what, judged before the body is read: the Host that was asked for (a page that
 * rebinds its name to this machine asks for a foreign one), the Origin of the page that asks (a
 * foreign page may not change anything), the client's rate, its token and the token's scope.
 */

/* True: go on; call->who and call->client are set. False: ret is the refusal. */
bool guard_admit(struct call *call, struct http_response *ret);

/* The security headers of every answer; those that depend on its type. */
void guard_headers(const struct call *call, struct http_response *response);

#endif
