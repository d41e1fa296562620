/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * y = t_0 + sum t_i x_i + sum t_ii x_i^2 + sum_{i<j} t_ij x_i x_j with x_i uniform on [-1, 1]:
 *   var(t_i x_i) = t_i^2 / 3,  var(t_ii x_i^2) = 4 t_ii^2 / 45,  var(t_ij x_i x_j) = t_ij^2 / 9
 * (Macron et al. 2020, section 2.4). The terms are uncorrelated under that law, so their variances
 * add up, and grouping them by parameter gives Sobol's first-order and total indices exactly.
 */
#include "solver/study/emulator.h"

#include <assert.h>
#include <stdbool.h>
#include <stdlib.h>

int emulator_terms(int params, int degree, struct emulator_term *ret_term)
{
    struct emulator_term unused[EMULATOR_TERMS_MAX];
    struct emulator_term *term = ret_term != NULL ? ret_term : unused;
    int n = 0;
    assert(params >= 1 && params <= EMULATOR_PARAMS_MAX && (degree == 1 || degree == 2));
    term[n++] = (struct emulator_term){-1, -1};
    for (int i = 0; i < params; i++) term[n++] = (struct emulator_term){i, -1};
    if (degree < 2) return n;
    for (int i = 0; i < params; i++) term[n++] = (struct emulator_term){i, i};
    for (int i = 0; i < params; i++)
        for (int j = i + 1; j < params; j++) term[n++] = (struct emulator_term){i, j};
    return n;
}

static double monomial(struct emulator_term term, const double *x)
{
    return (term.i < 0 ? 1 : x[term.i]) * (term.j < 0 ? 1 : x[term.j]);
}

static double monomial_variance(struct emulator_term term)
{
    if (term.i < 0) return 0;
    if (term.j < 0) return 1.0 / 3;
    return term.i == term.j ? 4.0 / 45 : 1.0 / 9;
}

struct emulator_sensitivity emulator_sensitivity_of(const struct emulator_term *term, int terms,
                                                    int params, const double *beta)
{
    struct emulator_sensitivity s = {0};
    assert(terms <= EMULATOR_TERMS_MAX && params <= EMULATOR_PARAMS_MAX);
    for (int t = 0; t < terms; t++) s.variance += beta[t] * beta[t] * monomial_variance(term[t]);
    if (!(s.variance > 0)) return s;
    for (int t = 0; t < terms; t++) {
        const int i = term[t].i, j = term[t].j;
        const bool own = j < 0 || j == i;
        s.share[t] = beta[t] * beta[t] * monomial_variance(term[t]) / s.variance;
        if (i < 0) continue;
        s.total[i] += s.share[t];
        if (own) s.first_order[i] += s.share[t];
        if (!own) s.total[j] += s.share[t];
    }
    return s;
}

double emulator_value(const struct emulator *emulator, const double *x)
{
    double value = 0;
    for (int t = 0; t < emulator->terms; t++)
        value += emulator->fit.beta[t] * monomial(emulator->term[t], x);
    return value;
}

enum ischia_code emulator_init(struct emulator *ret, int params, int degree, const double *x,
                               const double *y, size_t n, struct ischia_error *err)
{
    struct emulator e = {.params = params, .degree = degree};
    e.terms = emulator_terms(params, degree, e.term);
    double *A = calloc(n > 0 ? n * (size_t)e.terms : 1, sizeof *A);
    CHECK(A != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu rows of %d terms", n, e.terms);
    for (int t = 0; t < e.terms; t++)
        for (size_t row = 0; row < n; row++)
            A[(size_t)t * n + row] = monomial(e.term[t], &x[row * (size_t)params]);
    const enum ischia_code code = least_squares_init(&e.fit, A, y, n, (size_t)e.terms, err);
    free(A);
    TRY(code);
    e.sensitivity = emulator_sensitivity_of(e.term, e.terms, params, e.fit.beta);
    *ret = e;
    return ISCHIA_OK;
}

void emulator_finish(struct emulator *emulator) { least_squares_finish(&emulator->fit); }
