/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Trilinear shape functions N_a(xi) = 1/8 (1 + xi_a xi)(1 + eta_a eta)(1 + zeta_a zeta), mapped by
 * X(xi) = sum N_a X_a; gradients dN/dX = (dX/dxi)^-T dN/dxi; the Gauss points lie at
 * (+-1, +-1, +-1)/sqrt(3) with weight 1, which integrates det(dX/dxi) exactly.
 *
 * Principal stretches by one-sided Jacobi rotations (Hestenes 1958): the columns of F are rotated
 * in pairs until they are orthogonal; their lengths are then the stretches. It is Jacobi's method
 * on C = F^T F without forming C, so that small stretches keep their digits.
 */
#include "solver/kinematics.h"

#include <assert.h>
#include <math.h>
#include <string.h>

static const double corner_sign[HEX_CORNERS][3] = {
    {-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
    {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1},
};

/* Sweeps needed in practice: 3 to 5; the limit only bounds the loop for non-finite input. */
enum { JACOBI_SWEEPS_MAX = 30 };

struct hex_corners hex_gather(const int nodes[HEX_CORNERS], const double *values)
{
    struct hex_corners corners;
    for (int a = 0; a < HEX_CORNERS; a++)
        memcpy(corners.at[a], &values[3 * (size_t)nodes[a]], sizeof corners.at[a]);
    return corners;
}

/* Values and natural derivatives of the eight shape functions at a Gauss point. */
static void shape_at(int point, double ret_N[HEX_CORNERS], double ret_dN[HEX_CORNERS][3])
{
    const double g = 1 / sqrt(3.0);
    for (int a = 0; a < HEX_CORNERS; a++) {
        double factor[3];
        for (int d = 0; d < 3; d++)
            factor[d] = 0.5 * (1 + corner_sign[a][d] * corner_sign[point][d] * g);
        ret_N[a] = factor[0] * factor[1] * factor[2];
        for (int d = 0; d < 3; d++)
            ret_dN[a][d] = 0.5 * corner_sign[a][d] * factor[(d + 1) % 3] * factor[(d + 2) % 3];
    }
}

/* Inverse of a 3 x 3 matrix by cofactors; returns its determinant. */
static double invert(double A[3][3], double ret_inverse[3][3])
{
    double cofactor[3][3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            cofactor[i][j] = A[i1][j1] * A[i2][j2] - A[i1][j2] * A[i2][j1];
        }
    }
    const double det =
        A[0][0] * cofactor[0][0] + A[0][1] * cofactor[0][1] + A[0][2] * cofactor[0][2];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) ret_inverse[i][j] = cofactor[j][i] / det;
    return det;
}

struct hex_point hex_point_at(const struct hex_corners *X, int point)
{
    assert(point >= 0 && point < HEX_CELLS);
    double N[HEX_CORNERS], dN[HEX_CORNERS][3], inverse[3][3];
    double jacobian[3][3] = {{0}}; /* dX_i/dxi_j */
    struct hex_point p = {.X_mm = {0}};
    shape_at(point, N, dN);
    for (int a = 0; a < HEX_CORNERS; a++) {
        for (int i = 0; i < 3; i++) {
            p.X_mm[i] += N[a] * X->at[a][i];
            for (int j = 0; j < 3; j++) jacobian[i][j] += X->at[a][i] * dN[a][j];
        }
    }
    p.volume_mm3 = invert(jacobian, inverse);
    for (int a = 0; a < HEX_CORNERS; a++)
        for (int i = 0; i < 3; i++)
            p.gradient[a][i] =
                dN[a][0] * inverse[0][i] + dN[a][1] * inverse[1][i] + dN[a][2] * inverse[2][i];
    return p;
}

void deformation_gradient(const struct hex_point *point, const struct hex_corners *u,
                          double ret_F[3][3])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            ret_F[i][j] = i == j;
            for (int a = 0; a < HEX_CORNERS; a++)
                ret_F[i][j] += u->at[a][i] * point->gradient[a][j];
        }
    }
}

static double column_dot(double A[3][3], int p, int q)
{
    return A[0][p] * A[0][q] + A[1][p] * A[1][q] + A[2][p] * A[2][q];
}

/* Makes columns p and q of A orthogonal by a plane rotation; false when they already are. */
static bool rotate_columns(double A[3][3], int p, int q)
{
    const double pp = column_dot(A, p, p), qq = column_dot(A, q, q), pq = column_dot(A, p, q);
    if (!(fabs(pq) > 1e-15 * sqrt(pp * qq))) return false;
    const double cot = (qq - pp) / (2 * pq); /* of twice the angle */
    const double t = copysign(1 / (fabs(cot) + sqrt(1 + cot * cot)), cot);
    const double c = 1 / sqrt(1 + t * t), s = c * t;
    for (int i = 0; i < 3; i++) {
        const double a = A[i][p], b = A[i][q];
        A[i][p] = c * a - s * b;
        A[i][q] = s * a + c * b;
    }
    return true;
}

static void sort_descending(double v[3])
{
    static const int pair[3][2] = {{0, 1}, {1, 2}, {0, 1}};
    for (int k = 0; k < 3; k++) {
        double *a = &v[pair[k][0]], *b = &v[pair[k][1]];
        if (*a >= *b) continue;
        const double larger = *b;
        *b = *a;
        *a = larger;
    }
}

void principal_stretches(double F[3][3], double ret_stretch[3])
{
    double A[3][3];
    bool rotated = true;
    memcpy(A, F, sizeof A);
    for (int sweep = 0; rotated && sweep < JACOBI_SWEEPS_MAX; sweep++) {
        rotated = rotate_columns(A, 0, 1);
        rotated = rotate_columns(A, 0, 2) || rotated;
        rotated = rotate_columns(A, 1, 2) || rotated;
    }
    for (int j = 0; j < 3; j++) ret_stretch[j] = sqrt(column_dot(A, j, j));
    sort_descending(ret_stretch);
}
