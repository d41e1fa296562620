/* SPDX-License-Identifier: GPL-3.0-or-later */
/* ischia check-tangent: hand-written derivatives against finite differences. */
#include "server/cli/options.h"
#include "server/cli/run.h"

int command_check_tangent(int argc, char **argv)
{
    const struct cli_option none[] = {{0}};
    const struct cli_usage usage = {
        .command = "check-tangent",
        .synopsis = "",
        .about = "Compares every hand-written derivative of the solver with finite differences,\n"
                 "a line each. A diagnostic for a new compiler, machine or build.",
        .options = none,
        .operands_max = 0,
    };
    struct ischia_error err;
    const enum cli_parse parsed = cli_parse_options(&usage, argc, argv, NULL);
    if (parsed != CLI_RUN) return parsed == CLI_HELP_SHOWN ? EXIT_DONE : EXIT_BAD_INPUT;
    if (ischia_check_tangents(stdout, &err) != ISCHIA_OK)
        return (int)report_error("check-tangent", &err);
    return EXIT_DONE;
}
