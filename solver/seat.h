/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_SEAT_H
#define ISCHIA_SOLVER_SEAT_H

#include <stdbool.h>

#include "solver/assembly.h"

/*
 * The rigid seat z = 0: unilateral contact, node by node and exact (z >= 0, no penalty), and
 * Coulomb friction.
 *
 * Contact is a bound on the nodes' z; the contact force N of a node on the bound is the gradient
 * of the energy there. Friction acts on a node through a spring of stiffness k from an anchor on
 * the seat that slips when the spring's force would exceed mu N. With N held fixed ("lagged") this
 * derives from a convex potential of the tangential distance r from the anchor,
 *
 *     phi(r) = k r^2 / 2                      while k r <= mu N,
 *              mu N r - (mu N)^2 / (2 k)      beyond,
 *
 * which makes a load step a minimisation. The anchor moves only between load steps.
 */

struct seat {
    double friction;              /* Coulomb's coefficient                                       */
    double *stick_stiffness_N_mm; /* [node] k above, by the area that belongs to the node        */
    double (*anchor_mm)[2];       /* [node] where the spring is fixed: displacement, x and y     */
    double *normal_N;             /* [node] N, tracked or lagged; zero where the node is free    */
    int node_count;
};

/* Nothing pressed, anchors where the unloaded nodes are. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code seat_init(struct seat *ret, const struct mesh *mesh,
                                             double friction, struct ischia_error *err);
void seat_finish(struct seat *seat);

/* Height of node n above the seat. */
static inline double seat_gap_mm(const struct mesh *mesh, const double (*u_mm)[3], int n)
{
    return mesh->X_mm[n][2] + u_mm[n][2];
}

/* Puts node n, which may touch, on the seat when it is below it, or above it by no more than
 * rounding. */
void seat_stop(const struct mesh *mesh, int n, double u_mm[3]);

/* True when node n lies on the seat and is pressed against it by the energy's gradient there. */
bool seat_binds(const struct mesh *mesh, const double (*u_mm)[3], const double (*force_N)[3],
                int n);

/* Sum of phi over the nodes with the lagged normal forces, N mm. */
double seat_energy(const struct seat *seat, const double (*u_mm)[3]);

/* Adds the friction forces for the given normal forces [node] to force_N[node]. */
void seat_add_force(const struct seat *seat, const double *normal_N, const double (*u_mm)[3],
                    double (*force_N)[3]);

/* Hessian of phi with respect to the stretch from the anchor, N/mm: of a spring of stiffness k
 * that sticks, or of one that slips at limit_N = mu N. */
void seat_spring_hessian(double stick_N_mm, double limit_N, bool slips, const double stretch_mm[2],
                         double ret[2][2]);

/* Hessian of seat_energy with respect to x and y of one node that presses on the seat, N/mm. */
void seat_hessian(const struct seat *seat, const double (*u_mm)[3], int node, double ret[2][2]);

/* Adds the Hessian of seat_energy to the values of assembly->linear, but for the nodes that rest on
 * the seat, whose friction is contact.h's. */
void seat_add_stiffness(const struct seat *seat, const struct assembly *assembly,
                        const double (*u_mm)[3]);

/*
 * Ends a load step: anchors of slipping nodes follow, those of nodes off the seat move along.
 * Returns the energy dissipated by the slip, N mm: mu times slip times the mean of the contact
 * forces before (normal_before_N[node]) and after the step, which is of second order in the step.
 */
double seat_advance(struct seat *seat, const double (*u_mm)[3], const double *normal_before_N);

#endif
