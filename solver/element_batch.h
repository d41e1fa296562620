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

#define BATCH_ALIGNED _Alignas(64)

/* Reference and material of the elements; units as in element.h. */
struct element_batch {
    BATCH_ALIGNED double dN[HEX_POINTS][3][HEX_NODES][BATCH];
    double weight[HEX_POINTS][BATCH];
    double volume[BATCH];
    double mu_MPa[BATCH];
    double kappa_mean_MPa[BATCH]; /* kappa - kappa_s - kappa_c */
    double kappa_point_MPa[BATCH];
    double kappa_corner_MPa[BATCH];
    double X_mm[HEX_NODES][3][BATCH];
    double corner_volume[HEX_NODES][BATCH];
};

struct element_batch_u {
    BATCH_ALIGNED double mm[HEX_NODES][3][BATCH];
};

/* The nodes at the other ends of the edges that meet in a corner, right-handed. */
extern const int element_edges[HEX_NODES][3];

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
 * the lanes where det F <= 0 at a point or a corner; what else *ret holds in those lanes is
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
