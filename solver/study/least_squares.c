/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A = Q R by Householder reflections (LAPACK dgels, which leaves R and the reflectors behind), so
 * the condition number of A enters once, not squared as in the normal equations. Then
 *   beta = R^-1 Q^T y,   cov(beta) = s^2 R^-1 R^-T,   leverage_i = |row i of Q|^2,
 * and the leave-one-out residual is e_i / (1 - leverage_i) (exact for least squares).
 *
 * The only file that sees lapacke.h.
 */
#include "solver/study/least_squares.h"

#include <assert.h>
#include <lapacke.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static const double rcond_min = 1e-12;

/* What a fit needs while it is made: QR holds A, then R and the reflectors, then Q. */
struct work {
    size_t n, k;
    double *QR, *tau, *y, *R_inverse;
};

static void work_finish(struct work *w)
{
    free(w->QR);
    free(w->tau);
    free(w->y);
    free(w->R_inverse);
}

static enum ischia_code work_init(struct work *ret, const double *A, const double *y, size_t n,
                                  size_t k, struct ischia_error *err)
{
    struct work w = {.n = n,
                     .k = k,
                     .QR = calloc(n * k, sizeof(double)),
                     .tau = calloc(k, sizeof(double)),
                     .y = calloc(n, sizeof(double)),
                     .R_inverse = calloc(k * k, sizeof(double))};
    if (w.QR == NULL || w.tau == NULL || w.y == NULL || w.R_inverse == NULL) {
        work_finish(&w);
        return FAIL(err, ISCHIA_E_MEMORY, "out of memory for a fit of %zu rows, %zu terms", n, k);
    }
    memcpy(w.QR, A, n * k * sizeof *A);
    memcpy(w.y, y, n * sizeof *y);
    *ret = w;
    return ISCHIA_OK;
}

static enum ischia_code expect_zero(lapack_int info, const char *routine, struct ischia_error *err)
{
    CHECK(info == 0, err, info == LAPACK_WORK_MEMORY_ERROR ? ISCHIA_E_MEMORY : ISCHIA_E_NUMERIC,
          "LAPACK's %s ended with info %ld", routine, (long)info);
    return ISCHIA_OK;
}

/* QR := R and reflectors; refuses dependent columns. */
static enum ischia_code factor(struct work *w, double *ret_rcond, struct ischia_error *err)
{
    const lapack_int n = (lapack_int)w->n, k = (lapack_int)w->k;
    TRY(expect_zero(LAPACKE_dgeqrf(LAPACK_COL_MAJOR, n, k, w->QR, n, w->tau), "dgeqrf", err));
    TRY(expect_zero(LAPACKE_dtrcon(LAPACK_COL_MAJOR, '1', 'U', 'N', k, w->QR, n, ret_rcond),
                    "dtrcon", err));
    CHECK(*ret_rcond >= rcond_min, err, ISCHIA_E_INPUT,
          "the rows do not identify all %zu terms (reciprocal condition number %.1e): fit a lower "
          "degree or a larger design",
          w->k, *ret_rcond);
    return ISCHIA_OK;
}

/* y := Q^T y, of which the first k entries are solved with R into beta. */
static enum ischia_code solve(struct work *w, double *ret_beta, struct ischia_error *err)
{
    const lapack_int n = (lapack_int)w->n, k = (lapack_int)w->k;
    TRY(expect_zero(LAPACKE_dormqr(LAPACK_COL_MAJOR, 'L', 'T', n, 1, k, w->QR, n, w->tau, w->y, n),
                    "dormqr", err));
    TRY(expect_zero(LAPACKE_dtrtrs(LAPACK_COL_MAJOR, 'U', 'N', 'N', k, 1, w->QR, n, w->y, n),
                    "dtrtrs", err));
    memcpy(ret_beta, w->y, w->k * sizeof *ret_beta);
    return ISCHIA_OK;
}

static enum ischia_code invert_R(struct work *w, struct ischia_error *err)
{
    const size_t n = w->n, k = w->k;
    for (size_t j = 0; j < k; j++)
        memcpy(&w->R_inverse[j * k], &w->QR[j * n], (j + 1) * sizeof(double));
    return expect_zero(
        LAPACKE_dtrtri(LAPACK_COL_MAJOR, 'U', 'N', (lapack_int)k, w->R_inverse, (lapack_int)k),
        "dtrtri", err);
}

