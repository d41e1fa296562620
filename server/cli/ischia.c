/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The program `ischia`: a table of commands. */
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/text.h"
#include "server/blas_environment.h"
#include "server/cli/command.h"
#include "server/standard_streams.h"
#include "solver/case.h"

static int command_help(int argc, char **argv);

static const struct command {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *summary; /* NULL: not listed */
} commands[] = {
    {"solve", command_solve, "solve one side: JSON in, JSON out"},
    {"cohort", command_cohort, "solve every row of a CSV file"},
    {"study", command_study, "designs of many solves, emulators, comparisons"},
    {"export", command_export, "write the model for CalculiX, ParaView or as a drawing"},
    {"hl7", command_hl7, "send a side to an HL7 v2 port, to try it"},
    {"check-tangent", command_check_tangent, "compare derivatives with finite differences"},
    {"version", command_version, "versions of the program, the model and the libraries"},
    {"worker", command_worker, NULL},
    {"help", command_help, "show this, or the help of a command"},
};
enum { COMMAND_COUNT = sizeof commands / sizeof commands[0] };

static const struct command *find_command(const char *name)
{
    for (int i = 0; i < COMMAND_COUNT; i++)
        if (strcmp(name, commands[i].name) == 0) return &commands[i];
    return NULL;
}

static void print_overview(FILE *out)
{
    (void)fprintf(out, "Usage: ischia COMMAND [OPTION]...\n\n"
                       "Strains in the muscle under a seated ischium, from seven numbers.\n\n"
                       "Commands:\n");
    for (int i = 0; i < COMMAND_COUNT; i++)
        if (commands[i].summary != NULL)
            (void)fprintf(out, "  %-14s %s\n", commands[i].name, commands[i].summary);
    (void)fprintf(out, "\nischia COMMAND --help shows its options.\n"
                       "Exit status: 0 done, 1 a solve failed, 2 bad input or usage.\n"
                       "Not a medical device: results rank, they do not diagnose.\n");
}

static int unknown_command(const char *name)
{
    char shown[60];
    const struct command *nearest = NULL;
    int least = TEXT_NO_SLIP;
    for (int i = 0; i < COMMAND_COUNT; i++) {
        const int slips = text_slips(name, commands[i].name);
        if (slips >= least) continue;
        least = slips;
        nearest = &commands[i];
    }
    (void)fprintf(stderr, "ischia: %s is not a command%s%s%s; see ischia help\n",
                  text_printable(name, shown, sizeof shown),
                  nearest != NULL ? "; did you mean " : "", nearest != NULL ? nearest->name : "",
                  nearest != NULL ? "?" : "");
    return EXIT_BAD_INPUT;
}

static int command_help(int argc, char **argv)
{
    static char help[] = "--help";
    if (argc < 2 || argv[1][0] == '-') {
        print_overview(stdout);
        return EXIT_DONE;
    }
    const struct command *command = find_command(argv[1]);
    if (command == NULL) return unknown_command(argv[1]);
    if (command->run == command_help) return command_help(1, argv);
    /* `help study merge` is `study merge --help`. */
    char *words[] = {argv[1], argc > 2 ? argv[2] : help, argc > 2 ? help : NULL, NULL};
    return command->run(argc > 2 ? 3 : 2, words);
}

int main(int argc, char **argv)
{
    standard_streams_hold();
    if (argc < 2) {
        print_overview(stderr);
        return EXIT_BAD_INPUT;
    }
    blas_environment_ensure("ischia", argv);
    const char *name = argv[1];
    if (strcmp(name, "--version") == 0) name = "version";
    if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0) name = "help";
    const struct command *command = find_command(name);
    if (command == NULL) return unknown_command(name);
    const int status = command->run(argc - 1, argv + 1);
    struct ischia_error err;
    if (standard_output_flush(&err) == ISCHIA_OK || status != EXIT_DONE) return status;
    (void)fprintf(stderr, "ischia: %s\n", err.message);
    return EXIT_SOLVE_FAILED;
}
