/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_PATH_H
#define ISCHIA_SOLVER_PATH_H

#include "solver/newton.h"

/*
 * The load path: the bone goes down in steps until the seat carries the whole force; the last step
 * is taken under force control, so that the force is met exactly.
 */

/* Where the tissue folds, which fold it takes depends on the steps: a path that ends short at one
 * pace may arrive at another. */
struct path_effort {
    double pace;            /* length of the steps over the usual one, (0, 1]      */
    int factorisations_max; /* a path that takes more than these has lost its way  */
};

struct path_report {
    enum ischia_reason reason;
    int load_steps;
    int newton_iterations;
    int factorisations;
    double force_residual;  /* relative, of the last step                                   */
    double energy_residual; /* relative: (work - stored - friction) / work                  */
    double last_force_N;    /* largest force at which a step converged                      */
    const char *tried;      /* when not converged: what was tried, static storage           */
};

/* Called after every converged load step, the first of them with no load; false cancels. */
struct path_observer {
    bool (*on_iteration)(void *context, int load_step, int newton_iteration, double force_N);
    enum ischia_code (*on_step)(void *context, const struct equilibrium *state,
                                struct ischia_error *err);
    void *context;
};

/* Follows the path from rest to force_N (of the quarter model); *state is zero on entry, and ends
 * in the last converged state. */
ISCHIA_MUST_CHECK enum ischia_code
path_follow(struct body *body, struct assembly *assembly, struct seat *seat, double force_N,
            const struct path_effort *effort, const struct path_observer *observer,
            struct equilibrium *state, struct path_report *ret_report, struct ischia_error *err);

#endif
