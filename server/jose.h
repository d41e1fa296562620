/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_JOSE_H
#define ISCHIA_SERVER_JOSE_H

#include <stdbool.h>
#include <stddef.h>

#include "api/json.h"
#include "solver/error.h"

/*
 * Signatures of JSON Web Tokens, ES384 and RS384 only: what CDS Hooks and SMART Backend Services
 * ask for. jose.c is one of the files that see gnutls. A key says which algorithm it is for, so
 * that no token can choose a weaker one.
 */
enum { JOSE_ALGORITHM_BYTES = 8, JOSE_KEY_ID_BYTES = 128 };

struct jose_key;

/* A public key from a JWK (RFC 7517): EC on P-384, or RSA of at least 2048 bits. *ret is the
 * caller's. ISCHIA_E_INPUT: it is neither. */
ISCHIA_MUST_CHECK enum ischia_code jose_public_key(struct jose_key **ret, const struct json *jwk,
                                                   struct ischia_error *err);
/* A private key of the same kinds, as PEM without a passphrase. */
ISCHIA_MUST_CHECK enum ischia_code jose_private_key(struct jose_key **ret, const char *pem,
                                                    const char *key_id, struct ischia_error *err);
void jose_key_destroy(struct jose_key *key); /* NULL allowed */

const char *jose_key_algorithm(const struct jose_key *key); /* "ES384", "RS384" */
const char *jose_key_id(const struct jose_key *key);        /* "kid"; "" when it has none */

const char *jose_library_version(void); /* of GnuTLS, as it runs: "3.7.9" */

/* True when signature (as JWS has it: r and s behind each other, or RSA's) is that of the text by
 * this public key. May be called from several threads. */
bool jose_verify(struct jose_key *key, const char *text, size_t length,
                 const unsigned char *signature, size_t signature_size);

/* The compact form of a token with these claims (one JSON object), signed by this private key; the
 * caller's to free. */
ISCHIA_MUST_CHECK enum ischia_code jose_sign(struct jose_key *key, const char *claims_json,
                                             char **ret_token, struct ischia_error *err);

#endif
