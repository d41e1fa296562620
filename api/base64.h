/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_BASE64_H
#define ISCHIA_API_BASE64_H

#include "api/text.h"

/* RFC 4648 with padding, on one line. */
void base64_put(struct text_out *out, const void *bytes, size_t size);

/* base64url without padding, as JOSE has it. */
void base64url_put(struct text_out *out, const void *bytes, size_t size);
/* Decodes base64url; false when it is not, or does not fit. *ret_size is set on success. */
bool base64url_decode(const char *text, size_t length, unsigned char *ret, size_t room,
                      size_t *ret_size);

#endif
