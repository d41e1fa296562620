/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_LEAST_SQUARES_H
#define ISCHIA_SOLVER_STUDY_LEAST_SQUARES_H

#include <stddef.h>

#include "solver/error.h"

/* Ordinary least squares: the beta that minimises |A beta - y|, and what is known of its errors. */

struct least_squares {
    size_t n, k;            /* rows and columns of A                                            */
    double *beta;           /* [k]                                                              */
    double *se;             /* [k] standard errors, s^2 = RSS / (n - k); NaN when n == k         */
    double *residual;       /* [n] y - A beta                                                   */
    double mean_square;     /* RSS / n: the paper's mean squared residuals                      */
    double r2;              /* 1 - RSS / sum (y - mean y)^2; NaN for constant y                 */
    double r2_adjusted;     /* with n - k and n - 1 degrees of freedom; NaN also when n == k     */
    double loo_mean_square; /* leave-one-out (PRESS / n), from the leverages; NaN when one is 1 */
    double rcond;           /* reciprocal 1-norm condition number of R                          */
};

/*
 * A: [n][k] column by column (A[j * n + i] is row i, column j), y: [n]; both are left as they are.
 * ISCHIA_E_INPUT when n < k or the columns are linearly dependent (rcond < 1e-12: the design does
 * not identify the terms); ISCHIA_E_LIMIT: A has more than INT_MAX entries; ISCHIA_E_MEMORY,
 * ISCHIA_E_NUMERIC. *ret is untouched on error.
 */
ISCHIA_MUST_CHECK enum ischia_code least_squares_init(struct least_squares *ret, const double *A,
                                                      const double *y, size_t n, size_t k,
                                                      struct ischia_error *err);
void least_squares_finish(struct least_squares *fit); /* a zeroed one is allowed */

#endif
