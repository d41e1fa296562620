/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_ELEMENT_H
#define ISCHIA_SOLVER_ELEMENT_H

/*
 * The 8-node hexahedron with mean dilatation (Q1/P0, the pressure condensed out):
 *
 *   E(u) = (1 - c) sum_g w_g W(F_g) + c sum_k V_k / 8 W(F_k) + sum_g w_g kappa_s / 2 (J_g - 1)^2
 *          + V (kappa - kappa_s) / 2 (v / V - 1)^2
 *
 * over the 2 x 2 x 2 Gauss points g and the corners k, with V the unloaded and v the deformed
 * volume, W the isochoric Ogden energy, and V_k the volume of the parallelepiped of the three edges
 * that meet in corner k (weights and gradients of corners are corrected on distorted elements,
 * element.c). Gauss points alone (c = 0) do not see what happens at the corners: in
 * strongly sheared tissue neighbouring nodes then zigzag and edges shrink to nothing at hardly any
 * cost. Any share c is a rule of the same order for W, and one that does see it. kappa_s is a
 * point-wise share of the volumetric energy; kappa_s = kappa is the element without mean
 * dilatation. docs/decisions/0018-corners-in-the-quadrature.md.
 */

/* Points of the rule for W: the Gauss points first, then the corners, in VTK order both. */
enum { HEX_NODES = 8, HEX_POINTS = 8, HEX_RULE_POINTS = HEX_POINTS + HEX_NODES, HEX_DOFS = 24 };

struct element_material {
    double mu_MPa;
    double kappa_MPa;       /* bulk modulus                              */
    double kappa_point_MPa; /* kappa_s above                             */
    double corner_share;    /* c above, in [0, 1]: the corners' weight   */
};

/* Gradients of the shape functions by X, [component][node], and weights det(dX/dxi). */
struct element_reference {
    double dN[HEX_RULE_POINTS][3][HEX_NODES]; /* 1/mm                                            */
    double
        weight[HEX_RULE_POINTS]; /* mm3; of the Gauss points, and of the corners: V_k / 8        */
    double volume;               /* mm3; by the Gauss points, which is exact                     */
};

/* Fills ret from the unloaded corner positions in mm (VTK order). */
void element_reference_init(struct element_reference *ret, const double X_mm[HEX_NODES][3]);

/* Smallest det F over the points of the rule, corners included, under displacements u. */
double element_det_F_min(const struct element_reference *ref, const double u_mm[HEX_NODES][3]);

/* Derivatives of one element's energy. Rows and columns of the stiffness: component * 8 + node. */
struct element_derivatives {
    double force[3][HEX_NODES];           /* gradient, N                        */
    double stiffness[HEX_DOFS][HEX_DOFS]; /* Hessian, N/mm, both triangles      */
    double volume_gradient[3][HEX_NODES]; /* dv/du, mm2                         */
    double pressure_MPa;                  /* (kappa - kappa_s) (v / V - 1) */
};

/*
 * How the stiffness is taken. pressure_MPa multiplies the second derivative of v: the true one,
 * element_derivatives.pressure_MPa, gives the exact Hessian. Far from equilibrium a pressure that
 * was carried along linearly is much the better choice, for kappa (v / V - 1) is then huge and
 * meaningless (the reason why mixed displacement-pressure iterations converge faster; Garcea and
 * others 1998). convexity in [0, 1] blends from that Hessian to one whose points are positive
 * semi-definite.
 */
struct element_tangent {
    double pressure_MPa;
    double convexity;
};

/*
 * Strain energy in N mm; HUGE_VAL when det F <= 0 at a point or a corner, and then *ret is
 * undefined. ret NULL: the energy alone. tangent NULL: ret->force and ret->pressure_MPa alone.
 */
double element_energy(const struct element_reference *ref, const struct element_material *material,
                      const double u_mm[HEX_NODES][3], const struct element_tangent *tangent,
                      struct element_derivatives *ret);

#endif
