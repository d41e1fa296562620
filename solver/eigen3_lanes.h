/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_EIGEN3_LANES_H
#define ISCHIA_SOLVER_EIGEN3_LANES_H

#include <float.h>

#include "solver/lanes.h"

/*
 * Eigenvalues and eigenvectors of symmetric 3 x 3 matrices, one in each lane, by cyclic Jacobi
 * rotations (Golub and Van Loan, section 8.5). The rotation by theta in the plane (p, q) that
 * annihilates a_pq has tan(2 theta) = 2 a_pq / (a_qq - a_pp). Only tau = tan(theta / 2) is taken
 * from that, in single precision: with c = (1 - tau^2) / (1 + tau^2) and s = 2 tau / (1 + tau^2)
 * the rotation is orthonormal to double precision whatever tau is, and what is left of a_pq falls
 * to the next sweep. The rotations are gathered in a quaternion, not normalised, in which each is
 * the factor (1, -tau e_r); so do McAdams and others (2011), "Computing the singular value
 * decomposition of 3 x 3 matrices with minimal branching and elementary floating point operations".
 */
struct eigen3 {
    lanes diagonal[3]; /* of the rotated matrix, in units of scale                    */
    lanes off[3];      /* off[r] = a_pq, where (p, q, r) is cyclic                    */
    lanes w, q[3];     /* real part and vector of the quaternion                      */
    lanes scale;
};

enum {
    EIGEN3_AT_ONCE = 8,     /* matrices, at most                       */
    EIGEN3_SWEEPS_MAX = 10, /* three to five are what it takes         */
};

/* Off the diagonal, what is less than this share of the matrix is nothing ... */
#define EIGEN3_NOTHING 1e-17
/* ... and of what is less than this, single precision leaves nothing. */
#define EIGEN3_LAST 1e-10

LANES_INLINE void eigen3_init(struct eigen3 *e, const lanes diagonal[3], const lanes off[3])
{
    lanes scale = lanes_all(DBL_MIN);
    for (int k = 0; k < 3; k++) scale += lanes_abs(diagonal[k]) + lanes_abs(off[k]);
    const lanes share = 1 / scale;
    for (int k = 0; k < 3; k++) {
        e->diagonal[k] = diagonal[k] * share;
        e->off[k] = off[k] * share;
        e->q[k] = lanes_all(0);
    }
    e->w = lanes_all(1);
    e->scale = scale;
}

/*
 * tan(theta / 2) for x = 2 a_pq and d = a_qq - a_pp, |theta| <= pi / 4. The last term makes 0 / 0
 * nought and is lost beside anything else.
 */
LANES_INLINE lanes eigen3_half_tangent(lanes x, lanes d)
{
    const lanes_float along = __builtin_convertvector(lanes_abs(d), lanes_float);
    const lanes_float across = __builtin_convertvector(x, lanes_float);
    const lanes_float sum = along + lanes_sqrt_float(along * along + across * across);
    const lanes_float tau = across / (sum + lanes_sqrt_float(sum * sum + across * across) + 1e-30F);
    const lanes_bits sign = (lanes_bits)d & ~(UINT64_MAX >> 1);
    return (lanes)((lanes_bits) __builtin_convertvector(tau, lanes) ^ sign);
}

struct eigen3_rotation {
    lanes tau, c, s;
};

/* Of the rotation that annihilates a_pq. What is nothing is left out first: squares of it would be
 * subnormal numbers, on which processors lose a hundred cycles each. */
LANES_INLINE lanes eigen3_tau(const struct eigen3 *e, int r)
{
    const int p = (r + 1) % 3, q = (r + 2) % 3;
    const lanes x = lanes_where(lanes_abs(e->off[r]) > EIGEN3_NOTHING, e->off[r] + e->off[r]);
    return eigen3_half_tangent(x, e->diagonal[q] - e->diagonal[p]);
}

LANES_INLINE struct eigen3_rotation eigen3_rotation(lanes tau)
{
    const lanes tau2 = tau * tau, inverse = 1 / (1 + tau2);
    return (struct eigen3_rotation){tau, (1 - tau2) * inverse, (tau + tau) * inverse};
}

LANES_INLINE void eigen3_rotate(struct eigen3 *e, int r, const struct eigen3_rotation *by)
{
    const int p = (r + 1) % 3, q = (r + 2) % 3;
    const lanes apq = e->off[r], arp = e->off[q], arq = e->off[p];
    const lanes x = apq + apq, d = e->diagonal[q] - e->diagonal[p], size = lanes_abs(apq);
    const lanes c = by->c, s = by->s, tau = by->tau;
    const lanes moved = s * (c * x - s * d);
    e->diagonal[p] -= moved;
    e->diagonal[q] += moved;
    e->off[r] = lanes_where(size > EIGEN3_LAST, c * (c * apq - s * d) - s * (s * apq));
    e->off[q] = c * arp - s * arq;
    e->off[p] = s * arp + c * arq;
    const lanes w = e->w, qp = e->q[p], qq = e->q[q], qr = e->q[r];
    e->w = w + tau * qr;
    e->q[r] = qr - tau * w;
    e->q[p] = qp - tau * qq;
    e->q[q] = qq + tau * qp;
}

LANES_INLINE bool eigen3_are_diagonal(const struct eigen3 *e, int count)
{
    lanes most = lanes_all(0);
    for (int m = 0; m < count; m++)
        for (int k = 0; k < 3; k++) most = lanes_max(most, lanes_abs(e[m].off[k]));
    return !lanes_any(most > EIGEN3_NOTHING);
}

/*
 * Diagonalises `count` of them at a time, in three passes, because the steps of one rotation wait
 * for each other but not for those of the next matrix. Where nothing is left, tau is 0 and all
 * stays as it is, to the bit.
 */
LANES_INLINE void eigen3_diagonalise(struct eigen3 *e, int count)
{
    struct eigen3_rotation by[EIGEN3_AT_ONCE];
    for (int sweep = 0; sweep < EIGEN3_SWEEPS_MAX && !eigen3_are_diagonal(e, count); sweep++)
        for (int r = 2; r >= 0; r--) {
            for (int m = 0; m < count; m++) by[m].tau = eigen3_tau(&e[m], r);
            for (int m = 0; m < count; m++) by[m] = eigen3_rotation(by[m].tau);
            for (int m = 0; m < count; m++) eigen3_rotate(&e[m], r, &by[m]);
        }
}

/* ret[i][k]: component i of the eigenvector of the k-th value. Right-handed. */
LANES_INLINE void eigen3_vectors(const struct eigen3 *e, lanes ret[3][3])
{
    const lanes w = e->w, x = e->q[0], y = e->q[1], z = e->q[2];
    const lanes two = 2 / (w * w + x * x + y * y + z * z);
    ret[0][0] = 1 - two * (y * y + z * z);
    ret[0][1] = two * (x * y - w * z);
    ret[0][2] = two * (x * z + w * y);
    ret[1][0] = two * (x * y + w * z);
    ret[1][1] = 1 - two * (x * x + z * z);
    ret[1][2] = two * (y * z - w * x);
    ret[2][0] = two * (x * z - w * y);
    ret[2][1] = two * (y * z + w * x);
    ret[2][2] = 1 - two * (x * x + y * y);
}

#endif
