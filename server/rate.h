/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_RATE_H
#define ISCHIA_SERVER_RATE_H

#include <stdbool.h>
#include <stdint.h>

#include "solver/error.h"

/*
 * A token bucket for each client, in a table of fixed size: a flood of addresses costs no memory.
 * Clients that share a slot's hash share its bucket, which errs on the strict side.
 */

struct rate;

/* *ret is the caller's to destroy. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code rate_create(struct rate **ret, struct ischia_error *err);
void rate_destroy(struct rate *rate); /* NULL allowed */

/*
 * Takes one request from the client's bucket, which holds `burst` and fills by per_second.
 * Returns 0 when it was there, else the seconds (>= 1) until it will be. now_ms is monotonic.
 */
int rate_take(struct rate *rate, const char *client, int per_second, int burst, int64_t now_ms);

#endif
