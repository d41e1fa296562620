/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_AUDIT_H
#define ISCHIA_SERVER_AUDIT_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "server/config.h"
#include "server/store/store.h"
#include "solver/error.h"

/*
 * The audit log: who did what, when, to which assessment, with what outcome, as a chain of hashes
 * in the store. It holds ids of tokens and assessments, and names of those who signed in at a
 * proxy; never a subject or a value.
 *
 * A client that reads the same assessment again within a minute is recorded once: who read what is
 * kept, how often their page asked is not.
 */

struct audit;

/* *ret is the caller's to destroy; the store must outlive it. */
ISCHIA_MUST_CHECK enum ischia_code audit_create(struct audit **ret, struct store *store,
                                                struct ischia_error *err);
void audit_destroy(struct audit *audit); /* NULL allowed */

/* Which records are kept from now on. */
void audit_set_mode(struct audit *audit, enum config_audit mode);

/* Something was changed, or refused. `what` and `outcome` are fixed words; id "" when none. False
 * when it could not be queued for the store. Thread-safe. */
bool audit_change(struct audit *audit, const char *who, const char *what, const char *id,
                  const char *outcome);
/* An assessment, or a list, was read. now_ms is monotonic. */
bool audit_read(struct audit *audit, const char *who, const char *what, const char *id,
                int64_t now_ms);

/* `ischiad audit verify` and `list`: walk the chain; one line a row. */
ISCHIA_MUST_CHECK enum ischia_code audit_verify(struct store *store, FILE *out,
                                                struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code audit_list(struct store *store, FILE *out,
                                              struct ischia_error *err);

#endif
