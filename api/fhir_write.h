/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_FHIR_WRITE_H
#define ISCHIA_API_FHIR_WRITE_H

#include "api/fhir.h"

/* What the writers of resources share. For api/fhir_*.c only. */

/* { "coding": [ { system, code, display } ], "text": text }; display and text may be NULL. */
void fhir_put_concept(struct json_out *out, const char *key, const char *system, const char *code,
                      const char *display, const char *text);
/* { "reference": "Type/id" + suffix } */
void fhir_put_reference(struct json_out *out, const char *key, enum fhir_type type, const char *id);
/* { "coding": …, "text": … } of api/measure.h's row. */
void fhir_put_measure_code(struct json_out *out, const char *key, int measure);
/* Opens a resource: resourceType and id. */
void fhir_open(struct json_out *out, const char *key, const char *type, const char *id);
/* "Observation/id-eps-max" without the type: an id of FHIR_ID_BYTES. */
void fhir_observation_id_of(const struct record *record, int measure, char ret[FHIR_ID_BYTES]);

#endif
