/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_BODY_H
#define ISCHIA_SOLVER_BODY_H

#include "solver/assembly.h"
#include "solver/element_batch.h"

/* A mesh with its materials: elastic energy, gradient and Hessian of the whole. */

/* What the tracked pressures of a batch are carried on with. */
struct body_volume {
    double gradient[3][HEX_NODES][BATCH]; /* dv/du, mm2                   */
    double pressure_MPa[BATCH];           /* kappa (v / V - 1) back then  */
};

/*
 * Element e is in lane e % BATCH of batch e / BATCH; what is left of the last batch repeats the
 * last element.
 */
struct body {
    const struct mesh *mesh;
    struct element_material material[TISSUE_COUNT]; /* by mesh->tissue                          */
    int batch_count;
    struct element_batch *batch; /* [batch_count]                                               */
    double *pressure_MPa;        /* [batch_count * BATCH] by element: tracked, for the Hessian   */
    struct body_volume *volume;  /* [batch_count] of the last Hessian                            */
};

/* At rest, tracked pressures zero. The mesh must outlive it. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code body_init(struct body *ret, const struct mesh *mesh,
                                             const struct element_material material[TISSUE_COUNT],
                                             struct ischia_error *err);
void body_finish(struct body *body); /* a zeroed one is allowed */

struct body_derivatives {
    double (*force)[3]; /* [node] gradient, N; every node, fixed ones included                   */
    double *border;     /* [n] d2E / du dd, N/mm                                                 */
    double corner;      /* d2E / dd2, N/mm                                                       */
};

/* Elastic energy in N mm at displacements u[node][3]; HUGE_VAL when an element is inverted. */
double body_energy(const struct body *body, const double (*u_mm)[3]);

/*
 * The same with all derivatives; the Hessian goes to the values of assembly->linear, without
 * the bone's d, which goes to border and corner. *ret is undefined when HUGE_VAL is returned.
 */
double body_linearise(struct body *body, const struct assembly *assembly, const double (*u_mm)[3],
                      double convexity, struct body_derivatives *ret);

/*
 * After a move from the last linearised state: carries the tracked pressures on,
 *     p <- alpha p(u) + (1 - alpha) p + kappa / V dv/du . move,
 * alpha being the share of the Newton step that was taken.
 */
void body_track_pressure(struct body *body, double alpha, const double (*from_mm)[3],
                         const double (*to_mm)[3]);

/* Sets the tracked pressures to the true ones at u. */
void body_reset_pressure(struct body *body, const double (*u_mm)[3]);

/* Shear modulus times volume of what belongs to each node, an eighth of every element at it, to
 * ret[node], N mm. */
void body_shear_of_nodes(const struct body *body, double *ret_Nmm);

/* Smallest det F over all points of the rule, corners of elements included. */
double body_det_F_min(const struct body *body, const double (*u_mm)[3]);

#endif
