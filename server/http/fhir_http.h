/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_FHIR_HTTP_H
#define ISCHIA_SERVER_FHIR_HTTP_H

#include "api/fhir.h"
#include "server/http/service.h"

/* What the routes under /fhir share. */

enum { FHIR_BASE_BYTES = 400 };

/* "https://host/fhir": by the option public_url, else as the request has it. */
void fhir_base(const struct call *call, char ret[FHIR_BASE_BYTES]);
/* The same without the "/fhir". */
void fhir_origin(const struct call *call, char ret[FHIR_BASE_BYTES]);

/* Hands the document over as the body, in the media type that was agreed on. */
void fhir_send(struct call *call, int status, struct json_out *out, struct http_response *ret);

/* Reads the assessment of call->id. False: ret is the refusal. The row is the caller's. */
bool fhir_get_row(struct call *call, struct store_assessment *ret_row, struct http_response *ret);

/* True when the query asks for _pretty=true: indentation for json_out_init. */
int fhir_indent(const struct call *call);

#endif
