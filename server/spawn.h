/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_SPAWN_H
#define ISCHIA_SERVER_SPAWN_H

#include <stdbool.h>
#include <stddef.h>

#include "solver/error.h"

/* Starting and ending one worker process. */

struct spawned {
    int pid;
    int pid_fd; /* readable when the process has ended                                    */
    int socket; /* our end, nonblocking; the child's is its descriptor 3                  */
};

enum { SPAWN_COMMAND_MAX = 32 }; /* arguments, with the "--fd" "3" that is appended */

/*
 * Runs command (argv, NULL at its end; command[0] is a path) with "--fd" "3" appended, a minimal
 * environment, /dev/null as input and output, our stderr, no other descriptor, a data segment of at
 * most memory_max_bytes (0: no limit), as the leader of a process group of its own that is killed
 * when the calling thread ends. ISCHIA_E_IO when no process or descriptor is to be had; a command
 * that cannot be executed shows as exit status 127.
 */
ISCHIA_MUST_CHECK enum ischia_code spawn_worker(const char *const *command, size_t memory_max_bytes,
                                                struct spawned *ret, struct ischia_error *err);

/* Kills the process and what it started; it is still to be reaped. */
void spawn_kill(const struct spawned *process);

enum { SPAWN_WORDS_BYTES = 120 };

/* If it has ended (or, with wait, when it has): closes the descriptors, says how in words, returns
 * true. */
bool spawn_reap(struct spawned *process, bool wait, char ret_words[SPAWN_WORDS_BYTES]);

#endif
