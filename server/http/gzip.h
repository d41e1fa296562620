/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_GZIP_H
#define ISCHIA_SERVER_GZIP_H

#include <stdbool.h>
#include <stddef.h>

#include "solver/error.h"

/* gzip for bodies: when to use it, and doing it. */

/* True when the Accept-Encoding header takes gzip (not with q=0). */
bool gzip_accepted(const char *accept_encoding);
/* Bodies that fit into one packet gain nothing. */
bool gzip_helps(size_t size);
/* *ret is the caller's to free. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code gzip_pack(const char *bytes, size_t size, char **ret,
                                             size_t *ret_size);
/* "abc" -> "abc-gzip" inside the quotes: another representation needs another tag. */
void gzip_mark_etag(char *etag, size_t size);

#endif
