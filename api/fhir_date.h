/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_FHIR_DATE_H
#define ISCHIA_API_FHIR_DATE_H

#include <stdbool.h>
#include <stdint.h>

/* The span of a FHIR date, dateTime or instant of any precision, in Unix milliseconds: from *ret_lo
 * up to but not including *ret_hi. One without an offset is UTC. False when it is none. */
bool fhir_date_span(const char *text, int64_t *ret_lo, int64_t *ret_hi);

/* True when what a says begins later than what b says; a text that is none of these is before all
 * that are. */
bool fhir_date_is_after(const char *a, const char *b);

/* The range of times after 1970-01-01T00:00:00Z that a date search parameter asks for
 * ("ge2026-03-01"; prefixes eq ge gt le lt sa eb): from *ret_lo up to but not including *ret_hi. 0
 * is no bound, and one at or before that moment becomes 1. False when it is malformed or of another
 * prefix. */
bool fhir_date_range(const char *value, int64_t *ret_lo, int64_t *ret_hi);

#endif
