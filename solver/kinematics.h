/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_KINEMATICS_H
#define ISCHIA_SOLVER_KINEMATICS_H

#include "solver/mesh.h"

/*
 * The 8-node hexahedron as post-processing sees it: plain functions of one element at a time,
 * written to be read. (Assembly has batch code of its own, held against this one by a test.)
 *
 * The integration points are the 2 x 2 x 2 Gauss points; point q lies in the octant of corner q, so
 * corners, points and the eight cells that an element is divided into share one numbering.
 */

enum { HEX_CORNERS = 8, HEX_CELLS = 8 };

/* Positions or displacements of one element's corners, mm. */
struct hex_corners {
    double at[HEX_CORNERS][3];
};

/* One integration point, unloaded. */
struct hex_point {
    double gradient[HEX_CORNERS][3]; /* dN/dX of each corner, 1/mm                          */
    double volume_mm3;               /* weight x det(dX/dxi); the eight sum to the element's
                                        exact volume; negative where the element is inverted */
    double X_mm[3];                  /* where it lies                                       */
};

/* Corners of an element from an array of nodal 3-vectors: values[node_count][3], flat. */
struct hex_corners hex_gather(const int nodes[HEX_CORNERS], const double *values);

/* X must not be degenerate at the point (its Jacobian is divided by). */
struct hex_point hex_point_at(const struct hex_corners *X, int point);

/* F = I + du/dX at a point; F[i][j] = dx_i/dX_j. */
void deformation_gradient(const struct hex_point *point, const struct hex_corners *u,
                          double ret_F[3][3]);

/*
 * The principal stretches: singular values of F, largest first, to nearly full relative accuracy
 * even when they differ by many orders of magnitude. Zero or negative det F is allowed: stretches
 * are never negative.
 */
void principal_stretches(double F[3][3], double ret_stretch[3]);

#endif
