/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_EIGEN3_H
#define ISCHIA_SOLVER_EIGEN3_H

/*
 * Eigenvalues and orthonormal eigenvectors of a symmetric 3 x 3 matrix by cyclic Jacobi rotations
 * (Golub and Van Loan, section 8.5): A = sum_k value[k] v_k v_k^T with v_k[i] = vector[i][k].
 * Accurate for equal and nearly equal eigenvalues. The values come in no particular order; the
 * same A gives the same bits.
 */
void eigen3(const double A[3][3], double ret_value[3], double ret_vector[3][3]);

#endif
