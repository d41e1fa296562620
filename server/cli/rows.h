/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_ROWS_H
#define ISCHIA_SERVER_CLI_ROWS_H

#include <stdbool.h>
#include <stddef.h>

#include "solver/case.h"
#include "solver/error.h"
#include "solver/result.h"

/*
 * Solves rows with N processes: `ischia cohort` and `ischia study`. Each process is a fork that
 * keeps one solver; one that dies takes its row down once: the row is tried again in a fresh
 * process, and the second death is the row's outcome. The processes end with their parent.
 */
struct rows_outcome {
    enum ischia_code code;       /* ISCHIA_OK: result is filled, converged or not           */
    struct ischia_error error;   /* when code is not ISCHIA_OK (ISCHIA_E_STATE: died twice) */
    struct ischia_result result; /* with wall_s and cpu_s                                   */
};

struct rows_task {
    int processes; /* 1 ... ROWS_PROCESSES_MAX */
    void *context; /* of the functions below, all called in the parent */
    /* The next row to solve, in any order; false when there is none left. */
    bool (*next)(void *context, size_t *ret_row, struct ischia_case *ret_case);
    /* Called as rows finish; another value than ISCHIA_OK ends the task with it. */
    enum ischia_code (*done)(void *context, size_t row, const struct rows_outcome *outcome,
                             struct ischia_error *err);
    /* Called about once a second and after each row; may be NULL. */
    void (*tick)(void *context);
};
enum { ROWS_PROCESSES_MAX = 256 };

/* The cases are valid (asserted in the solver). ISCHIA_E_IO when processes cannot be made. */
ISCHIA_MUST_CHECK enum ischia_code rows_solve(const struct rows_task *task,
                                              struct ischia_error *err);

/* How many processes this machine runs at once: the default of -j. */
int rows_processes_default(void);

#endif
