/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * At each point F = U S V^T comes from the eigenvectors of F^T F. In the frames U and V the Hessian
 * of an isotropic energy is nearly diagonal (ogden.h), so that making it positive semi-definite is
 * a matter of six signs and one 3 x 3 block (Smith, De Goes and Kim 2019, "Analytic eigensystems
 * for isotropic distortion energies").
 */
#include "solver/element.h"

#include <math.h>
#include <string.h>

#include "solver/eigen3.h"
#include "solver/ogden.h"

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

void element_reference_init(struct element_reference *ret, const double X[HEX_NODES][3])
{
    ret->volume = 0;
    for (int g = 0; g < HEX_POINTS; g++) {
        double xi[3], local[3][HEX_NODES], jacobian[3][3] = {{0}}, cofactor[3][3];
        for (int k = 0; k < 3; k++) xi[k] = corner[g][k] / sqrt(3.0);
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
        ret->volume += det;
    }
}

static void deformation_gradient(const double dN[3][HEX_NODES], const double u[HEX_NODES][3],
                                 double ret_F[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double sum = i == j;
            for (int a = 0; a < HEX_NODES; a++) sum += u[a][i] * dN[j][a];
            ret_F[i][j] = sum;
        }
}

double element_det_F_min(const struct element_reference *ref, const double u[HEX_NODES][3])
{
    double smallest = HUGE_VAL;
    for (int g = 0; g < HEX_POINTS; g++) {
        double F[3][3];
        deformation_gradient(ref->dN[g], u, F);
        smallest = fmin(smallest, det3(F));
    }
    return smallest;
}

/* One integration point: F = U diag(s) V^T. */
struct point {
    double F[3][3], U[3][3], V[3][3], s[3], J;
};

static void decompose(struct point *p)
{
    double C[3][3], value[3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            C[i][j] = p->F[0][i] * p->F[0][j] + p->F[1][i] * p->F[1][j] + p->F[2][i] * p->F[2][j];
    eigen3((const double(*)[3])C, value, p->V);
    for (int k = 0; k < 3; k++) {
        /* |F v| is accurate even for a small stretch, where sqrt(value) may not be. */
        double n2 = 0;
        for (int i = 0; i < 3; i++) {
            p->U[i][k] =
                p->F[i][0] * p->V[0][k] + p->F[i][1] * p->V[1][k] + p->F[i][2] * p->V[2][k];
            n2 += p->U[i][k] * p->U[i][k];
        }
        p->s[k] = sqrt(n2);
        for (int i = 0; i < 3; i++) p->U[i][k] /= p->s[k];
    }
}

/* Raises the negative eigenvalues towards zero: all the way at convexity 1. */
static void convexify(struct ogden_derivatives *d, double convexity)
{
    double value[3], vector[3][3];
    for (int k = 0; k < 3; k++) {
        d->even[k] += convexity * fmax(0, -d->even[k]);
        d->odd[k] += convexity * fmax(0, -d->odd[k]);
    }
    eigen3((const double(*)[3])d->normal, value, vector);
    for (int k = 0; k < 3; k++) {
        const double lift = convexity * fmax(0, -value[k]);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) d->normal[i][j] += lift * vector[i][k] * vector[j][k];
    }
}

static void add_force(const struct point *p, const double gradient[3], double weight,
                      const double dN[3][HEX_NODES], double force[3][HEX_NODES])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const double stress = weight * (p->U[i][0] * gradient[0] * p->V[j][0] +
                                            p->U[i][1] * gradient[1] * p->V[j][1] +
                                            p->U[i][2] * gradient[2] * p->V[j][2]);
            for (int a = 0; a < HEX_NODES; a++) force[i][a] += stress * dN[j][a];
        }
}

/* stiffness += sum over rows r of B[r]^T G[r]. */
static void add_outer(int rows, const double B[][HEX_DOFS], const double G[][HEX_DOFS],
                      double stiffness[HEX_DOFS][HEX_DOFS])
{
    for (int r = 0; r < rows; r++)
        for (int i = 0; i < HEX_DOFS; i++) {
            const double b = B[r][i];
            for (int j = 0; j < HEX_DOFS; j++) stiffness[i][j] += b * G[r][j];
        }
}

/* Rows of B: the nine components of dF in the frames U, V, as functions of the displacements. */
static void frame_rows(const struct point *p, const double dN[3][HEX_NODES],
                       double ret[9][HEX_DOFS])
{
    double n[3][HEX_NODES];
    for (int j = 0; j < 3; j++)
        for (int a = 0; a < HEX_NODES; a++)
            n[j][a] = p->V[0][j] * dN[0][a] + p->V[1][j] * dN[1][a] + p->V[2][j] * dN[2][a];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int c = 0; c < 3; c++)
                for (int a = 0; a < HEX_NODES; a++)
                    ret[3 * i + j][c * HEX_NODES + a] = p->U[c][i] * n[j][a];
}

