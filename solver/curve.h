/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_CURVE_H
#define ISCHIA_SOLVER_CURVE_H

#include "solver/result.h"

/* Load curves: what grows with the force, point by point from rest (which is not among the points),
 * forces rising. Between points, and from rest, everything is linear in the force. */
struct load_curve {
    struct ischia_load_point point[ISCHIA_LOAD_POINTS_MAX];
    int count;
};

/* Appends a point; one that does not fit, or does not rise above the last, is left out. */
void load_curve_add(struct load_curve *curve, const struct ischia_load_point *point);

/* At a force; the last point beyond it. */
struct ischia_load_point load_curve_at(const struct load_curve *curve, double F_N);

#endif
