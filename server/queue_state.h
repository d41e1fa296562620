/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_QUEUE_STATE_H
#define ISCHIA_SERVER_QUEUE_STATE_H

#include <stdbool.h>

/*
 * The life of an assessment: its states, and which may follow which, as one table. The store
 * checks every change of state against it inside the transaction that makes the change.
 *
 * The numbers are stored: never renumber, only append.
 */

enum queue_state {
    QUEUE_QUEUED = 0,
    QUEUE_RUNNING = 1,
    QUEUE_SUCCEEDED = 2,
    QUEUE_FAILED = 3,
    QUEUE_CANCELLED = 4,
    QUEUE_STATE_COUNT
};

/* Larger is served first. A clinic never waits behind a study. Stored: never renumber. */
enum queue_priority { QUEUE_STUDY = 0, QUEUE_CLINIC = 10 };

extern const char *const queue_state_names[QUEUE_STATE_COUNT]; /* "queued", ... as in documents */

/* True when the table allows the step. No state follows itself. */
bool queue_may_follow(enum queue_state from, enum queue_state to);

/* True when nothing follows: succeeded, failed, cancelled. */
bool queue_is_final(enum queue_state state);

/* Finds a state by its name; false when there is none. */
bool queue_state_from_name(const char *name, enum queue_state *ret_state);

#endif
