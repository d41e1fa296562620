/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_CREW_H
#define ISCHIA_SERVER_CLI_CREW_H

#include <stdbool.h>
#include <sys/types.h>

#include "server/estimator.h"
#include "solver/case.h"
#include "solver/error.h"
#include "solver/result.h"
#include "solver/study/uncertainty.h"

/*
 * Processes that solve cases side by side, each with its own solver. A member that dies (killed,
 * out of memory, a crash) costs its one case: the case is answered as failed and a new member
 * takes its place.
 */
enum { CREW_MEMBERS_MAX = 256 };

struct crew_member {
    pid_t pid;
    int fd;   /* our end of a socket pair        */
    long job; /* what it works on, -1: nothing   */
};

struct crew {
    int count;
    const struct estimator *estimator; /* not ours; NULL: no emulator */
    struct crew_member member[CREW_MEMBERS_MAX];
};

/* What one member is to do. */
struct crew_order {
    struct ischia_case c;
    bool has_sd; /* an interval too, when the solve converges */
    double sd[ISCHIA_PARAM_COUNT];
};

struct crew_answer {
    long job;
    int member;            /* that gave it */
    enum ischia_code code; /* ISCHIA_OK: result holds the end of the solve, converged or not */
    char message[ISCHIA_ERROR_MESSAGE_BYTES]; /* unless ISCHIA_OK */
    struct ischia_result result;
    bool has_uncertainty;
    struct ischia_uncertainty uncertainty; /* without the solves that check it */
};

/* Starts count processes (1 ... CREW_MEMBERS_MAX). estimator: for intervals, outlives the crew, may
 * be NULL. ISCHIA_E_IO when one cannot be started. */
ISCHIA_MUST_CHECK enum ischia_code crew_start(struct crew *ret, int count,
                                              const struct estimator *estimator,
                                              struct ischia_error *err);
void crew_stop(struct crew *crew); /* ends them all, working or not */

enum { CREW_NOBODY = -1 };

/* A member that waits for work, or CREW_NOBODY; whether this one does; whether any has work. */
int crew_idle(const struct crew *crew);
bool crew_is_idle(const struct crew *crew, int member);
bool crew_is_working(const struct crew *crew);

/* Gives work to an idle member (asserted). job: 0 or more, the caller's number. */
ISCHIA_MUST_CHECK enum ischia_code crew_give(struct crew *crew, int member, long job,
                                             const struct crew_order *order,
                                             struct ischia_error *err);

/* Waits for the next answer (somebody is working, asserted). */
ISCHIA_MUST_CHECK enum ischia_code crew_wait(struct crew *crew, struct crew_answer *ret,
                                             struct ischia_error *err);

#endif
