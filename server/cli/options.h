/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_OPTIONS_H
#define ISCHIA_SERVER_CLI_OPTIONS_H

#include <stdbool.h>

#include "solver/error.h"

/*
 * Options of a command from one table, which parsing and --help both walk. A table ends with a row
 * whose name is NULL. An option has a text or a flag, not both.
 */
struct cli_option {
    const char *name;  /* "--resolution" */
    char letter;       /* 'j' for -j, 0 for none                    */
    const char *value; /* its value's name in the help; NULL: a flag */
    const char *help;
    const char **text; /* where the value goes; unchanged when the option is not given */
    bool *flag;
};

struct cli_usage {
    const char *command;  /* "solve"                                        */
    const char *synopsis; /* what may follow the options: "[FILE|-]"        */
    const char *about;    /* a paragraph for --help                         */
    const struct cli_option *options;
    int operands_max;
};

enum cli_parse { CLI_RUN, CLI_HELP_SHOWN, CLI_BAD_USAGE };

/*
 * Reads argv[1] and on. Operands go to ret_operands[0 ... operands_max - 1], which keep their
 * values when there are fewer. CLI_HELP_SHOWN after --help (on stdout); CLI_BAD_USAGE after a
 * message on stderr that names the word and what is accepted.
 */
enum cli_parse cli_parse_options(const struct cli_usage *usage, int argc, char **argv,
                                 const char **ret_operands);

/* A whole number from min to max; false after a message that names the option. */
bool cli_whole_number(const struct cli_usage *usage, const char *option, const char *text, int min,
                      int max, int *ret);

#endif
