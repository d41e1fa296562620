/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_ADMIN_H
#define ISCHIA_SERVER_ADMIN_H

#include "server/config.h"

/* The commands of ischiad that do something to the store and end: token, audit, backup, restore. */

enum { ADMIN_OK = 0, ADMIN_FAILED = 1, ADMIN_USAGE = 2 };

/* words[0] is the command ("token"), the rest what follows it. Messages go to stderr. Returns an
 * exit status. */
int admin_run(const struct config *config, char *const *words, int count);

/* The commands, a line each, for --help and the manual. */
extern const char admin_help[];

#endif
