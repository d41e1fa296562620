/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_UNITS_H
#define ISCHIA_SOLVER_UNITS_H

/*
 * Every unit conversion and the one factor of symmetry, each a named function.
 * Inside the solver: mm, N, MPa (= N/mm2). Outside it: mm, N, kPa.
 */

/* Four mirror images make the whole side: the solver's model is the quarter x >= 0, y >= 0. */
enum { ISCHIA_QUARTERS_PER_SIDE = 4 };

static inline double MPa_from_kPa(double kPa) { return kPa * 1e-3; }
static inline double kPa_from_MPa(double MPa) { return MPa * 1e3; }

/* Force on the whole side <-> force carried by the quarter model, both in N. */
static inline double quarter_force_N(double side_N) { return side_N / ISCHIA_QUARTERS_PER_SIDE; }
static inline double side_force_N(double quarter_N) { return quarter_N * ISCHIA_QUARTERS_PER_SIDE; }

/* Volume or area of the quarter -> of the whole side. */
static inline double side_extent(double quarter_extent)
{
    return quarter_extent * ISCHIA_QUARTERS_PER_SIDE;
}

#endif
