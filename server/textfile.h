/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_TEXTFILE_H
#define ISCHIA_SERVER_TEXTFILE_H

#include "solver/error.h"

/* The whole of a small file (keys, certificates, an emulator: at most 4 MiB), NUL-terminated, the
 * caller's to free. With the path: ISCHIA_E_INPUT, it cannot be opened; ISCHIA_E_IO, it cannot be
 * read, is empty, or is too large. */
ISCHIA_MUST_CHECK enum ischia_code textfile_read(const char *path, char **ret,
                                                 struct ischia_error *err);

#endif
