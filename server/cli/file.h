/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_FILE_H
#define ISCHIA_SERVER_CLI_FILE_H

#include <stddef.h>

#include "solver/error.h"

/* Reads a whole file ("-": stdin). *ret_text is the caller's to free and ends with a NUL beyond
 * *ret_length. ISCHIA_E_IO, ISCHIA_E_LIMIT above bytes_max, ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code file_read(const char *path, size_t bytes_max, char **ret_text,
                                             size_t *ret_length, struct ischia_error *err);

/* Replaces a file at once: after a crash at any point path holds the old bytes or the new ones.
 * "-" or NULL: writes to stdout. ISCHIA_E_IO. */
ISCHIA_MUST_CHECK enum ischia_code file_replace(const char *path, const char *text, size_t length,
                                                struct ischia_error *err);

#endif
