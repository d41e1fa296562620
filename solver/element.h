/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_ELEMENT_H
#define ISCHIA_SOLVER_ELEMENT_H

/*
 * The 8-node hexahedron with mean dilatation (Q1/P0, the pressure condensed out):
 *
 *   E(u) = sum_g w_g W(F_g) + V (kappa - kappa_s - kappa_c) / 2 (v / V - 1)^2
 *          + sum_g w_g kappa_s / 2 (J_g - 1)^2
 *          + sum_c V_c / 8 kappa_c / 2 (J_c + 1 / J_c - 2)
 *
 * with V the unloaded and v the deformed volume, W the isochoric Ogden energy, and V_c the volume
 * of the parallelepiped of the three edges that meet in corner c, J_c what it has become of it. The
 * third term is the point-wise share of the volumetric energy: without it nothing keeps J_g from
 * scattering inside an element. The fourth keeps the corners from collapsing: det F can be positive
 * at all points while an edge shrinks to nothing, and then elements under the bone's tip let it
 * sink through to the seat, and those at the bonded rim snap from fold to fold. Where tissue keeps
 * its volume both vanish. Their effect on eps_max is measured in docs/VERIFICATION.md.
 */

enum { HEX_NODES = 8, HEX_POINTS = 8, HEX_DOFS = 24 };

struct element_material {
    double mu_MPa;
    double kappa_MPa;        /* bulk modulus                                  */
    double kappa_point_MPa;  /* kappa_s above: its share at the points        */
    double kappa_corner_MPa; /* kappa_c above: resists the collapse of corners */
};

/* Gradients of the shape functions by X, [component][node], and weights det(dX/dxi). */
struct element_reference {
    double dN[HEX_POINTS][3][HEX_NODES]; /* 1/mm */
    double weight[HEX_POINTS];           /* mm3  */
    double volume;                       /* mm3  */
    double X_mm[HEX_NODES][3];
    double corner_volume[HEX_NODES]; /* of the edges that meet there, mm3 */
};

/* Fills ret from the unloaded corner positions in mm (VTK order). */
void element_reference_init(struct element_reference *ret, const double X_mm[HEX_NODES][3]);

/* Smallest det F over the points and J_c over the corners of the element under displacements u. */
double element_det_F_min(const struct element_reference *ref, const double u_mm[HEX_NODES][3]);

/* Derivatives of one element's energy. Rows and columns of the stiffness: component * 8 + node. */
struct element_derivatives {
    double force[3][HEX_NODES];           /* gradient, N                        */
    double stiffness[HEX_DOFS][HEX_DOFS]; /* Hessian, N/mm, both triangles      */
    double volume_gradient[3][HEX_NODES]; /* dv/du, mm2                         */
    double pressure_MPa;                  /* (kappa - kappa_s - kappa_c) (v / V - 1) */
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
 * undefined. ret NULL: the energy alone. tangent NULL: ret->force alone.
 */
double element_energy(const struct element_reference *ref, const struct element_material *material,
                      const double u_mm[HEX_NODES][3], const struct element_tangent *tangent,
                      struct element_derivatives *ret);

#endif
