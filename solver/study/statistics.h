/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_STATISTICS_H
#define ISCHIA_SOLVER_STUDY_STATISTICS_H

#include <stddef.h>

#include "solver/error.h"

/*
 * How two readings of the same things agree. Every number is dimensionless or in the unit of the
 * readings (squared, for mean squares); NaN where the data do not define it (a constant reading
 * has no correlation).
 */

struct statistics_interval {
    double low, high;
};

struct statistics_summary {
    double mean;
    double sd; /* n - 1 */
    double min, max;
};

struct statistics_pair {
    size_t n;
    struct statistics_summary a, b;
    double pearson_r;
    double pearson_p;                      /* two-sided, Student's t with n - 2               */
    struct statistics_interval pearson_ci; /* 95 %, Fisher's z; NaN for n < 4                 */
    double spearman_rho;                   /* ties get their mean rank                        */
    double spearman_p;                     /* two-sided, by the same t                        */
    double mean_square;                    /* mean of (b - a)^2                               */
    double slope, intercept;               /* least-squares b = intercept + slope a           */
    double corrected_mean_square;          /* mean squared residual of that line, over n      */
    double constant_mean_square;           /* mean of (b - mean b)^2, over n                  */
    double bias;                           /* Bland-Altman: mean of b - a                     */
    double bias_sd;                        /* sd of b - a, n - 1                              */
    struct statistics_interval bias_ci;    /* 95 % of the bias, t with n - 1                  */
    struct statistics_interval limits;     /* limits of agreement: bias -+ 1.96 sd            */
    double limits_half_ci; /* half width of the 95 % interval of each limit: t sd sqrt(3/n) */
};

/* n finite pairs. ISCHIA_E_INPUT for n < 3 or a value that is not finite; ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code statistics_compare(const double *a, const double *b, size_t n,
                                                      struct statistics_pair *ret,
                                                      struct ischia_error *err);

#endif
