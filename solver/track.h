/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_TRACK_H
#define ISCHIA_SOLVER_TRACK_H

#include "solver/newton.h"

/*
 * Where a load path is: its last converged step, what that has cost in energy, how it goes on from
 * there, and the way back to it. Who decides on steps is path.h, and snap.h where tissue snaps.
 */

/* A converged step. */
struct track_point {
    double d_mm;
    double force_N;        /* quarter model */
    double stiffness_N_mm; /* dF/dd; 0: not known */
    double work_Nmm;       /* of the seat   */
    double stored_Nmm;     /* elastic energy, and that of the sticking springs */
    double friction_Nmm;   /* dissipated     */
    double drag_Nmm;       /* work against drag, in snaps */
};

/* All that a path needs to go on from there, or back to it. Arrays have an entry a node. */
struct track_step {
    struct track_point at;
    double (*u_mm)[3];      /* displacements                   */
    double *normal_N;       /* contact forces                  */
    double (*anchor_mm)[2]; /* of the friction springs         */
    struct newton_tangent tangent;
    /* The tangent of a step that is being weighed. A step whose equilibrium is not stable has none
     * (newton.h), and leaves here what it found. */
    struct newton_tangent ahead;
};

/* Zeroed. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code track_step_init(struct track_step *ret, int node_count,
                                                   struct ischia_error *err);
void track_step_finish(struct track_step *step); /* a zeroed one is allowed */

struct track {
    struct body *body;
    struct assembly *assembly;
    struct seat *seat;
    struct newton *newton;
    struct equilibrium *state; /* of the step that is under way */
    struct track_step last;    /* the last converged step       */
    double height_mm;          /* of the tissue, unloaded       */
    int nodes;
};

/* Zeroed but for height and nodes; the others stay the caller's and must outlive it.
 * ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code track_init(struct track *ret, struct body *body,
                                              struct assembly *assembly, struct seat *seat,
                                              struct equilibrium *state, struct ischia_error *err);
void track_finish(struct track *track); /* a zeroed one is allowed */

/* The state of rest as the last step: no force, but a tangent. */
ISCHIA_MUST_CHECK enum ischia_code track_start(struct track *track, struct ischia_error *err);

/* Moves the state to last + dd * tangent, as far as det F stays positive. */
void track_predict(struct track *track, double dd_mm);

/* True when det F > 0 everywhere in the state. */
bool track_is_uninverted(const struct track *track);

/* The state goes back to the last converged step, the tangent's volumes included. */
void track_restore(struct track *track);

/*
 * Ends a converged step on the seat, and finds its energies. drag_Nmm: the step's work against
 * drag. track_weigh finds the tangent too, which is for the next step, and the work of the seat as
 * the integral of F dd by the corrected trapezium (Hermite cubic) rule, which uses the stiffness at
 * both ends and is of fourth order; track_weigh_slow by the trapezium rule, without a tangent.
 */
ISCHIA_MUST_CHECK enum ischia_code track_weigh(struct track *track, double drag_Nmm,
                                               struct track_point *ret, struct ischia_error *err);
void track_weigh_slow(struct track *track, double drag_Nmm, struct track_point *ret);

/* The last step, to go back to when the track has gone on: *ret is an initialised step. */
void track_remember(const struct track *track, struct track_step *ret);
/* The step is the last one again, and the state with it. */
void track_recall(struct track *track, const struct track_step *step);

/* Goes on from a weighed step: it is the last one now; its tangent with it, or the old one kept. */
void track_book(struct track *track, const struct track_point *now);
void track_book_slow(struct track *track, const struct track_point *now);

/* Work between two steps that is not stored, nor dissipated by friction, nor done against drag. */
double track_lost_Nmm(const struct track_point *from, const struct track_point *to);

/* What an error in force (quarter model), or in work, is compared with where there is `now`: with
 * that, or with a small one of its kind while there is hardly any. */
double track_force_scale_N(double now_N);
double track_work_scale_Nmm(const struct track *track, double now_Nmm);

#endif
