/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_PREDICTOR_DOC_H
#define ISCHIA_API_PREDICTOR_DOC_H

#include <stddef.h>

#include "solver/error.h"
#include "solver/study/predictor.h"

/*
 * A trained emulator's file, as emulator/train.py writes it (docs/EMULATOR.md). Its first line is
 *   ischia emulator 2 sha256 HEX
 * with the digest of all that follows, one JSON object.
 */
enum { PREDICTOR_DIGEST_DIGITS = 64, PREDICTOR_FILE_BYTES_MAX = 16 * 1024 * 1024 };

/* Splits the file: the digest of the first line, and where the JSON begins. ISCHIA_E_INPUT: it is
 * no such file. */
ISCHIA_MUST_CHECK enum ischia_code
predictor_doc_split(const char *text, size_t length, char ret_digest[PREDICTOR_DIGEST_DIGITS + 1],
                    const char **ret_json, struct ischia_error *err);

/* Reads the JSON. ISCHIA_E_INPUT: not JSON, a member is missing or out of bounds, or it was trained
 * with another model or version of it; ISCHIA_E_LIMIT, ISCHIA_E_MEMORY. *ret is untouched on error,
 * else the caller's to finish. */
ISCHIA_MUST_CHECK enum ischia_code predictor_doc_read(struct predictor *ret, const char *json,
                                                      size_t length, struct ischia_error *err);

#endif
