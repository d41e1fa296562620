/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_AXIS_H
#define ISCHIA_SOLVER_AXIS_H

#include "solver/mesh.h"

/*
 * The paper's quantity of interest: the largest ENGINEERING principal shear in muscle on the
 * symmetry axis x = y = 0.
 *
 * On the axis F is diagonal by symmetry. It is read in two ways, whose errors have opposite signs:
 * "raw", the mean F of the elements beside the axis, which cuts the peak off; and "recovered",
 * lambda_x and lambda_y from odd cubics a X + b X^3 through the first two nodes off the axis, and
 * lambda_z from J = 1. Half of what lies between them is an error estimate that costs nothing.
 */
struct axis_strain {
    double recovered; /* largest value at a node of the axis                */
    double raw;       /* largest mean of an element                         */
    double depth_mm;  /* of the recovered maximum, below the tip, unloaded  */
};

struct axis_strain axis_strain_of(const struct mesh *mesh, const double (*u_mm)[3]);

#endif
