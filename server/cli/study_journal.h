/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_STUDY_JOURNAL_H
#define ISCHIA_SERVER_CLI_STUDY_JOURNAL_H

#include <stddef.h>
#include <stdint.h>

#include "solver/error.h"

/*
 * The rows a study has finished, safe on disk as they finish: one line a row,
 *   CRC32 ROW WALL_S TEXT
 * after a line that says which plan they belong to. A line that is torn or damaged (its checksum
 * says so) counts as never written, so killing the program at any point loses at most the rows that
 * were being solved.
 */
struct study_journal {
    int fd;
    size_t rows;
    char **text; /* [rows] what each finished row has, NULL for one to be solved */
    size_t done;
    size_t damaged; /* lines that were passed over */
};

/*
 * Opens or makes the journal and takes it for this process alone. ISCHIA_E_STATE: it belongs to
 * another plan or version, or another process has it. ISCHIA_E_IO, ISCHIA_E_MEMORY.
 */
ISCHIA_MUST_CHECK enum ischia_code study_journal_open(struct study_journal *ret, const char *path,
                                                      uint64_t fingerprint, size_t rows,
                                                      struct ischia_error *err);
void study_journal_close(struct study_journal *journal); /* a zeroed one is allowed */

/* Adds a finished row (not there yet: asserted); on disk when it returns. text is one line. */
ISCHIA_MUST_CHECK enum ischia_code study_journal_add(struct study_journal *journal, size_t row,
                                                     double wall_s, const char *text,
                                                     struct ischia_error *err);

#endif
