/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_AUTH_H
#define ISCHIA_SERVER_AUTH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "server/store/store.h"
#include "solver/error.h"

/*
 * Access tokens. A token is "ischia_" + 16 hex digits (its id) + "_" + 43 characters of base64url
 * (256 random bits). The store keeps a BLAKE2b hash of the secret only: the bits are random, so a
 * slow password hash would add nothing but a way to exhaust the server.
 *
 * A running daemon keeps the tokens in memory and notices within a second when one was added or
 * revoked, also by another process.
 *
 * Without tokens everything is granted. The first one shuts the door, and neither revoking nor
 * expiry opens it again: that would turn a stolen token that is revoked into no token at all. Only
 * to forget revoked and expired tokens, until there is none, goes back to the beginning; where
 * auth_require was called not even that does.
 */

#define AUTH_TOKEN_PREFIX "ischia_"

enum auth_scope {
    AUTH_READ = 1,   /* read assessments, changes, metrics   */
    AUTH_ASSESS = 2, /* submit and cancel                    */
    AUTH_ADMIN = 4   /* erase; holds the other two           */
};
enum { AUTH_ALL = AUTH_READ | AUTH_ASSESS | AUTH_ADMIN };

enum { AUTH_ID_BYTES = 17, AUTH_TOKEN_BYTES = 80, AUTH_TOKENS_MAX = 4096 /* that hold */ };
enum { AUTH_USER_MAX = 64, AUTH_WHO_BYTES = sizeof "user:" + AUTH_USER_MAX };

struct auth_identity {
    /* A token's id, "iss-..." for a record system, "user:NAME" for somebody whom the proxy names;
     * "-" where nothing is needed. */
    char id[AUTH_WHO_BYTES];
    unsigned scopes; /* bits of enum auth_scope */
};

enum auth_verdict { AUTH_GRANTED, AUTH_NO_TOKEN, AUTH_BAD_TOKEN, AUTH_EXPIRED };

struct auth;

/* Reads the store's tokens. *ret is the caller's to destroy; the store must outlive it. */
ISCHIA_MUST_CHECK enum ischia_code auth_create(struct auth **ret, struct store *store,
                                               struct ischia_error *err);
void auth_destroy(struct auth *auth); /* NULL allowed */

/* From now on every request needs a token, even where none exists. Before other threads ask. */
void auth_require(struct auth *auth);

/* True when at least one token exists that is not revoked, expired or not. */
bool auth_has_tokens(struct auth *auth);

/* True when every request needs a token. */
bool auth_asks(struct auth *auth);

/*
 * Judges an Authorization header (NULL: none) at now_ms (Unix time): "Bearer TOKEN", or "Basic"
 * with the token as password, which lets a browser ask for it. Takes the same time whether or not
 * the id exists. Where auth_asks is false everything is granted. May be called from any thread.
 */
enum auth_verdict auth_check(struct auth *auth, const char *header, int64_t now_ms,
                             struct auth_identity *ret_identity);

/* The identity of somebody whom a reverse proxy has signed in. False, and nothing changed: the name
 * is not 1 to AUTH_USER_MAX letters, digits and ._@+-\\ . */
bool auth_user(const char *name, unsigned scopes, struct auth_identity *ret_identity);

/* "read,assess" -> bits; 0 when a word is unknown. */
unsigned auth_parse_scopes(const char *text);

/* The administration commands. create returns the whole token, which is nowhere else. expires_ms 0:
 * never. name: what it is for; ISCHIA_E_LIMIT when AUTH_TOKENS_MAX hold. ISCHIA_E_STATE when an id
 * to revoke does not exist. forget erases those that are revoked or expired. */
ISCHIA_MUST_CHECK enum ischia_code
auth_token_create(struct store *store, unsigned scopes, int64_t expires_ms, const char *name,
                  char ret_token[AUTH_TOKEN_BYTES], struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code auth_token_list(struct store *store, FILE *out,
                                                   struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code auth_token_revoke(struct store *store, const char *id,
                                                     struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code auth_token_forget(struct store *store, int64_t *ret_count,
                                                     struct ischia_error *err);

#endif
