/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_SPECIAL_H
#define ISCHIA_SOLVER_STUDY_SPECIAL_H

/*
 * The special functions behind p-values and confidence intervals. All are pure, never fail for
 * arguments in their domain (asserted), and agree with SciPy to 1e-11 relative over the values in
 * tests/unit/data/special.csv.
 */

/* Regularised incomplete beta function I_x(a, b); a, b > 0, 0 <= x <= 1. */
double special_incomplete_beta(double a, double b, double x);

/* P(|T| >= |t|) for Student's t with `freedom` > 0 degrees of freedom; t may be infinite. */
double special_t_two_sided(double t, double freedom);

/* The t with P(T <= t) = probability; 0 < probability < 1, freedom > 0. */
double special_t_quantile(double probability, double freedom);

/* The z with P(Z <= z) = probability for a standard normal Z; 0 < probability < 1. */
double special_normal_quantile(double probability);

#endif
