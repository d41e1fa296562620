/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_OGDEN_LANES_H
#define ISCHIA_SOLVER_OGDEN_LANES_H

#include "solver/lanes.h"
#include "solver/ogden.h"

/*
 * The law of ogden.h, a point in each lane. With b_i = J^(-alpha/3) s_i^alpha and
 * m = (b_1 + b_2 + b_3) / 3:
 *   g_i  = (2 mu / alpha) (b_i - m) / s_i
 *   H_ij = (2 mu / alpha) [alpha (b_i d_ij - (b_i + b_j) / 3 + m / 3) - d_ij (b_i - m)] / (s_i s_j)
 * and, because s_i^4 - s_j^4 = (s_i - s_j) (s_i + s_j) (s_i^2 + s_j^2),
 *   (g_i - g_j) / (s_i - s_j) = (2 mu / alpha) [J^(-alpha/3) (s_i + s_j) (s_i^2 + s_j^2)
 *                                               + m / (s_i s_j)].
 * Source of the law: Ogden (1972); of the split of the tangent: Ogden (1997), section 6.1.4.
 */

/* What energy and derivatives share. */
struct ogden_terms {
    lanes s[3], J;
    lanes inverse[3];      /* 1 / s_i                                      */
    lanes inverse_pair[3]; /* 1 / (s_i s_j), k being neither i nor j       */
    lanes scale, b[3], m;  /* scale = J^(-alpha/3)                         */
};

/* As struct ogden_derivatives; the normal part is split by its symmetry. */
struct ogden_tangent {
    lanes gradient[3];
    lanes normal[3]; /* d2W/ds_i2                                   */
    lanes mixed[3];  /* d2W/ds_i ds_j, k being neither i nor j      */
    lanes even[3], odd[3];
};

LANES_INLINE lanes ogden_fifth(lanes x)
{
    const lanes x2 = x * x;
    return x2 * x2 * x;
}

LANES_INLINE void ogden_terms_init(struct ogden_terms *t, const lanes s[3])
{
    t->J = s[0] * s[1] * s[2];
    const lanes inverse_J = 1 / t->J, root = lanes_inverse_cbrt(t->J);
    t->scale = root * root * inverse_J;
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        t->s[k] = s[k];
        t->inverse[k] = s[i] * s[j] * inverse_J;
        t->inverse_pair[k] = s[k] * inverse_J;
        t->b[k] = t->scale * ogden_fifth(s[k]);
    }
    t->m = (t->b[0] + t->b[1] + t->b[2]) * (1.0 / 3);
}

LANES_INLINE lanes ogden_energy_lanes(lanes mu, const struct ogden_terms *t)
{
    return mu * (2.0 / (OGDEN_ALPHA * OGDEN_ALPHA)) * (t->b[0] + t->b[1] + t->b[2] - 3);
}

LANES_INLINE void ogden_gradient(lanes mu, lanes pressure, const struct ogden_terms *t,
                                 lanes ret[3])
{
    const lanes c = mu * (2.0 / OGDEN_ALPHA), pJ = pressure * t->J;
    for (int i = 0; i < 3; i++) ret[i] = (c * (t->b[i] - t->m) + pJ) * t->inverse[i];
}

LANES_INLINE void ogden_tangent(lanes mu, lanes pressure, const struct ogden_terms *t,
                                struct ogden_tangent *ret)
{
    const lanes c = mu * (2.0 / OGDEN_ALPHA), pJ = pressure * t->J;
    const lanes *s = t->s, *b = t->b, m = t->m;
    ogden_gradient(mu, pressure, t, ret->gradient);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const lanes sum = s[i] + s[j];
        ret->normal[k] =
            c * ((OGDEN_ALPHA / 3.0) * (b[k] + m) - (b[k] - m)) * (t->inverse[k] * t->inverse[k]);
        ret->mixed[k] = (c * (OGDEN_ALPHA / 3.0) * (m - b[i] - b[j]) + pJ) * t->inverse_pair[k];
        ret->even[k] =
            c * t->scale * sum * (s[i] * s[i] + s[j] * s[j]) + (c * m - pJ) * t->inverse_pair[k];
        ret->odd[k] = (ret->gradient[i] + ret->gradient[j]) / sum;
    }
}

#endif
