/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_VERSIONS_H
#define ISCHIA_SERVER_VERSIONS_H

/* The libraries that the daemon runs with, as they say it themselves. */
struct version {
    const char *name;
    const char *(*text)(void);
};

/* Ends with a row whose name is NULL. */
const struct version *versions(void);

#endif
