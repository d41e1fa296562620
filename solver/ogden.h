/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_OGDEN_H
#define ISCHIA_SOLVER_OGDEN_H

/*
 * One-term Ogden law with alpha = 5, isochoric part, in principal stretches:
 *
 *     W(s1, s2, s3) = 2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3),  l_i = J^(-1/3) s_i,
 *
 * the convention in which mu is the initial shear modulus (Abaqus, CalculiX; codes that write
 * mu / alpha are 2.5 times stiffer for the same number). The volumetric part is element.h's.
 */

enum { OGDEN_ALPHA = 5 };

/*
 * Derivatives of a function of the principal stretches, as the tangent needs them: with F = U S V^T
 * and dF seen in the frames U and V, the second derivative splits into
 *   normal[i][j]   d2W/ds_i ds_j                            for the diagonal of dF,
 *   even[k]        (g_i - g_j) / (s_i - s_j),               for (dF_ij + dF_ji) / sqrt 2,
 *   odd[k]         (g_i + g_j) / (s_i + s_j),               for (dF_ij - dF_ji) / sqrt 2,
 * where k is the index that is neither i nor j, and g_i = dW/ds_i. alpha = 5 being a whole number,
 * the quotients are polynomials and need no special case for equal stretches.
 */
struct ogden_derivatives {
    double gradient[3];  /* MPa */
    double normal[3][3]; /* MPa */
    double even[3];      /* MPa */
    double odd[3];       /* MPa */
};

/* Isochoric energy density in MPa (N mm / mm3). stretch: all > 0. */
double ogden_energy(double mu_MPa, const double stretch[3]);

/*
 * Derivatives of ogden_energy(mu) + pressure * J at the given stretches: the second term is a
 * volumetric law whose first derivative with respect to J is `pressure_MPa`, held constant.
 */
void ogden_derivatives(double mu_MPa, double pressure_MPa, const double stretch[3],
                       struct ogden_derivatives *ret);

#endif
