/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_TLS_H
#define ISCHIA_SERVER_TLS_H

#include <time.h>

#include "solver/error.h"

/*
 * The certificate that connections are shown. There is one for the process, since GnuTLS gives its
 * callback no context; it can be replaced at any time, and connections under way keep theirs.
 */

/* Takes a certificate chain, the server's own first, and its private key, both PEM; copies them.
 * ISCHIA_E_INPUT: they cannot be read or do not belong together, and what was set before stays.
 * ret_expires: when the server's own certificate does. Any thread. */
ISCHIA_MUST_CHECK enum ischia_code tls_set(const char *certificate_pem, const char *key_pem,
                                           time_t *ret_expires, struct ischia_error *err);

/* Forgets the certificate and wipes the key; after the last connection. */
void tls_clear(void);

/* A gnutls_certificate_retrieve_function3, as the HTTP library takes it. */
void *tls_callback(void);

const char *tls_library_version(void); /* "3.7.9" */

#endif
