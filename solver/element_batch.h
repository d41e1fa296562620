/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_ELEMENT_BATCH_H
#define ISCHIA_SOLVER_ELEMENT_BATCH_H

#include <stdbool.h>

#include "solver/element.h"

/*
 * Eight elements side by side, so that one vector instruction serves several of them: every array
 * ends in [BATCH], the lane of the element. Lanes do not see each other: a lane's results have the
 * same bits in every lane and with every kernel. What is passed must be aligned to BATCH doubles.
 */

enum { BATCH = 8, HEX_ENTRIES = HEX_DOFS * (HEX_DOFS + 1) / 2 };
/* The points of the rule by kind: the Gauss points come first. */
enum point_kind { POINT_GAUSS, POINT_CORNER, POINT_KINDS };

#define BATCH_ALIGNED _Alignas(64)

/* Reference and material of the elements; units as in element.h. */
struct element_batch {
    BATCH_ALIGNED double dN[HEX_RULE_POINTS][3][HEX_NODES][BATCH];
    double weight[HEX_RULE_POINTS][BATCH];
    double volume[BATCH];
    double kappa_mean_MPa[BATCH]; /* kappa - kappa_s */
    /* What the point rule takes of the law at a point of either kind. */
    double mu_MPa[POINT_KINDS][BATCH];          /* its share of mu              */
    double kappa_point_MPa[POINT_KINDS][BATCH]; /* kappa_s; none at the corners */
};

struct element_batch_u {
    BATCH_ALIGNED double mm[HEX_NODES][3][BATCH];
};

/* Puts an element into a lane. */
void element_batch_set(struct element_batch *batch, int lane, const struct element_reference *ref,
                       const struct element_material *material);

struct element_batch_volume {
    BATCH_ALIGNED double pressure_MPa[BATCH]; /* kappa_mean (v / V - 1) */
    double det_F_min[BATCH];
};

struct element_batch_derivatives {
    BATCH_ALIGNED double force[3][HEX_NODES][BATCH]; /* gradient, N                            */
    double stiffness[HEX_ENTRIES][BATCH]; /* Hessian, N/mm: lower triangle, row by row          */
    double volume_gradient[3][HEX_NODES][BATCH]; /* dv/du, mm2                                 */
    double pressure_MPa[BATCH];                  /* kappa_mean (v / V - 1)                     */
};

/* As element_tangent, a pressure for each lane. */
struct element_batch_tangent {
    BATCH_ALIGNED double pressure_MPa[BATCH];
    double convexity;
};

/*
 * The same arithmetic compiled for one width of vector registers. Energies are in N mm, HUGE_VAL in
 * the lanes where det F <= 0 at a point of the rule; what else *ret holds in those lanes is
 * undefined.
 */
struct element_kernel {
    const char *name;
    void (*volume)(const struct element_batch *batch, const struct element_batch_u *u,
                   struct element_batch_volume *ret);
    void (*energy)(const struct element_batch *batch, const struct element_batch_u *u,
                   double ret_energy_Nmm[BATCH]);
    void (*linearise)(const struct element_batch *batch, const struct element_batch_u *u,
                      const struct element_batch_tangent *tangent,
                      struct element_batch_derivatives *ret, double ret_energy_Nmm[BATCH]);
};

extern const struct element_kernel element_kernel_base; /* SSE2 or NEON */
extern const struct element_kernel element_kernel_avx2, element_kernel_avx512;

/* The index-th kernel that this processor runs, the widest first; NULL: there is none. */
const struct element_kernel *element_kernel(int index);

#endif
