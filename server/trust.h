/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_TRUST_H
#define ISCHIA_SERVER_TRUST_H

#include <stdbool.h>
#include <stdint.h>

#include "solver/error.h"

/*
 * Who may call the CDS services: an allow-list of issuers with their public keys, from one file:
 *
 *   { "issuers": [ { "iss": "https://ehr.example", "jwks": { "keys": [ { "kty": "EC", … } ] } } ] }
 *
 * Nothing is ever fetched: a key that is not in the file is not trusted.
 */
struct trust;

/* *ret is the caller's to destroy. ISCHIA_E_IO: the file cannot be read; ISCHIA_E_INPUT: it is not
 * such a file (the message says where). */
ISCHIA_MUST_CHECK enum ischia_code trust_create(struct trust **ret, const char *path,
                                                struct ischia_error *err);
void trust_destroy(struct trust *trust); /* NULL allowed */

enum { TRUST_ISSUER_BYTES = 256 };

/*
 * Judges "Bearer TOKEN" (NULL: no header): signed with ES384 or RS384 by a key of an issuer on the
 * list, for this audience, not expired, not issued in the future, at most an hour long, and with a
 * jti that this process has not seen before. Returns NULL and sets ret_issuer, or why not, in
 * words without anything of the token. now_s is Unix time. Any thread.
 */
const char *trust_check(struct trust *trust, const char *header, const char *audience,
                        int64_t now_s, char ret_issuer[TRUST_ISSUER_BYTES]);

#endif
