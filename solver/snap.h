/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_SNAP_H
#define ISCHIA_SOLVER_SNAP_H

#include "solver/track.h"

/*
 * A snap in slow motion. Soft tissue that is pressed far folds: at some travel of the bone its
 * equilibrium ends, and the next one is millimetres away. Newton's steps find it, but what energy
 * comes free on the way is then only known as what is missing in the balance.
 *
 * Here the same way is gone against viscous drag: the bone moves on and is held there, and
 *
 *     c_n du_n/dt = -dE/du_n
 *
 * at every node n, in steps of time by the backward Euler rule. Each is a minimisation of the
 * energy with springs from where the nodes are (newton.h), which is convex when the step is short.
 * Drag is a force times a way, apart from the energies, by the trapezium rule between steps: a
 * balance that counts it is still a check. c_n is the node's share of shear modulus times volume
 * over height squared; it sets the unit of time and weighs the nodes. The last step is without
 * drag, so that the equilibrium is the model's own. (A viscous regularisation, as programs for
 * structures offer it for whole analyses; here within a snap only.)
 */
struct snap;

/* Work space for a track, which stays the caller's. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code snap_create(struct snap **ret, const struct track *track,
                                               struct ischia_error *err);
void snap_destroy(struct snap *snap); /* NULL allowed */

struct snap_report {
    bool arrived; /* at an equilibrium without drag, which is track->last now, with its tangent */
    int newton_iterations;
    int factorisations;
};

/*
 * Moves the bone on by dd_mm from the last converged step, or by less where that is too far, and
 * follows the tissue to its equilibrium there. Where it does not arrive within the factorisations,
 * track->last is no equilibrium any more, and the path is at its end. The tangent at the end takes
 * nodes that came to rest there as sticking.
 */
ISCHIA_MUST_CHECK enum ischia_code snap_follow(struct snap *snap, struct track *track, double dd_mm,
                                               int factorisations_max, newton_observe *observe,
                                               void *context, struct snap_report *ret,
                                               struct ischia_error *err);

#endif
