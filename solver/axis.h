/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_AXIS_H
#define ISCHIA_SOLVER_AXIS_H

#include "solver/mesh.h"

/*
 * The paper's quantity of interest: the largest ENGINEERING principal shear in muscle on the
 * symmetry axis x = y = 0.
 *
 * On the axis F is diagonal by symmetry. It is read in two ways. "Recovered" is the better one:
 * lambda_x and lambda_y from odd cubics a X + b X^3 through the first two nodes off the axis, and
 * lambda_z from J = 1. "Raw" is the mean F of the elements beside the axis, which cuts the peak
 * off, and at the muscle's end the line through the last two of them, for where fat is softer than
 * muscle a layer of some 2 mm there can hold the maximum. What lies between the two falls with the
 * mesh and measures the error (docs/decisions/0019-one-graded-mesh.md).
 */
struct axis_strain {
    double recovered; /* largest value at a node of the axis                */
    double raw;       /* largest mean of an element, or at the muscle's end */
    double depth_mm;  /* of the recovered maximum, below the tip, unloaded  */
};

struct axis_strain axis_strain_of(const struct mesh *mesh, const double (*u_mm)[3]);

#endif
