/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_RUN_H
#define ISCHIA_SERVER_CLI_RUN_H

#include "api/case_doc.h"
#include "server/cli/bar.h"
#include "server/cli/command.h"
#include "solver/solver.h"

/* What solve and export share: reading the case, solving it with a bar, saying what went wrong. */

/* Prints "ischia COMMAND: message" to stderr. Returns the exit status that fits the code. */
int report_error(const char *command, const struct ischia_error *err);

/*
 * Reads a case from a file or "-" and prints each fault on a line of its own, and the warnings.
 * resolution: NULL, or a name that replaces the document's. EXIT_DONE when *ret is good.
 */
int read_request(const char *command, const char *path, const char *resolution,
                 struct ischia_request *ret);
/* The same of a text that has been read already; name: of the file, for messages. */
int read_request_text(const char *command, const char *name, const char *text, size_t length,
                      const char *resolution, struct ischia_request *ret);

/* ischia_solve with wall_s and cpu_s (of this thread) filled in: the solver has no clock. */
ISCHIA_MUST_CHECK enum ischia_code
timed_solve(struct ischia_solver *solver, const struct ischia_case *c,
            const struct ischia_observer *observer, struct ischia_result *ret_result,
            struct ischia_field *ret_field, struct ischia_error *err);

/* Creates a solver, solves with a bar on a terminal, destroys it. Outputs as ischia_solve. */
ISCHIA_MUST_CHECK enum ischia_code
solve_with_bar(const struct ischia_case *c, struct ischia_result *ret_result,
               struct ischia_field *ret_field, struct ischia_error *err);

/* A bar on a terminal, as an observer; bar_clear it at the end. */
struct ischia_observer observe_with_bar(struct bar *bar);

/* One of the writers of solver.h, into a file that appears when it is complete. field may be NULL
 * for a writer that does not need one. */
typedef enum ischia_code field_writer(FILE *out, const struct ischia_case *c,
                                      const struct ischia_field *field, struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code
write_file(const char *path, field_writer *writer, const struct ischia_case *c,
           const struct ischia_field *field, struct ischia_error *err);

/* Prints why a solve did not converge, on one line of stderr. */
void report_divergence(const char *command, const struct ischia_case *c,
                       const struct ischia_result *result);

#endif
