/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_EMULATOR_H
#define ISCHIA_SOLVER_STUDY_EMULATOR_H

#include <stddef.h>

#include "solver/error.h"
#include "solver/study/least_squares.h"

/*
 * The polynomial stand-in for a response: full degree 1 or 2 in m parameters normalised to
 * [-1, 1], fitted by least squares, and how much of its variance each parameter carries when all
 * are independent and uniform on [-1, 1] (Macron et al. 2020, section 2.4).
 */

enum { EMULATOR_PARAMS_MAX = 14, EMULATOR_TERMS_MAX = 120 };

/* One monomial x_i x_j; -1 stands for 1, so {-1, -1} is the constant and {i, -1} is linear. */
struct emulator_term {
    int i, j;
};

struct emulator_sensitivity {
    double share[EMULATOR_TERMS_MAX];        /* var(term) / var(y), 0 for the constant: the paper's
                                              s_i, s_ii, s_ij over var(y)                       */
    double first_order[EMULATOR_PARAMS_MAX]; /* the paper's S_i = (s_i + s_ii) / var(y): also the
                                                first-order Sobol' index, as the terms are
                                                orthogonal under the uniform law                */
    double total[EMULATOR_PARAMS_MAX];       /* total Sobol' index: S_i plus all its S_ij       */
    double variance;                         /* var(y)                                          */
};

struct emulator {
    int params; /* m */
    int degree; /* 1 or 2 */
    int terms;
    struct emulator_term term[EMULATOR_TERMS_MAX]; /* constant, linear, squares, products i < j */
    struct least_squares fit;                      /* beta[terms], se[terms], ...              */
    struct emulator_sensitivity sensitivity;
};

/*
 * x: [n][params], row by row, normalised; y: [n]. 1 <= params <= EMULATOR_PARAMS_MAX, degree 1 or 2
 * (asserted). ISCHIA_E_INPUT when the rows do not identify the terms; ISCHIA_E_MEMORY,
 * ISCHIA_E_NUMERIC. *ret is untouched on error.
 */
ISCHIA_MUST_CHECK enum ischia_code emulator_init(struct emulator *ret, int params, int degree,
                                                 const double *x, const double *y, size_t n,
                                                 struct ischia_error *err);
void emulator_finish(struct emulator *emulator); /* a zeroed one is allowed */

/* The polynomial at x[params], normalised. */
double emulator_value(const struct emulator *emulator, const double *x);

/* Number of terms of a full polynomial; writes them when ret_term is not NULL. */
int emulator_terms(int params, int degree, struct emulator_term *ret_term);

/* Variances of the monomials' terms for given coefficients beta[terms]. */
struct emulator_sensitivity emulator_sensitivity_of(const struct emulator_term *term, int terms,
                                                    int params, const double *beta);

#endif
