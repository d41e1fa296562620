/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_CONTACT_H
#define ISCHIA_SOLVER_CONTACT_H

#include "solver/assembly.h"
#include "solver/seat.h"

/*
 * Contact with friction within one linear model of the body: all equations but those of the nodes
 * that rest on the seat are eliminated (linear.h), and what is left is small enough to be solved
 * anew for each guess of which nodes press on the seat, until the guess proves right. With du the
 * displacements of these nodes, dd the approach of bone and seat,
 *
 *     f = S du + border dd - load        forces that the body takes from the seat,
 *     f_z >= 0, gap + du_z >= 0, f_z (gap + du_z) = 0,
 *     f_xy = -friction, linear about the present state: what sticks or slips does so on, and what
 *                       lands sticks.
 */

/* The linear model, with arrays of `rows` numbers: one for each equation of a node that rests. */
struct contact_model {
    double *stiffness;     /* [rows][rows] S, N/mm                                               */
    double *load;          /* N                                                                  */
    double *border;        /* N/mm                                                               */
    double corner;         /* N/mm: border . du + corner dd = d_load, the row of d               */
    double d_load;         /* N                                                                  */
    bool force_controlled; /* else dd = 0                                                        */
};

/* How the friction limits mu N are taken. */
enum contact_friction {
    CONTACT_COULOMB, /* N is what the model gives                                                */
    CONTACT_LAGGED   /* N is the seat's: the solution is a minimum                               */
};

struct contact;

/* Work space for the nodes of the assembly that rest on the seat. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code contact_create(struct contact **ret, const struct mesh *mesh,
                                                  const struct assembly *assembly,
                                                  struct ischia_error *err);
void contact_destroy(struct contact *contact); /* NULL allowed */

/* To be filled before each call below; the contact's own. */
struct contact_model *contact_model_of(struct contact *contact);

/* True when the model, with the nodes pressed and slipping as the last solution says, has a minimum
 * there: its tangent, friction limits held, is positive definite. */
bool contact_is_stable(struct contact *contact, const struct seat *seat);

/*
 * Solves from the state u with the seat's contact forces as the first guess. ret_du[rows]; *ret_dd;
 * ret_normal_N[node] is set for the nodes that rest. Returns false when there is no solution; true
 * also when the guesses go round, with the last of a dozen: the next Newton step starts from it.
 */
bool contact_solve(struct contact *contact, const struct seat *seat, const double (*u_mm)[3],
                   enum contact_friction friction, double *ret_du, double *ret_dd,
                   double *ret_normal_N);

/*
 * Rates of an equilibrium u: which nodes press and slip is held. The model's load is that of the
 * rate (with d: minus the border), the model without force control. ret_du[rows], mm/mm;
 * ret_normal_rate[node], N/mm. False when there is none.
 */
bool contact_rate(struct contact *contact, const struct seat *seat, const double (*u_mm)[3],
                  double *ret_du, double *ret_normal_rate);

#endif
