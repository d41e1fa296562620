/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Sobol: x_index = XOR of the direction numbers v_j over the set bits j of the Gray code of index,
 * v_j = m_j 2^(32 - j), with m_j from the recurrence of a primitive polynomial (Bratley and Fox
 * 1988). Polynomials and initial m_j: Joe and Kuo, SIAM J. Sci. Comput. 30 (2008) 2635, their
 * table new-joe-kuo-6.21201.
 *
 * Halton: the digits of index in the base of the dimension, mirrored about the radix point; with a
 * seed every digit, the endless leading zeros included, goes through a permutation of its own.
 *
 * splitmix64: Steele, Lea and Flood, OOPSLA 2014.
 */
#include "solver/study/sequence.h"

#include <assert.h>
#include <math.h>

enum { SOBOL_BITS = 32, SOBOL_DEGREE_MAX = 6, HALTON_BASE_MAX = 43 };

struct sobol_polynomial {
    unsigned degree;
    unsigned middle; /* the polynomial's coefficients but the first and last, as bits */
    uint32_t m[SOBOL_DEGREE_MAX];
};

/* Dimension 0 is van der Corput's sequence: no polynomial. */
static const struct sobol_polynomial sobol[SEQUENCE_DIMENSIONS_MAX] = {
    {0, 0, {0}},
    {1, 0, {1}},
    {2, 1, {1, 3}},
    {3, 1, {1, 3, 1}},
    {3, 2, {1, 1, 1}},
    {4, 1, {1, 1, 3, 3}},
    {4, 4, {1, 3, 5, 13}},
    {5, 2, {1, 1, 5, 5, 17}},
    {5, 4, {1, 1, 5, 5, 5}},
    {5, 7, {1, 1, 7, 11, 19}},
    {5, 11, {1, 1, 5, 1, 1}},
    {5, 13, {1, 1, 1, 3, 11}},
    {5, 14, {1, 3, 5, 5, 31}},
    {6, 1, {1, 3, 3, 9, 7, 49}},
};

static const uint32_t primes[SEQUENCE_DIMENSIONS_MAX] = {2,  3,  5,  7,  11, 13, 17,
                                                         19, 23, 29, 31, 37, 41, 43};

uint64_t sequence_random_next(struct sequence_random *random)
{
    uint64_t z = random->state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/* The high half of a 32 x 32 bit product: its bias is below 2^-32 times bound. */
uint32_t sequence_random_below(struct sequence_random *random, uint32_t bound)
{
    assert(bound > 0);
    return (uint32_t)(((sequence_random_next(random) >> 32) * bound) >> 32);
}

static void sobol_directions(int dimension, uint32_t v[SOBOL_BITS])
{
    const struct sobol_polynomial *p = &sobol[dimension];
    for (unsigned j = 0; j < SOBOL_BITS; j++) {
        if (p->degree == 0 || j < p->degree) {
            v[j] = (p->degree == 0 ? 1 : p->m[j]) << (SOBOL_BITS - 1 - j);
            continue;
        }
        v[j] = v[j - p->degree] ^ (v[j - p->degree] >> p->degree);
        for (unsigned k = 1; k < p->degree; k++)
            if ((p->middle >> (p->degree - 1 - k)) & 1) v[j] ^= v[j - k];
    }
}

/* A stream of its own for each seed and dimension. */
static struct sequence_random random_for(uint64_t seed, int dimension)
{
    struct sequence_random r = {seed ^ ((uint64_t)dimension << 56)};
    r.state = sequence_random_next(&r);
    return r;
}

double sequence_sobol(uint32_t index, int dimension, uint64_t seed)
{
    uint32_t v[SOBOL_BITS], bits = 0;
    assert(dimension >= 0 && dimension < SEQUENCE_DIMENSIONS_MAX);
    sobol_directions(dimension, v);
    const uint32_t gray = index ^ (index >> 1);
    for (unsigned j = 0; j < SOBOL_BITS; j++)
        if ((gray >> j) & 1) bits ^= v[j];
    if (seed != 0) {
        struct sequence_random random = random_for(seed, dimension);
        bits ^= (uint32_t)(sequence_random_next(&random) >> 32);
    }
    return ldexp(bits, -SOBOL_BITS);
}

/* Fisher and Yates. */
static void permutation(struct sequence_random *random, uint32_t base,
                        uint32_t ret[HALTON_BASE_MAX])
{
    for (uint32_t i = 0; i < base; i++) {
        const uint32_t j = sequence_random_below(random, i + 1);
        ret[i] = ret[j];
        ret[j] = i;
    }
}

double sequence_halton(uint32_t index, int dimension, uint64_t seed)
{
    assert(dimension >= 0 && dimension < SEQUENCE_DIMENSIONS_MAX);
    const uint32_t base = primes[dimension];
    struct sequence_random random = random_for(seed, dimension);
    uint32_t digit_of[HALTON_BASE_MAX];
    double weight = 1, value = 0;
    for (uint32_t rest = index; weight > 0x1p-53 && (rest > 0 || seed != 0); rest /= base) {
        const uint32_t digit = rest % base;
        weight /= base;
        if (seed != 0) permutation(&random, base, digit_of);
        value += weight * (seed != 0 ? digit_of[digit] : digit);
    }
    return fmin(value, 1 - 0x1p-53);
}
