/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_GMRES_H
#define ISCHIA_SOLVER_GMRES_H

#include "solver/error.h"

/*
 * Left-preconditioned GMRES without restart (Saad and Schultz 1986; Saad 2003, algorithm 6.9) for
 * systems that differ little from one whose factor is at hand.
 */

enum { GMRES_ITERATIONS_MAX = 30 };

struct gmres_operator {
    /* y = A x */
    void (*apply)(void *context, const double *x, double *ret_y);
    /* x <- M^-1 x */
    enum ischia_code (*precondition)(void *context, double *x, struct ischia_error *err);
    void *context;
};

/* Doubles of work space for n unknowns. */
static inline size_t gmres_work_size(int n) { return (size_t)n * (GMRES_ITERATIONS_MAX + 2); }

/*
 * Solves A x = b from x = 0 until |M^-1 (b - A x)| <= tolerance * |M^-1 b|; *x holds b on entry and
 * the solution on return. *ret_reached is the ratio that was reached. work: gmres_work_size(n).
 */
ISCHIA_MUST_CHECK enum ischia_code gmres(const struct gmres_operator *op, int n, double tolerance,
                                         double *x, double *work, double *ret_reached,
                                         struct ischia_error *err);

#endif
