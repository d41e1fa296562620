/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_SEQUENCE_H
#define ISCHIA_SOLVER_STUDY_SEQUENCE_H

#include <stdint.h>

/* Sequences of points in [0, 1)^dimensions, the same on every machine. */

enum { SEQUENCE_DIMENSIONS_MAX = 14, SEQUENCE_POINTS_MAX = 1 << 24 };

/*
 * Point `index` (0, 1, ...) of Sobol's sequence in Gray code order, coordinate `dimension`
 * (0 ... SEQUENCE_DIMENSIONS_MAX - 1). seed 0: the plain sequence, which starts at 0; any other
 * seed shifts its binary digits (a random digital shift, which keeps the sequence's uniformity and
 * leaves the corner 0).
 */
double sequence_sobol(uint32_t index, int dimension, uint64_t seed);

/* The same for Halton's sequence in the first primes; a seed permutes the digits of each position
 * of each dimension at random (Owen 2017), which also breaks the ties between large primes. */
double sequence_halton(uint32_t index, int dimension, uint64_t seed);

/* A small generator for designs (splitmix64): not for secrets. */
struct sequence_random {
    uint64_t state;
};
uint64_t sequence_random_next(struct sequence_random *random);
/* Uniform on 0 ... bound - 1; bound > 0. */
uint32_t sequence_random_below(struct sequence_random *random, uint32_t bound);

#endif
