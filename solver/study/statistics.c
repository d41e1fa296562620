/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Pearson's r with its t test, r's 95 % interval by Fisher's z (atanh r is close to normal with
 * standard error 1/sqrt(n - 3)), Spearman's rho as Pearson's r of the ranks, and Bland and Altman's
 * limits of agreement (Lancet 1986; i: 307-310), whose standard error is about sqrt(3/n) sd.
 *
 * Sums are over differences from the means (two passes), so that nearly constant readings do not
 * cancel.
 */
#include "solver/study/statistics.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "solver/study/special.h"

static const double confidence = 0.95;

struct moments {
    double mean_a, mean_b, aa, bb, ab; /* sums of squared and crossed deviations */
};

static double mean_of(const double *x, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++) sum += x[i];
    return sum / (double)n;
}

static struct moments moments_of(const double *a, const double *b, size_t n)
{
    struct moments m = {.mean_a = mean_of(a, n), .mean_b = mean_of(b, n)};
    for (size_t i = 0; i < n; i++) {
        const double da = a[i] - m.mean_a, db = b[i] - m.mean_b;
        m.aa += da * da;
        m.bb += db * db;
        m.ab += da * db;
    }
    return m;
}

static double correlation(const struct moments *m)
{
    if (!(m->aa > 0) || !(m->bb > 0)) return (double)NAN;
    const double r = m->ab / (sqrt(m->aa) * sqrt(m->bb));
    return fmax(-1, fmin(1, r));
}

static double correlation_p(double r, size_t n)
{
    const double freedom = (double)n - 2;
    if (isnan(r)) return r;
    return special_t_two_sided(r * sqrt(freedom / ((1 - r) * (1 + r))), freedom);
}

static struct statistics_interval fisher_interval(double r, size_t n)
{
    struct statistics_interval ci = {(double)NAN, (double)NAN};
    if (n < 4 || isnan(r)) return ci;
    const double half = special_normal_quantile((1 + confidence) / 2) / sqrt((double)n - 3);
    ci.low = tanh(atanh(r) - half);
    ci.high = tanh(atanh(r) + half);
    return ci;
}

static struct statistics_summary summary_of(const double *x, size_t n, double mean, double squares)
{
    struct statistics_summary s = {mean, sqrt(squares / ((double)n - 1)), x[0], x[0]};
    for (size_t i = 1; i < n; i++) {
        s.min = fmin(s.min, x[i]);
        s.max = fmax(s.max, x[i]);
    }
    return s;
}

struct ranked {
    double value;
    size_t index;
};

static int by_value(const void *left, const void *right)
{
    const struct ranked *l = left, *r = right;
    return (l->value > r->value) - (l->value < r->value);
}

/* Ranks 1 ... n, ties sharing their mean rank; `scratch` holds n entries. */
static void ranks_of(const double *x, size_t n, struct ranked *scratch, double *ret_rank)
{
    for (size_t i = 0; i < n; i++) scratch[i] = (struct ranked){x[i], i};
    qsort(scratch, n, sizeof *scratch, by_value);
    for (size_t first = 0; first < n;) {
        size_t end = first + 1;
        while (end < n && !(scratch[end].value > scratch[first].value)) end++;
        const double rank = ((double)first + 1 + (double)end) / 2;
        for (size_t i = first; i < end; i++) ret_rank[scratch[i].index] = rank;
        first = end;
    }
}

static enum ischia_code spearman(const double *a, const double *b, size_t n, double *ret_rho,
                                 struct ischia_error *err)
{
    struct ranked *scratch = calloc(n, sizeof *scratch);
    double *rank = calloc(2 * n, sizeof *rank);
    const bool allocated = scratch != NULL && rank != NULL;
    if (allocated) {
        ranks_of(a, n, scratch, rank);
        ranks_of(b, n, scratch, rank + n);
        const struct moments m = moments_of(rank, rank + n, n);
        *ret_rho = correlation(&m);
    }
    free(rank);
    free(scratch);
    return allocated ? ISCHIA_OK : FAIL(err, ISCHIA_E_MEMORY, "out of memory for %zu ranks", n);
}

static void regression(const double *a, const double *b, const struct moments *m,
                       struct statistics_pair *ret)
{
    double residual = 0, difference = 0;
    ret->slope = m->aa > 0 ? m->ab / m->aa : (double)NAN;
    ret->intercept = m->mean_b - ret->slope * m->mean_a;
    for (size_t i = 0; i < ret->n; i++) {
        const double e = b[i] - ret->intercept - ret->slope * a[i], d = b[i] - a[i];
        residual += e * e;
        difference += d * d;
    }
    ret->mean_square = difference / (double)ret->n;
    ret->corrected_mean_square = residual / (double)ret->n;
    ret->constant_mean_square = m->bb / (double)ret->n;
}

static void bland_altman(const double *a, const double *b, struct statistics_pair *ret)
{
    const double n = (double)ret->n, t = special_t_quantile((1 + confidence) / 2, n - 1);
    double squares = 0;
    ret->bias = ret->b.mean - ret->a.mean;
    for (size_t i = 0; i < ret->n; i++) {
        const double d = b[i] - a[i] - ret->bias;
        squares += d * d;
    }
    ret->bias_sd = sqrt(squares / (n - 1));
    const double half = t * ret->bias_sd / sqrt(n);
    ret->bias_ci = (struct statistics_interval){ret->bias - half, ret->bias + half};
    ret->limits = (struct statistics_interval){ret->bias - 1.96 * ret->bias_sd,
                                               ret->bias + 1.96 * ret->bias_sd};
    ret->limits_half_ci = t * ret->bias_sd * sqrt(3 / n);
}

enum ischia_code statistics_compare(const double *a, const double *b, size_t n,
                                    struct statistics_pair *ret, struct ischia_error *err)
{
    struct statistics_pair s = {.n = n};
    CHECK(n >= 3, err, ISCHIA_E_INPUT, "a comparison needs at least 3 pairs, there are %zu", n);
    for (size_t i = 0; i < n; i++)
        CHECK(isfinite(a[i]) && isfinite(b[i]), err, ISCHIA_E_INPUT,
              "pair %zu holds a value that is not finite", i + 1);
    TRY(spearman(a, b, n, &s.spearman_rho, err));
    const struct moments m = moments_of(a, b, n);
    s.a = summary_of(a, n, m.mean_a, m.aa);
    s.b = summary_of(b, n, m.mean_b, m.bb);
    s.spearman_p = correlation_p(s.spearman_rho, n);
    s.pearson_r = correlation(&m);
    s.pearson_p = correlation_p(s.pearson_r, n);
    s.pearson_ci = fisher_interval(s.pearson_r, n);
    regression(a, b, &m, &s);
    bland_altman(a, b, &s);
    *ret = s;
    return ISCHIA_OK;
}
