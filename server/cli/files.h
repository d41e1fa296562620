/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_FILES_H
#define ISCHIA_SERVER_CLI_FILES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <sys/types.h>

#include "solver/error.h"

/* Input and output of the commands: "-" is standard input or output. */

/* What a message calls it. */
const char *file_name(const char *path);

/*
 * Reads a whole file of at most bytes_max bytes; *ret_text is the caller's to free and ends with a
 * NUL. ISCHIA_E_INPUT: it cannot be opened or is a directory; ISCHIA_E_LIMIT: it is larger;
 * ISCHIA_E_IO; ISCHIA_E_MEMORY.
 */
ISCHIA_MUST_CHECK enum ischia_code file_read(const char *path, size_t bytes_max, char **ret_text,
                                             size_t *ret_length, struct ischia_error *err);

/* Opens for reading; what cannot be a document (a directory) is refused with ISCHIA_E_INPUT. For
 * "-" *ret is stdin. file_close closes it, unless it is stdin. */
ISCHIA_MUST_CHECK enum ischia_code file_open(const char *path, FILE **ret,
                                             struct ischia_error *err);
void file_close(FILE *in); /* NULL allowed */

/*
 * Before work that may take hours: can the output go there? inputs: what is read, "-" and NULL
 * among them skipped; so is a path that is NULL. ISCHIA_E_INPUT: it is one of the inputs, or a
 * directory; ISCHIA_E_IO: there is no such folder, or nothing may be written there.
 */
ISCHIA_MUST_CHECK enum ischia_code file_out_check(const char *path, const char *const *inputs,
                                                  size_t count, struct ischia_error *err);

/*
 * A file that appears under its name only when it is complete: written beside it, then renamed.
 * What is not a regular file ("-", a pipe, /dev/null) is written directly.
 */
struct file_out {
    FILE *stream;
    char *temporary;  /* NULL: written directly */
    const char *path; /* borrowed              */
};
ISCHIA_MUST_CHECK enum ischia_code file_out_open(struct file_out *ret, const char *path,
                                                 struct ischia_error *err);
/* Ends it: code ISCHIA_OK puts the file in its place (ISCHIA_E_IO when that fails), any other code
 * removes it and is returned. */
ISCHIA_MUST_CHECK enum ischia_code file_out_close(struct file_out *out, enum ischia_code code,
                                                  struct ischia_error *err);

/*
 * A text file that grows by whole lines: however the program ends, no line is left cut in a regular
 * file, and what is there can be read while it grows.
 */
struct line_out {
    int fd;
    bool is_regular;
    off_t whole; /* bytes of whole lines */
    const char *path;
};
/* in: a file that must not be the same as path (NULL: none). ISCHIA_E_INPUT when it is, or when
 * another process writes there. */
ISCHIA_MUST_CHECK enum ischia_code line_out_open(struct line_out *ret, const char *path, FILE *in,
                                                 struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code line_out_write(struct line_out *out, const char *lines,
                                                  size_t length, struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code line_out_close(struct line_out *out, struct ischia_error *err);

#endif
