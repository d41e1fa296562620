/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_TARGET_H
#define ISCHIA_SERVER_TARGET_H

#include <stdatomic.h>

#include "api/record.h"
#include "server/config.h"
#include "server/store/store.h"

/* What outbound.c and its targets (target_*.c) share. */

enum outcome {
    OUTCOME_DELIVERED,
    OUTCOME_REFUSED, /* this one was not taken: later again, others go on                */
    OUTCOME_DOWN,    /* nobody is there: nothing else is tried until the pause is over   */
    OUTCOME_NEVER    /* it will not be taken, whatever happens                           */
};

enum { TARGET_PROBLEM_BYTES = STORE_OUTBOX_PROBLEM_BYTES };

/* One delivery: the row, what it is about, and where the reason goes. */
struct delivery {
    const struct config *config;
    atomic_bool *stopping;
    const struct store_delivery *row;
    const struct store_assessment *assessment;
    const struct record *record;
    char *problem; /* TARGET_PROBLEM_BYTES; nothing that identifies a person */
};

struct target {
    const char *name; /* in the outbox: at most STORE_TARGET_BYTES */
    bool (*is_wanted)(const struct config *config);
    /* Reads keys and certificates; *ret_state is its own, NULL allowed. */
    enum ischia_code (*open)(void **ret_state, const struct config *config,
                             struct ischia_error *err);
    enum outcome (*deliver)(void *state, const struct delivery *delivery);
    void (*close)(void *state);
};

extern const struct target target_webhook, target_fhir, target_hl7;

#endif
