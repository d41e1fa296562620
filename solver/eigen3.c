/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/eigen3.h"

#include <math.h>
#include <string.h>

enum { SWEEPS_MAX = 12 };

/* Annihilates a[p][q]; r is the third index. */
static void rotate(double a[3][3], double v[3][3], int p, int q, int r)
{
    const double apq = a[p][q];
    const double theta = (a[q][q] - a[p][p]) / (2 * apq);
    const double t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1));
    const double c = 1 / sqrt(t * t + 1), s = t * c;
    const double arp = a[r][p], arq = a[r][q];
    a[p][p] -= t * apq;
    a[q][q] += t * apq;
    a[p][q] = a[q][p] = 0;
    a[r][p] = a[p][r] = c * arp - s * arq;
    a[r][q] = a[q][r] = s * arp + c * arq;
    for (int i = 0; i < 3; i++) {
        const double vip = v[i][p], viq = v[i][q];
        v[i][p] = c * vip - s * viq;
        v[i][q] = s * vip + c * viq;
    }
}

void eigen3(const double A[3][3], double ret_value[3], double ret_vector[3][3])
{
    static const int pairs[3][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
    double a[3][3], v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    memcpy(a, A, sizeof a);
    for (int sweep = 0; sweep < SWEEPS_MAX; sweep++) {
        const double off = fabs(a[0][1]) + fabs(a[0][2]) + fabs(a[1][2]);
        const double diagonal = fabs(a[0][0]) + fabs(a[1][1]) + fabs(a[2][2]);
        if (off <= 1e-17 * diagonal) break;
        for (int k = 0; k < 3; k++)
            if (a[pairs[k][0]][pairs[k][1]] != 0)
                rotate(a, v, pairs[k][0], pairs[k][1], pairs[k][2]);
    }
    for (int k = 0; k < 3; k++) ret_value[k] = a[k][k];
    memcpy(ret_vector, v, sizeof v);
}
