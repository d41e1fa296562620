/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_COMMAND_H
#define ISCHIA_SERVER_CLI_COMMAND_H

#include <stdio.h>

/*
 * The commands of `ischia`: one file each, one row each in the table of ischia.c. argv[0] is the
 * command's name. The value is the exit status.
 */
enum {
    EXIT_DONE = 0,
    EXIT_SOLVE_FAILED = 1, /* also: the machine failed us (memory, disk) */
    EXIT_BAD_INPUT = 2     /* bad input or usage                         */
};

int command_solve(int argc, char **argv);
int command_cohort(int argc, char **argv);
int command_check_tangent(int argc, char **argv);
int command_export(int argc, char **argv);
int command_study(int argc, char **argv);
int command_hl7(int argc, char **argv);
int command_version(int argc, char **argv);
int command_worker(int argc, char **argv); /* for ischiad: serves one socket, see worker.c */

#endif
