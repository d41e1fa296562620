/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_SANDBOX_H
#define ISCHIA_SERVER_SANDBOX_H

#include <stdbool.h>

/*
 * What the daemon gives up for good, and its workers with it: new privileges, core dumps (they
 * would hold what people sent), and writing to any file outside the state directory (Landlock,
 * where the kernel has it).
 */
struct sandbox_report {
    bool no_new_privileges, no_dumps, landlock;
};

/* To be called before the first thread is started. The directory exists. */
struct sandbox_report sandbox_enter(const char *state_dir);

#endif
