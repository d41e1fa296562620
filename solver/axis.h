/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_AXIS_H
#define ISCHIA_SOLVER_AXIS_H

#include "solver/mesh.h"

/*
 * The paper's quantity of interest: the largest ENGINEERING principal shear in muscle on the
 * symmetry axis x = y = 0.
 *
 * On the axis F is diagonal by symmetry. It is read in two ways. "Recovered": lambda_x and lambda_y
 * from odd cubics a X + b X^3 through the first two nodes off the axis, and lambda_z from J = 1.
 * "Raw": the mean F of the elements beside the axis, which cuts the peak off, and at the muscle's
 * end the line through the last two of them, for where fat is softer than muscle a layer of some
 * 2 mm there can hold the maximum.
 *
 * Both converge to the same value. On meshes like `standard` both are mostly below it, the raw one
 * by some two to four times as much; so eps_max is read beyond the recovered value, by half of what
 * lies between the two. That falls with the mesh, and measures the error (docs/decisions, 19).
 */
struct axis_strain {
    double recovered; /* largest value at a node of the axis                  */
    double raw;       /* largest mean of an element, or at the muscle's end   */
    double eps_max;   /* from the two                                         */
    double depth_mm;  /* of the recovered maximum, below the tip, unloaded    */
};

struct axis_strain axis_strain_of(const struct mesh *mesh, const double (*u_mm)[3]);

#endif
