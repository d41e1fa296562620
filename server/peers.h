/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_PEERS_H
#define ISCHIA_SERVER_PEERS_H

#include <stdbool.h>

#include "solver/error.h"

/*
 * Which addresses are a reverse proxy's: "127.0.0.1, 10.2.0.0/16, fd00::/8". Numbers only: a name
 * would make what is believed depend on who answers for that name.
 */

/* ISCHIA_E_INPUT names the first entry that is no address or network. "" is a good, empty list. */
ISCHIA_MUST_CHECK enum ischia_code peers_check(const char *list, struct ischia_error *err);

/* True when the numeric address is in the list. */
bool peers_have(const char *list, const char *address);

#endif
