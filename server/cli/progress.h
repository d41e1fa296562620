/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_PROGRESS_H
#define ISCHIA_SERVER_CLI_PROGRESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/*
 * How far a long job is, on stderr: on a terminal a bar that is redrawn, else a line every ten
 * seconds, so that a log stays readable.
 */
struct progress {
    FILE *out;
    const char *what; /* "rows"; borrowed */
    size_t total;
    size_t before; /* done by an earlier run: not part of the pace */
    bool terminal;
    bool quiet;
    double start_s, shown_s;
};

void progress_init(struct progress *ret, FILE *out, const char *what, size_t total, size_t before,
                   bool quiet);
/* done counts all, `before` included; failed is how many of them did not give a result. */
void progress_show(struct progress *progress, size_t done, size_t failed);
void progress_finish(struct progress *progress, size_t done, size_t failed);

#endif
