/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_JSON_SCAN_H
#define ISCHIA_API_JSON_SCAN_H

#include <stddef.h>

#include "solver/error.h"

/*
 * Checks that the bytes are exactly one JSON value (RFC 8259) and white space, without allocating.
 * ISCHIA_E_INPUT with line, column (in bytes, from 1) and what was expected when they are not, or
 * when arrays and objects are nested more than depth_max deep. What passes can be given to cJSON:
 * no number is longer than cJSON's buffer, no string holds a NUL that would end it early.
 */
ISCHIA_MUST_CHECK enum ischia_code json_scan(const char *text, size_t length, int depth_max,
                                             struct ischia_error *err);

#endif
