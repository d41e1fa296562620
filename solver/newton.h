/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_NEWTON_H
#define ISCHIA_SOLVER_NEWTON_H

#include "solver/body.h"
#include "solver/result.h"
#include "solver/seat.h"
#include "solver/solver.h"

/*
 * One load step: the minimum over u and, under force control, the approach d, of
 *
 *     elastic energy(u, d) + friction potential(u; N) - force * d     subject to gap(u) >= 0,
 *
 * by Newton steps that solve the linear model's contact and friction exactly (contact.h). N is the
 * contact force of the present iterate.
 */

struct equilibrium { /* the state of a body on its seat */
    double (*u_mm)[3];
    double d_mm;    /* approach of bone and seat                        */
    double force_N; /* reaction on the bone, of the quarter model       */
    double elastic_Nmm;
};

/* Springs between every free node and where it was: a step in time against drag (snap.h). */
struct newton_drag {
    const double *spring_N_mm;  /* [node] */
    const double (*from_mm)[3]; /* [node] */
};

struct newton_control {
    bool force_controlled;
    double force_N;   /* quarter model's: the target, and the scale of the residual */
    double tolerance; /* |residual| / force_N                                       */
    int iterations_max;
    const struct newton_drag *drag; /* NULL: none; else its energy counts in the minimum */
};

struct newton_report {
    enum ischia_reason reason;
    int iterations;
    int factorisations;
    double residual; /* relative */
};

struct newton; /* work space for one body: directions, gradients, masks */

/* Work space for these; they stay the caller's and must outlive it. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code newton_create(struct newton **ret, struct body *body,
                                                 struct assembly *assembly, struct seat *seat,
                                                 struct ischia_error *err);
void newton_destroy(struct newton *newton); /* NULL allowed */

/* Called after each iteration; false cancels. */
typedef bool newton_observe(void *context, const struct newton_report *report, double force_N);

/* Minimises from *state in place. state->d_mm is kept under displacement control. */
ISCHIA_MUST_CHECK enum ischia_code
newton_minimise(struct newton *newton, struct equilibrium *state,
                const struct newton_control *control, newton_observe *observe, void *context,
                struct newton_report *ret_report, struct ischia_error *err);

/* Prepares for newton_tangent at a state that was not just minimised: at rest, or gone back to. */
void newton_linearise(struct newton *newton, const struct equilibrium *state);

struct newton_tangent {       /* of the equilibrium with respect to d                        */
    double stiffness_N_mm;    /* dF/dd; 0 where the equilibrium is not stable: no direction  */
    double (*direction)[3];   /* [node] du/dd; the caller's array                            */
    double *normal_rate_N_mm; /* [node] change of the contact forces; the caller's array     */
};

/*
 * The tangent of the state that the last minimisation or linearisation left. After a minimisation
 * it is taken from the factor of its last exact step, which is that step's own length away: the
 * error is of the order of the step. Else the tangent is factored anew.
 */
ISCHIA_MUST_CHECK enum ischia_code
newton_tangent(struct newton *newton, const struct equilibrium *state, struct newton_tangent *ret,
               struct ischia_error *err);

#endif
