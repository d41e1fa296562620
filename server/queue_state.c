/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/queue_state.h"

#include <stddef.h>
#include <string.h>

const char *const queue_state_names[QUEUE_STATE_COUNT] = {
    [QUEUE_QUEUED] = "queued", [QUEUE_RUNNING] = "running",     [QUEUE_SUCCEEDED] = "succeeded",
    [QUEUE_FAILED] = "failed", [QUEUE_CANCELLED] = "cancelled",
};

/* A queued job may succeed without running: its case was solved for another assessment. */
static const bool may_follow[QUEUE_STATE_COUNT][QUEUE_STATE_COUNT] = {
    [QUEUE_QUEUED] = {[QUEUE_RUNNING] = true, [QUEUE_SUCCEEDED] = true, [QUEUE_CANCELLED] = true},
    [QUEUE_RUNNING] = {[QUEUE_QUEUED] = true,
                       [QUEUE_SUCCEEDED] = true,
                       [QUEUE_FAILED] = true,
                       [QUEUE_CANCELLED] = true},
};

static bool is_state(enum queue_state state) { return (unsigned)state < QUEUE_STATE_COUNT; }

bool queue_may_follow(enum queue_state from, enum queue_state to)
{
    return is_state(from) && is_state(to) && may_follow[from][to];
}

bool queue_is_final(enum queue_state state)
{
    for (unsigned to = 0; to < QUEUE_STATE_COUNT; to++)
        if (queue_may_follow(state, (enum queue_state)to)) return false;
    return is_state(state);
}

bool queue_state_from_name(const char *name, enum queue_state *ret_state)
{
    for (unsigned state = 0; name != NULL && state < QUEUE_STATE_COUNT; state++)
        if (strcmp(name, queue_state_names[state]) == 0) {
            *ret_state = (enum queue_state)state;
            return true;
        }
    return false;
}