static void add_stiffness(const struct point *p, const struct ogden_derivatives *d, double weight,
                          const double dN[3][HEX_NODES], double stiffness[HEX_DOFS][HEX_DOFS])
{
    double B[9][HEX_DOFS], G[9][HEX_DOFS];
    frame_rows(p, dN, B);
    for (int q = 0; q < HEX_DOFS; q++) {
        for (int i = 0; i < 3; i++)
            G[4 * i][q] = weight * (d->normal[i][0] * B[0][q] + d->normal[i][1] * B[4][q] +
                                    d->normal[i][2] * B[8][q]);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3, ij = 3 * i + j, ji = 3 * j + i;
            const double same = weight * (d->even[k] + d->odd[k]) / 2;
            const double cross = weight * (d->even[k] - d->odd[k]) / 2;
            G[ij][q] = same * B[ij][q] + cross * B[ji][q];
            G[ji][q] = same * B[ji][q] + cross * B[ij][q];
        }
    }
    add_outer(9, (const double(*)[HEX_DOFS])B, (const double(*)[HEX_DOFS])G, stiffness);
}

/* stiffness += factor * (dv/du) (dv/du)^T */
static void add_dilatation(double factor, const double dv[3][HEX_NODES],
                           double stiffness[HEX_DOFS][HEX_DOFS])
{
    double B[1][HEX_DOFS], G[1][HEX_DOFS];
    memcpy(B, dv, sizeof B);
    for (int q = 0; q < HEX_DOFS; q++) G[0][q] = factor * B[0][q];
    add_outer(1, (const double(*)[HEX_DOFS])B, (const double(*)[HEX_DOFS])G, stiffness);
}

/* Fills the points' F and J and returns the deformed volume, or a negative number when inverted. */
static double points_init(struct point p[HEX_POINTS], const struct element_reference *ref,
                          const double u[HEX_NODES][3])
{
    double volume = 0;
    for (int g = 0; g < HEX_POINTS; g++) {
        deformation_gradient(ref->dN[g], u, p[g].F);
        p[g].J = det3(p[g].F);
        if (!(p[g].J > 0)) return -1;
        volume += ref->weight[g] * p[g].J;
    }
    return volume;
}

static double points_energy(struct point p[HEX_POINTS], const struct element_reference *ref,
                            const struct element_material *m)
{
    double energy = 0;
    for (int g = 0; g < HEX_POINTS; g++) {
        const double dJ = p[g].J - 1;
        decompose(&p[g]);
        energy +=
            ref->weight[g] * (ogden_energy(m->mu_MPa, p[g].s) + m->kappa_point_MPa / 2 * dJ * dJ);
    }
    return energy;
}

static void add_point_dilatation(const struct point *p, double kappa_point,
                                 struct ogden_derivatives *d)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            d->normal[i][j] += kappa_point * p->J * p->J / (p->s[i] * p->s[j]);
}

static void add_point_stiffness(const struct point *p, const struct element_material *m,
                                const struct element_tangent *tangent, double weight,
                                const double dN[3][HEX_NODES], struct element_derivatives *ret)
{
    struct ogden_derivatives d;
    const double J_over_s[3] = {p->J / p->s[0], p->J / p->s[1], p->J / p->s[2]};
    add_force(p, J_over_s, weight, dN, ret->volume_gradient);
    ogden_derivatives(m->mu_MPa, tangent->pressure_MPa + m->kappa_point_MPa * (p->J - 1), p->s, &d);
    add_point_dilatation(p, m->kappa_point_MPa, &d);
    if (tangent->convexity > 0) convexify(&d, tangent->convexity);
    add_stiffness(p, &d, weight, dN, ret->stiffness);
}

double element_energy(const struct element_reference *ref, const struct element_material *m,
                      const double u[HEX_NODES][3], const struct element_tangent *tangent,
                      struct element_derivatives *ret)
{
    struct point p[HEX_POINTS];
    const double v = points_init(p, ref, u);
    if (v < 0) return HUGE_VAL;
    const double mean_kappa = m->kappa_MPa - m->kappa_point_MPa;
    const double dilatation = v / ref->volume - 1;
    const double energy =
        points_energy(p, ref, m) + mean_kappa / 2 * dilatation * dilatation * ref->volume;
    if (ret == NULL) return energy;
    memset(ret, 0, sizeof *ret);
    ret->pressure_MPa = mean_kappa * dilatation;
    for (int g = 0; g < HEX_POINTS; g++) {
        struct ogden_derivatives d;
        const double pressure = ret->pressure_MPa + m->kappa_point_MPa * (p[g].J - 1);
        ogden_derivatives(m->mu_MPa, pressure, p[g].s, &d);
        add_force(&p[g], d.gradient, ref->weight[g], ref->dN[g], ret->force);
        if (tangent != NULL)
            add_point_stiffness(&p[g], m, tangent, ref->weight[g], ref->dN[g], ret);
    }
    if (tangent != NULL)
        add_dilatation(mean_kappa / ref->volume, (const double(*)[HEX_NODES])ret->volume_gradient,
                       ret->stiffness);
    return energy;
}
