/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_SAMPLING_H
#define ISCHIA_SOLVER_STUDY_SAMPLING_H

#include <stdbool.h>

#include "solver/case.h"

/*
 * Cases near a measured one: each input is normally distributed about its measured value with the
 * standard deviation `sd` (in its own unit; 0: known exactly), given that it lies within what is
 * accepted and that R2 >= R1. The condition is kept by drawing from the distribution between the
 * limits, so nothing piles up on them.
 */

/* The value at `probability` (0 ... 1) of a normal distribution of mean and sd > 0 between low and
 * high (low <= high; rounding never leaves them). */
double sampling_truncated_normal(double mean, double sd, double low, double high,
                                 double probability);

/* The case at u, a point in [0, 1)^7. sd is as sampling_sd_is_valid asks (asserted). */
struct ischia_case sampling_case(const struct ischia_case *measured,
                                 const double sd[ISCHIA_PARAM_COUNT],
                                 const double u[ISCHIA_PARAM_COUNT]);

/* Finite, not negative, and no wider than the accepted range. */
bool sampling_sd_is_valid(const double sd[ISCHIA_PARAM_COUNT]);

/* The largest standard deviation that is accepted for an input: the width of its range. */
double sampling_sd_max(enum ischia_param input);

/* What measurements are known to scatter by, with the sources in docs/UNCERTAINTY.md: one of the
 * two is not 0, in the input's unit or as a part of the measured value. */
struct sampling_typical {
    double absolute, relative;
};
extern const struct sampling_typical sampling_typical[ISCHIA_PARAM_COUNT];
void sampling_sd_typical(const struct ischia_case *measured, double ret[ISCHIA_PARAM_COUNT]);

#endif
