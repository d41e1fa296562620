/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/element.h"

#include <math.h>
#include <string.h>

#include "solver/element_batch.h"

/* Corner signs of the reference cube in VTK order. */
static const double corner[HEX_NODES][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                                            {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};

static double det3(double F[3][3])
{
    return F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1]) -
           F[0][1] * (F[1][0] * F[2][2] - F[1][2] * F[2][0]) +
           F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
}

/* ret = det(A) A^-T. */
static void cofactor3(double A[3][3], double ret[3][3])
{
    for (int i = 0; i < 3; i++) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        for (int j = 0; j < 3; j++) {
            const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            ret[i][j] = A[i1][j1] * A[i2][j2] - A[i1][j2] * A[i2][j1];
        }
    }
}

static void local_gradients(const double xi[3], double ret[3][HEX_NODES])
{
    for (int a = 0; a < HEX_NODES; a++) {
        const double f[3] = {1 + corner[a][0] * xi[0], 1 + corner[a][1] * xi[1],
                             1 + corner[a][2] * xi[2]};
        for (int k = 0; k < 3; k++) ret[k][a] = corner[a][k] * f[(k + 1) % 3] * f[(k + 2) % 3] / 8;
    }
}

/* The points of the rule: the Gauss points lie in the octants of the corners. */
static void point_place(int g, double ret_xi[3])
{
    const double shrink = g < HEX_POINTS ? 1 / sqrt(3.0) : 1;
    for (int k = 0; k < 3; k++) ret_xi[k] = corner[g % HEX_NODES][k] * shrink;
}

/* Sets the gradients and the weight of point g. */
static void point_init(struct element_reference *ret, const double X[HEX_NODES][3], int g)
{
    double xi[3], local[3][HEX_NODES], jacobian[3][3] = {{0}}, cofactor[3][3];
    point_place(g, xi);
    local_gradients(xi, local);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < HEX_NODES; a++) jacobian[i][k] += X[a][i] * local[k][a];
    const double det = det3(jacobian);
    cofactor3(jacobian, cofactor);
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < HEX_NODES; a++)
            ret->dN[g][i][a] = (cofactor[i][0] * local[0][a] + cofactor[i][1] * local[1][a] +
                                cofactor[i][2] * local[2][a]) /
                               det;
    ret->weight[g] = det;
}

/* Sum of the weights of the Gauss points, or of the corners. */
static double weight_of(const struct element_reference *ref, int first)
{
    double sum = 0;
    for (int g = first; g < first + HEX_POINTS; g++) sum += ref->weight[g];
    return sum;
}

/* The mean of a gradient over the Gauss points, or over the corners. */
static double mean_gradient(const struct element_reference *ref, int first, int i, int a)
{
    double sum = 0;
    for (int g = first; g < first + HEX_POINTS; g++) sum += ref->weight[g] * ref->dN[g][i][a];
    return sum / weight_of(ref, first);
}

/*
 * On distorted elements the corners neither weigh what the element does nor have its mean
 * gradients, which the Gauss points integrate exactly. Both are put right, the gradients by a
 * constant, so that affine deformations stay exact and a patch of distorted elements stays without
 * inner forces.
 */
static void correct_corners(struct element_reference *ref)
{
    const double scale = ref->volume / weight_of(ref, HEX_POINTS);
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < HEX_NODES; a++) {
            const double shift = mean_gradient(ref, 0, i, a) - mean_gradient(ref, HEX_POINTS, i, a);
            for (int g = HEX_POINTS; g < HEX_RULE_POINTS; g++) ref->dN[g][i][a] += shift;
        }
    for (int g = HEX_POINTS; g < HEX_RULE_POINTS; g++) ref->weight[g] *= scale;
}

void element_reference_init(struct element_reference *ret, const double X[HEX_NODES][3])
{
    for (int g = 0; g < HEX_RULE_POINTS; g++) point_init(ret, X, g);
    ret->volume = weight_of(ret, 0);
    correct_corners(ret);
}

/* --- one element: a batch of its copies ------------------------------------------------------- */

static void copy_to_lanes(const double *from, int count, double (*ret)[BATCH])
{
    for (int k = 0; k < count; k++)
        for (int l = 0; l < BATCH; l++) ret[k][l] = from[k];
}

static void first_lane(double (*from)[BATCH], int count, double *ret)
{
    for (int k = 0; k < count; k++) ret[k] = from[k][0];
}

static void copies_init(struct element_batch *ret_batch, struct element_batch_u *ret_u,
                        const struct element_reference *ref, const struct element_material *m,
                        const double u[HEX_NODES][3])
{
    for (int l = 0; l < BATCH; l++) element_batch_set(ret_batch, l, ref, m);
    copy_to_lanes(u[0], HEX_DOFS, ret_u->mm[0]);
}

double element_det_F_min(const struct element_reference *ref, const double u[HEX_NODES][3])
{
    struct element_batch batch;
    struct element_batch_u lanes;
    struct element_batch_volume volume;
    copies_init(&batch, &lanes, ref, &(struct element_material){0}, u);
    element_kernel(0)->volume(&batch, &lanes, &volume);
    return volume.det_F_min[0];
}

/* From the lower triangle by rows to the whole. */
static void unpack_stiffness(double (*from)[BATCH], double ret[HEX_DOFS][HEX_DOFS])
{
    for (int i = 0, k = 0; i < HEX_DOFS; i++)
        for (int j = 0; j <= i; j++, k++) ret[i][j] = ret[j][i] = from[k][0];
}

double element_energy(const struct element_reference *ref, const struct element_material *m,
                      const double u[HEX_NODES][3], const struct element_tangent *tangent,
                      struct element_derivatives *ret)
{
    const struct element_kernel *kernel = element_kernel(0);
    struct element_batch batch;
    struct element_batch_u lanes;
    struct element_batch_tangent tangents = {.convexity = tangent != NULL ? tangent->convexity : 0};
    struct element_batch_derivatives d;
    BATCH_ALIGNED double energy[BATCH];
    copies_init(&batch, &lanes, ref, m, u);
    if (ret == NULL) {
        kernel->energy(&batch, &lanes, energy);
        return energy[0];
    }
    for (int l = 0; l < BATCH && tangent != NULL; l++)
        tangents.pressure_MPa[l] = tangent->pressure_MPa;
    kernel->linearise(&batch, &lanes, &tangents, &d, energy);
    memset(ret, 0, sizeof *ret);
    first_lane(d.force[0], HEX_DOFS, ret->force[0]);
    ret->pressure_MPa = d.pressure_MPa[0];
    if (tangent == NULL) return energy[0];
    first_lane(d.volume_gradient[0], HEX_DOFS, ret->volume_gradient[0]);
    unpack_stiffness(d.stiffness, ret->stiffness);
    return energy[0];
}
