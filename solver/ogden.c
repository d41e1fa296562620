/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * With b_i = J^(-alpha/3) s_i^alpha and m = (b_1 + b_2 + b_3) / 3:
 *   g_i  = (2 mu / alpha) (b_i - m) / s_i
 *   H_ij = (2 mu / alpha) [alpha (b_i d_ij - (b_i + b_j) / 3 + m / 3) - d_ij (b_i - m)] / (s_i s_j)
 * and, because s_i^4 - s_j^4 = (s_i - s_j) (s_i + s_j) (s_i^2 + s_j^2),
 *   (g_i - g_j) / (s_i - s_j) = (2 mu / alpha) [J^(-alpha/3) (s_i + s_j) (s_i^2 + s_j^2)
 *                                               + m / (s_i s_j)].
 * Source of the law: Ogden (1972); of the split of the tangent: Ogden (1997), section 6.1.4.
 */
#include "solver/ogden.h"

#include <math.h>

static double fifth(double x)
{
    const double x2 = x * x;
    return x2 * x2 * x;
}

double ogden_energy(double mu_MPa, const double s[3])
{
    const double J = s[0] * s[1] * s[2];
    const double scale = 1 / (J * cbrt(J * J)); /* J^(-5/3) */
    const double sum = scale * (fifth(s[0]) + fifth(s[1]) + fifth(s[2]));
    return 2 * mu_MPa / (OGDEN_ALPHA * OGDEN_ALPHA) * (sum - 3);
}

void ogden_derivatives(double mu_MPa, double pressure_MPa, const double s[3],
                       struct ogden_derivatives *ret)
{
    const double J = s[0] * s[1] * s[2];
    const double scale = 1 / (J * cbrt(J * J));
    const double c = 2 * mu_MPa / OGDEN_ALPHA;
    const double b[3] = {scale * fifth(s[0]), scale * fifth(s[1]), scale * fifth(s[2])};
    const double m = (b[0] + b[1] + b[2]) / 3;
    for (int i = 0; i < 3; i++) ret->gradient[i] = (c * (b[i] - m) + pressure_MPa * J) / s[i];
    for (int i = 0; i < 3; i++)
        ret->normal[i][i] = c * (OGDEN_ALPHA * (b[i] + m) / 3 - (b[i] - m)) / (s[i] * s[i]);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double ss = s[i] * s[j];
        const double mixed = (c * OGDEN_ALPHA * (m - b[i] - b[j]) / 3 + pressure_MPa * J) / ss;
        ret->normal[i][j] = ret->normal[j][i] = mixed;
        ret->even[k] = c * (scale * (s[i] + s[j]) * (s[i] * s[i] + s[j] * s[j]) + m / ss) -
                       pressure_MPa * J / ss;
        ret->odd[k] = (ret->gradient[i] + ret->gradient[j]) / (s[i] + s[j]);
    }
}
