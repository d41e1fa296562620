/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_STUDY_H
#define ISCHIA_SERVER_CLI_STUDY_H

#include "api/study_plan.h"
#include "api/text.h"
#include "server/cli/command.h"
#include "server/cli/options.h"
#include "solver/error.h"

/* The sub-commands of `ischia study`, one file each: argv[0] is the sub-command's name. */
int study_factorial(int argc, char **argv);
int study_merge(int argc, char **argv);
int study_emulate(int argc, char **argv);
int study_compare(int argc, char **argv);

/* Prints "ischia study WHAT: message" on stderr and returns the exit status that fits the code. */
int study_failed(const char *what, const struct ischia_error *err);

/* Reads a design file and makes its points; its faults are printed on stderr, one a line.
 * ISCHIA_E_INPUT when there are any; else as file_read and study_plan_read. */
ISCHIA_MUST_CHECK enum ischia_code study_load_plan(struct study_plan *ret, const char *path,
                                                   const struct case_doc_defaults *defaults,
                                                   struct ischia_error *err);

/* As cli_parse_options, and CLI_BAD_USAGE with a message when there are fewer operands than
 * operands_min (1 or more). ret_operands are NULL before. */
enum cli_parse study_parse(const struct cli_usage *usage, int operands_min, int argc, char **argv,
                           const char **ret_operands);
/* Says on stderr what is missing; CLI_BAD_USAGE. */
enum cli_parse study_lacks(const struct cli_usage *usage, const char *what);

/* Takes the text and writes it to path (NULL or "-": stdout), whole or not at all. */
ISCHIA_MUST_CHECK enum ischia_code study_write(struct text_out *text, const char *path,
                                               struct ischia_error *err);

#endif