static void standard_errors(const struct work *w, double s2, double *ret_se)
{
    for (size_t i = 0; i < w->k; i++) {
        double sum = 0;
        for (size_t j = i; j < w->k; j++)
            sum += w->R_inverse[j * w->k + i] * w->R_inverse[j * w->k + i];
        ret_se[i] = sqrt(s2 * sum);
    }
}

/* Needs the explicit Q in w->QR. */
static double leave_one_out(const struct work *w, const double *residual)
{
    double sum = 0;
    for (size_t i = 0; i < w->n; i++) {
        double leverage = 0;
        for (size_t j = 0; j < w->k; j++) leverage += w->QR[j * w->n + i] * w->QR[j * w->n + i];
        if (leverage > 1 - 1e-12) return (double)NAN;
        sum += residual[i] * residual[i] / ((1 - leverage) * (1 - leverage));
    }
    return sum / (double)w->n;
}

static double residuals(const double *A, const double *y, struct least_squares *fit)
{
    double rss = 0;
    for (size_t i = 0; i < fit->n; i++) {
        double value = 0;
        for (size_t j = 0; j < fit->k; j++) value += A[j * fit->n + i] * fit->beta[j];
        fit->residual[i] = y[i] - value;
        rss += fit->residual[i] * fit->residual[i];
    }
    return rss;
}

static void goodness(const double *y, double rss, struct least_squares *fit)
{
    const double n = (double)fit->n, freedom = n - (double)fit->k;
    double mean = 0, total = 0;
    for (size_t i = 0; i < fit->n; i++) mean += y[i] / n;
    for (size_t i = 0; i < fit->n; i++) total += (y[i] - mean) * (y[i] - mean);
    fit->mean_square = rss / n;
    fit->r2 = total > 0 ? 1 - rss / total : (double)NAN;
    fit->r2_adjusted =
        freedom > 0 && total > 0 ? 1 - (rss / freedom) / (total / (n - 1)) : (double)NAN;
}

static enum ischia_code fit_with(struct work *w, const double *A, const double *y,
                                 struct least_squares *fit, struct ischia_error *err)
{
    const lapack_int n = (lapack_int)w->n, k = (lapack_int)w->k;
    TRY(factor(w, &fit->rcond, err));
    TRY(solve(w, fit->beta, err));
    TRY(invert_R(w, err));
    TRY(expect_zero(LAPACKE_dorgqr(LAPACK_COL_MAJOR, n, k, k, w->QR, n, w->tau), "dorgqr", err));
    const double rss = residuals(A, y, fit);
    goodness(y, rss, fit);
    standard_errors(w, w->n > w->k ? rss / (double)(w->n - w->k) : (double)NAN, fit->se);
    fit->loo_mean_square = leave_one_out(w, fit->residual);
    return ISCHIA_OK;
}

enum ischia_code least_squares_init(struct least_squares *ret, const double *A, const double *y,
                                    size_t n, size_t k, struct ischia_error *err)
{
    struct work w = {0};
    struct least_squares fit = {.n = n, .k = k};
    assert(k > 0);
    CHECK(n >= k, err, ISCHIA_E_INPUT, "%zu rows cannot identify %zu terms", n, k);
    CHECK(n < INT_MAX / k, err, ISCHIA_E_LIMIT, "%zu rows are too many to fit", n);
    TRY(work_init(&w, A, y, n, k, err));
    fit.beta = calloc(k, sizeof(double));
    fit.se = calloc(k, sizeof(double));
    fit.residual = calloc(n, sizeof(double));
    const bool allocated = fit.beta != NULL && fit.se != NULL && fit.residual != NULL;
    enum ischia_code code = allocated ? fit_with(&w, A, y, &fit, err)
                                      : FAIL(err, ISCHIA_E_MEMORY, "out of memory for a fit");
    work_finish(&w);
    if (code == ISCHIA_OK) {
        *ret = fit;
    } else {
        least_squares_finish(&fit);
    }
    return code;
}

void least_squares_finish(struct least_squares *fit)
{
    free(fit->beta);
    free(fit->se);
    free(fit->residual);
    *fit = (struct least_squares){0};
}
