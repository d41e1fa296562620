/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_PATH_H
#define ISCHIA_SOLVER_PATH_H

#include "solver/newton.h"

/*
 * The load path: the bone goes down in steps until the seat carries the whole force; the last step
 * is taken under force control, so that the force is met exactly.
 */

enum { PATH_STEPS_MAX = 150 }; /* load steps of one path */

/* Where the tissue folds, which fold it takes depends on the steps: a path that ends short at one
 * pace may arrive at another. */
struct path_effort {
    double pace;            /* length of the steps over the usual one, (0, 1]      */
    int factorisations_max; /* a path that takes more than these has lost its way  */
    bool slow_motion;       /* snaps are followed, and what they release is measured (snap.h);
                               else a short step may lose energy, and the balance tells */
};

struct path_report {
    enum ischia_reason reason;
    int load_steps;
    int newton_iterations;
    int factorisations;
    double force_residual;  /* relative, of the last step                                   */
    double energy_residual; /* relative: (work - stored - friction - released) / work       */
    double released;        /* in snaps, by the work of drag; relative to the work          */
    double last_force_N;    /* largest force at which a step converged                      */
    const char *tried;      /* when not converged: what was tried, static storage           */
};

/* on_step is called after every converged load step; on_leave before the first step that ends at
 * the force, or when the path ends without one: what was told until then belongs to every larger
 * force too. NULL is allowed for each; false, or an error, ends the path. */
struct path_observer {
    bool (*on_iteration)(void *context, int load_step, int newton_iteration, double force_N);
    enum ischia_code (*on_step)(void *context, const struct equilibrium *state,
                                struct ischia_error *err);
    void (*on_leave)(void *context);
    void *context;
};

/*
 * The steps on the way know nothing of the force that is wanted in the end. A path remembers the
 * last of them, before it left for its force, and goes on from there to a larger one, whether it
 * had arrived or not; a path that ended before it left ends there with any larger force. A side
 * pressed with three forces, the smallest first, costs little more than with the largest alone, and
 * each has the bits that it has from rest.
 */
struct path;

/* From rest: *state is zero. All of them stay the caller's and must outlive the path.
 * ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code
path_create(struct path **ret, struct body *body, struct assembly *assembly, struct seat *seat,
            const struct path_effort *effort, struct equilibrium *state, struct ischia_error *err);
void path_destroy(struct path *path); /* NULL allowed */

/* True when the path can go on to this force (of the quarter model): it has gone nowhere yet, or
 * for a force that was not larger. */
bool path_serves(const struct path *path, double force_N);

/* Presses until the seat carries force_N, which the path serves (asserted); the state ends in the
 * last converged step. Reports of all steps from rest, whether taken now or before. After an error
 * the path is of no more use. */
ISCHIA_MUST_CHECK enum ischia_code
path_press(struct path *path, double force_N, const struct path_observer *observer,
           struct path_report *ret_report, struct ischia_error *err);

/* One path from rest to one force. */
ISCHIA_MUST_CHECK enum ischia_code
path_follow(struct body *body, struct assembly *assembly, struct seat *seat, double force_N,
            const struct path_effort *effort, const struct path_observer *observer,
            struct equilibrium *state, struct path_report *ret_report, struct ischia_error *err);

#endif
