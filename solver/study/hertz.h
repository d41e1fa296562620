/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_HERTZ_H
#define ISCHIA_SOLVER_STUDY_HERTZ_H

#include <stdbool.h>

#include "solver/case.h"

/*
 * The analytic baseline: small-strain Hertz contact of the bone, as a rigid ellipsoid, with one
 * elastic layer. A yardstick for what a formula can say, NOT an alternative to the solver: buttock
 * tissue is compressed far outside its range, and `valid` says so case by case.
 */
struct hertz_baseline {
    double indentation_mm;
    double contact_a_mm, contact_b_mm; /* half axes of the contact ellipse, a >= b               */
    double peak_pressure_kPa;          /* Hertz' p0, between bone and muscle                     */
    double eps_max;                    /* ENGINEERING (here: linear) max shear strain, muscle    */
    double eps_max_depth_mm;           /* below the bone tip                                     */
    bool valid; /* indentation <= 0.1 (eM + eF), a <= (eM + eF) / 2 and eps_max <= 0.1           */
};

/* c is valid (ischia_case_is_valid, asserted). Friction, skin and bulk_ratio do not enter. */
struct hertz_baseline hertz_baseline_of(const struct ischia_case *c);

/* Largest principal stress difference on the axis under an elliptical Hertz contact over p0, for an
 * incompressible half-space; q = b / a in (0, 1]. *ret_depth: where, over b. */
double hertz_axis_shear(double q, double *ret_depth);

#endif
