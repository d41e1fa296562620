/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_LINEAR_H
#define ISCHIA_SOLVER_LINEAR_H

#include <stdbool.h>

#include "solver/error.h"

/*
 * Sparse symmetric positive definite systems A x = b by supernodal Cholesky (CHOLMOD): analysed
 * once for a pattern, factored for many values. The lower triangle is stored by columns, rows
 * ascending, the diagonal always present.
 */

struct linear;

enum linear_outcome {
    LINEAR_FACTORED,
    LINEAR_NOT_POSITIVE_DEFINITE /* a pivot was not positive, or the factor is not finite */
};

/*
 * An order of the equations in which the factor fills in little (METIS' nested dissection, then
 * postordered): ret_order[k] is the equation that comes k-th. The last `tail` equations stay where
 * they are. The pattern as below.
 */
ISCHIA_MUST_CHECK enum ischia_code linear_order(int n, int tail, const int *start, const int *row,
                                                int *ret_order, struct ischia_error *err);

/*
 * Analyses the pattern, in the order the equations are in (linear_order first: factoring then needs
 * no permutation): n columns; column j holds row[start[j]] ... row[start[j + 1] - 1]. The
 * pattern is copied. *ret is the caller's to destroy.
 *
 * The last `tail` equations are what is left when all others are eliminated:
 *
 *     [A_II A_IT] [x_I]   [b_I]        S = A_TT - A_TI A_II^-1 A_IT,
 *     [A_TI A_TT] [x_T] = [b_T]        S x_T = b_T - A_TI A_II^-1 b_I.
 *
 * The caller solves for x_T, under whatever conditions hold there: contact, friction.
 */
ISCHIA_MUST_CHECK enum ischia_code linear_create(struct linear **ret, int n, int tail,
                                                 const int *start, const int *row,
                                                 struct ischia_error *err);
void linear_destroy(struct linear *linear); /* NULL allowed */

/* The values of the lower triangle, to be written in the order of the pattern before factoring. */
double *linear_values(struct linear *linear);
void linear_clear(struct linear *linear); /* sets them all to zero */

/*
 * Factors the present values, which stay as they are. Equations with keep[i] == 0 are taken out:
 * the solution there is the right-hand side (keep NULL: none is). The values need be positive
 * definite with the tail held by springs as stiff as its own diagonal; A itself need not.
 * ISCHIA_E_MEMORY or ISCHIA_E_NUMERIC only when CHOLMOD cannot work.
 */
ISCHIA_MUST_CHECK enum ischia_code linear_factor(struct linear *linear, const unsigned char *keep,
                                                 enum linear_outcome *ret_outcome,
                                                 struct ischia_error *err);

/* ret[tail][tail] = S of the last factor, symmetric. */
void linear_condensed(const struct linear *linear, double *ret);

/*
 * First half of a solution, for `count` right-hand sides x[count][n], in place: x_T becomes
 * b_T - A_TI A_II^-1 b_I, x_I what linear_expand needs: y with y.y' = b_I A_II^-1 b_I' for any two.
 */
ISCHIA_MUST_CHECK enum ischia_code linear_reduce(struct linear *linear, int count, double *x,
                                                 struct ischia_error *err);

/* Second half, of one: x_I as reduced (or the same combination of several that b is), x_T the
 * solution there; x becomes the whole solution. */
ISCHIA_MUST_CHECK enum ischia_code linear_expand(struct linear *linear, double *x,
                                                 struct ischia_error *err);

/* ret = A x with the present values: all equations, nothing taken out. For checks. */
void linear_multiply(const struct linear *linear, const double *x, double *ret);

/* Cost of one factorisation, from the analysis. */
double linear_flops(const struct linear *linear);
double linear_factor_nonzeros(const struct linear *linear);

#endif
