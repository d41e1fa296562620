/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_NOTIFY_H
#define ISCHIA_SERVER_NOTIFY_H

#include <stdbool.h>

/*
 * sd_notify(3)'s protocol: tells the service manager that the daemon is ready, reloading, stopping
 * or alive. Does nothing when $NOTIFY_SOCKET is not set.
 */

/* Sends "READY=1", "STOPPING=1", "WATCHDOG=1", "STATUS=…" or several lines of them. False when
 * there is no manager to tell or it could not be told. */
bool notify_manager(const char *state);

/* READY and RELOADING carry the monotonic time as systemd 253 and later want it. */
bool notify_reloading(void);

/* How often the manager wants WATCHDOG=1, in ms; 0: never. Half of what it allows. */
int notify_watchdog_ms(void);

#endif
