/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "solver/gmres.h"

struct arnoldi {
    double h[GMRES_ITERATIONS_MAX + 1][GMRES_ITERATIONS_MAX]; /* triangular after the rotations */
    double c[GMRES_ITERATIONS_MAX], s[GMRES_ITERATIONS_MAX];
    double g[GMRES_ITERATIONS_MAX + 1]; /* rotated right-hand side; |g[k]| is the residual */
};

static double dot(int n, const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

static void add_scaled(int n, double factor, const double *x, double *y)
{
    for (int i = 0; i < n; i++) y[i] += factor * x[i];
}

static void scale(int n, double factor, double *x)
{
    for (int i = 0; i < n; i++) x[i] *= factor;
}

/* Modified Gram-Schmidt of v[k + 1] against v[0 ... k]; fills column k of h. */
static void orthogonalise(struct arnoldi *a, int n, int k, double *v)
{
    double *next = v + (size_t)(k + 1) * (size_t)n;
    for (int i = 0; i <= k; i++) {
        const double *vi = v + (size_t)i * (size_t)n;
        a->h[i][k] = dot(n, next, vi);
        add_scaled(n, -a->h[i][k], vi, next);
    }
    a->h[k + 1][k] = sqrt(dot(n, next, next));
    if (a->h[k + 1][k] > 0) scale(n, 1 / a->h[k + 1][k], next);
}

/* Applies the old Givens rotations to column k and a new one that clears h[k + 1][k]. */
static void rotate_column(struct arnoldi *a, int k)
{
    for (int i = 0; i < k; i++) {
        const double upper = a->h[i][k], lower = a->h[i + 1][k];
        a->h[i][k] = a->c[i] * upper + a->s[i] * lower;
        a->h[i + 1][k] = -a->s[i] * upper + a->c[i] * lower;
    }
    const double r = hypot(a->h[k][k], a->h[k + 1][k]);
    /* r = 0: A is singular and the direction worth nothing; the residual must stay what it was. */
    a->c[k] = r > 0 ? a->h[k][k] / r : 0;
    a->s[k] = r > 0 ? a->h[k + 1][k] / r : 1;
    a->h[k][k] = r;
    a->g[k + 1] = -a->s[k] * a->g[k];
    a->g[k] *= a->c[k];
}

/* x = V y with the triangular system h y = g of size k. */
static void combine(struct arnoldi *a, int n, int k, const double *v, double *x)
{
    memset(x, 0, sizeof *x * (size_t)n);
    for (int i = k - 1; i >= 0; i--) {
        for (int j = i + 1; j < k; j++) a->g[i] -= a->h[i][j] * a->g[j];
        a->g[i] = a->h[i][i] > 0 ? a->g[i] / a->h[i][i] : 0;
    }
    for (int i = 0; i < k; i++) add_scaled(n, a->g[i], v + (size_t)i * (size_t)n, x);
}

enum ischia_code gmres(const struct gmres_operator *op, int n, double tolerance, double *x,
                       double *v, double *ret_reached, struct ischia_error *err)
{
    struct arnoldi a = {0};
    int k = 0;
    TRY(op->precondition(op->context, x, err));
    const double start = sqrt(dot(n, x, x));
    *ret_reached = 0;
    if (!(start > 0)) return ISCHIA_OK;
    memcpy(v, x, sizeof *x * (size_t)n);
    scale(n, 1 / start, v);
    a.g[0] = start;
    while (k < GMRES_ITERATIONS_MAX && fabs(a.g[k]) > tolerance * start) {
        double *next = v + (size_t)(k + 1) * (size_t)n;
        op->apply(op->context, v + (size_t)k * (size_t)n, next);
        TRY(op->precondition(op->context, next, err));
        orthogonalise(&a, n, k, v);
        rotate_column(&a, k);
        k++;
    }
    *ret_reached = fabs(a.g[k]) / start;
    combine(&a, n, k, v, x);
    return ISCHIA_OK;
}
