/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_LANES_H
#define ISCHIA_SOLVER_LANES_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/*
 * A few numbers side by side, one vector register of them: arithmetic and comparisons go lane by
 * lane (GCC's and clang's vector extension). No lane ever sees another, and every operation is
 * IEEE's, so that a lane's result has the same bits whatever LANES is and whatever its
 * neighbours hold. The files that include this are compiled once for each width
 * (solver/meson.build); without LANES it is that of SSE2 and NEON.
 */
#ifndef LANES
#define LANES 2
#endif

typedef double lanes __attribute__((vector_size(8 * LANES)));
typedef float lanes_float __attribute__((vector_size(4 * LANES)));
typedef int64_t lanes_mask __attribute__((vector_size(8 * LANES))); /* -1 or 0, of comparisons */
typedef uint64_t lanes_bits __attribute__((vector_size(8 * LANES)));

/* Vectors are passed in registers that not every x86-64 has: no call may stay a call. */
#define LANES_INLINE static inline __attribute__((always_inline))

LANES_INLINE lanes lanes_load(const double *p)
{
    lanes x;
    memcpy(&x, __builtin_assume_aligned(p, sizeof x), sizeof x);
    return x;
}

LANES_INLINE void lanes_store(double *p, lanes x)
{
    memcpy(__builtin_assume_aligned(p, sizeof x), &x, sizeof x);
}

LANES_INLINE lanes lanes_all(double x) { return x - (lanes){0}; }

LANES_INLINE lanes lanes_sqrt(lanes x)
{
    lanes root;
    for (int l = 0; l < LANES; l++) root[l] = sqrt(x[l]);
    return root;
}

LANES_INLINE lanes_float lanes_sqrt_float(lanes_float x)
{
    lanes_float root;
    for (int l = 0; l < LANES; l++) root[l] = sqrtf(x[l]);
    return root;
}

LANES_INLINE lanes lanes_abs(lanes x) { return (lanes)((lanes_bits)x & (UINT64_MAX >> 1)); }

/* x where the mask is set, else 0. */
LANES_INLINE lanes lanes_where(lanes_mask mask, lanes x) { return (lanes)(mask & (lanes_mask)x); }

LANES_INLINE lanes lanes_select(lanes_mask mask, lanes x, lanes otherwise)
{
    return (lanes)((mask & (lanes_mask)x) | (~mask & (lanes_mask)otherwise));
}

LANES_INLINE lanes lanes_min(lanes x, lanes y) { return lanes_select(x < y, x, y); }
LANES_INLINE lanes lanes_max(lanes x, lanes y) { return lanes_select(x > y, x, y); }

LANES_INLINE bool lanes_any(lanes_mask mask)
{
    int64_t any = 0;
    for (int l = 0; l < LANES; l++) any |= mask[l];
    return any != 0;
}

/*
 * x^(-1/3) to about one unit in the last place, for positive normal x. The exponent's third, taken
 * on the bits, starts within 4 %; then twice a step of fourth order for y^-3 = x.
 */
LANES_INLINE lanes lanes_inverse_cbrt(lanes x)
{
    lanes_bits third = (lanes_bits)x >> 2; /* 1/3 = (1/4) (1 + 1/4) (1 + 1/16) (1 + 1/256) ... */
    third += third >> 2;
    third += third >> 4;
    third += third >> 8;
    lanes y = (lanes)(UINT64_C(0x553ef0ff289dd796) - third);
    for (int step = 0; step < 2; step++) {
        const lanes h = 1 - x * y * y * y;
        y += y * h * (1.0 / 3 + h * (2.0 / 9 + h * (14.0 / 81)));
    }
    return y;
}

#endif
