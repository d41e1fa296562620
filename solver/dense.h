/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_DENSE_H
#define ISCHIA_SOLVER_DENSE_H

#include <stdbool.h>

/* Small dense matrices, [column][row], by BLAS and LAPACK. Nothing is allocated. */

/* ret = L L' for the lower triangle L[n][n] (above it anything). Both triangles of ret are set. */
void dense_square_of_lower(int n, const double *L, double *ret);

/* x = L x, or L' x, for the lower triangle L[n][n]. */
void dense_multiply_lower(int n, const double *L, bool transposed, double *x);

/* ret = A x. */
void dense_multiply(int n, const double *A, const double *x, double *ret);

/* True when the symmetric A[n][n] is positive definite. Overwrites its lower triangle, and needs
 * no other. */
bool dense_is_definite(int n, double *A);

/* Solves A x = b in place of b; overwrites A. pivot: [n] scratch. False when A is singular, or the
 * solution is not finite; b is undefined then. */
bool dense_solve(int n, double *A, int *pivot, double *b);

#endif
