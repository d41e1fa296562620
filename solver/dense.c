/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The only file that sees cblas.h, and the only one of the mechanics that sees lapacke.h. */
#include "solver/dense.h"

#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

/* Even an empty matrix must have columns of one row. */
static int height(int n) { return n > 1 ? n : 1; }

void dense_square_of_lower(int n, const double *L, double *ret)
{
    const size_t size = (size_t)n;
    for (size_t j = 0; j < size; j++)
        for (size_t i = 0; i < size; i++) ret[j * size + i] = i <= j ? L[i * size + j] : 0; /* L' */
    cblas_dtrmm(CblasColMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, n, n, 1, L,
                height(n), ret, height(n));
}

void dense_multiply_lower(int n, const double *L, bool transposed, double *x)
{
    cblas_dtrmv(CblasColMajor, CblasLower, transposed ? CblasTrans : CblasNoTrans, CblasNonUnit, n,
                L, height(n), x, 1);
}

void dense_multiply(int n, const double *A, const double *x, double *ret)
{
    cblas_dgemv(CblasColMajor, CblasNoTrans, n, n, 1, A, height(n), x, 1, 0, ret, 1);
}

bool dense_is_definite(int n, double *A)
{
    return LAPACKE_dpotrf_work(LAPACK_COL_MAJOR, 'L', n, A, height(n)) == 0;
}

bool dense_solve(int n, double *A, int *pivot, double *b)
{
    if (LAPACKE_dgesv_work(LAPACK_COL_MAJOR, n, 1, A, height(n), pivot, b, height(n)) != 0)
        return false;
    for (int i = 0; i < n; i++)
        if (!isfinite(b[i])) return false;
    return true;
}
