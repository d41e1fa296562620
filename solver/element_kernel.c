/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The element of element.h, LANES elements at once; compiled once for each width (meson.build).
 *
 * At each point F = U S V^T comes from the eigenvectors of F^T F. In the frames U and V the Hessian
 * of an isotropic energy is nearly diagonal (ogden.h), so that making it positive semi-definite is
 * a matter of six signs and one 3 x 3 block (Smith, De Goes and Kim 2019, "Analytic eigensystems
 * for isotropic distortion energies"). With D the Hessian in these frames and n_a = V^T dN_a,
 *   K_(i a)(k b) = sum_PQ n_Pa A_PQ(i, k) n_Qb,   A_PQ(i, k) = sum_pr U_ip D_pPrQ U_kr.
 * D has entries for (p, r) = (P, Q) and (Q, P) only, and for p = r where P = Q, so that turning
 * back no more than the side of U is much cheaper than turning both.
 */
#ifndef ELEMENT_KERNEL
#define ELEMENT_KERNEL base
#endif

#include "solver/eigen3_lanes.h"
#include "solver/element_batch.h"
#include "solver/ogden_lanes.h"

struct points {
    lanes F[HEX_RULE_POINTS][3][3], J[HEX_RULE_POINTS];
    lanes det_F_min, volume;
};

/* One point: F = U diag(s) V^T. */
struct frame {
    lanes U[3][3], V[3][3];
    struct ogden_terms law;
};

LANES_INLINE lanes det3(lanes F[3][3])
{
    return F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1]) -
           F[0][1] * (F[1][0] * F[2][2] - F[1][2] * F[2][0]) +
           F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
}

/* Here and below, `at` is the first of the lanes that are worked on. */
LANES_INLINE void deformation_gradient(const double dN[3][HEX_NODES][BATCH],
                                       const double u[HEX_NODES][3][BATCH], int at,
                                       lanes ret_F[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) ret_F[i][j] = lanes_all(i == j);
    for (int a = 0; a < HEX_NODES; a++)
        for (int j = 0; j < 3; j++) {
            const lanes gradient = lanes_load(dN[j][a] + at);
            for (int i = 0; i < 3; i++) ret_F[i][j] += lanes_load(u[a][i] + at) * gradient;
        }
}

LANES_INLINE void points_init(struct points *p, const struct element_batch *batch,
                              const struct element_batch_u *u, int at)
{
    p->det_F_min = lanes_all(HUGE_VAL);
    p->volume = lanes_all(0);
    for (int g = 0; g < HEX_RULE_POINTS; g++) {
        deformation_gradient(batch->dN[g], u->mm, at, p->F[g]);
        p->J[g] = det3(p->F[g]);
        p->det_F_min = lanes_min(p->det_F_min, p->J[g]);
    }
    for (int g = 0; g < HEX_POINTS; g++) p->volume += lanes_load(batch->weight[g] + at) * p->J[g];
}

/* v / V - 1 */
LANES_INLINE lanes dilatation(const struct points *p, const struct element_batch *batch, int at)
{
    return p->volume / lanes_load(batch->volume + at) - 1;
}

/* Eigenvectors of all F^T F. */
LANES_INLINE void decompose(struct points *p, struct eigen3 ret[HEX_RULE_POINTS])
{
    for (int g = 0; g < HEX_RULE_POINTS; g++) {
        lanes diagonal[3], off[3], (*F)[3] = p->F[g];
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            diagonal[k] = F[0][k] * F[0][k] + F[1][k] * F[1][k] + F[2][k] * F[2][k];
            off[k] = F[0][i] * F[0][j] + F[1][i] * F[1][j] + F[2][i] * F[2][j];
        }
        eigen3_init(&ret[g], diagonal, off);
    }
    for (int g = 0; g < HEX_RULE_POINTS; g += HEX_POINTS) eigen3_diagonalise(ret + g, HEX_POINTS);
}

LANES_INLINE void frame_init(struct frame *f, lanes F[3][3], const struct eigen3 *e)
{
    lanes s[3];
    eigen3_vectors(e, f->V);
    for (int k = 0; k < 3; k++) {
        /* |F v| is accurate even for a small stretch, where the root of the value may not be. */
        lanes square = lanes_all(0);
        for (int i = 0; i < 3; i++) {
            f->U[i][k] = F[i][0] * f->V[0][k] + F[i][1] * f->V[1][k] + F[i][2] * f->V[2][k];
            square += f->U[i][k] * f->U[i][k];
        }
        s[k] = lanes_sqrt(square);
    }
    ogden_terms_init(&f->law, s);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++) f->U[i][k] *= f->law.inverse[k];
}

/* The law's numbers at a point of the rule. */
struct point_law {
    lanes mu, kappa;
    lanes pressure_share; /* 1 where the mean dilatation is integrated: at the Gauss points */
};

LANES_INLINE struct point_law point_law(const struct element_batch *batch, int at, int g)
{
    const enum point_kind kind = g < HEX_POINTS ? POINT_GAUSS : POINT_CORNER;
    return (struct point_law){lanes_load(batch->mu_MPa[kind] + at),
                              lanes_load(batch->kappa_point_MPa[kind] + at),
                              lanes_all(kind == POINT_GAUSS)};
}

/* Energy density, the point's share of the volumetric energy included. */
LANES_INLINE lanes point_energy(const struct point_law *law, const struct frame *f, lanes J)
{
    return ogden_energy_lanes(law->mu, &f->law) + law->kappa * 0.5 * ((J - 1) * (J - 1));
}

/* The energy of the mean dilatation, added to that of the points; HUGE_VAL where det F <= 0. */
LANES_INLINE lanes whole_energy(const struct element_batch *batch, int at, const struct points *p,
                                lanes energy_of_points)
{
    const lanes d = dilatation(p, batch, at), V = lanes_load(batch->volume + at);
    const lanes mean = lanes_load(batch->kappa_mean_MPa + at) * 0.5 * (d * d) * V;
    return lanes_select(p->det_F_min > 0, energy_of_points + mean, lanes_all(HUGE_VAL));
}

/* --- derivatives ------------------------------------------------------------------------------ */

LANES_INLINE void load_gradients(const double dN[3][HEX_NODES][BATCH], int at,
                                 lanes ret[3][HEX_NODES])
{
    for (int j = 0; j < 3; j++)
        for (int a = 0; a < HEX_NODES; a++) ret[j][a] = lanes_load(dN[j][a] + at);
}

/* force_i += sum_j stress_ij n_j: what a stress at a point does to the nodes. */
LANES_INLINE void add_force(lanes stress[3][3], lanes n[3][HEX_NODES], lanes force[3][HEX_NODES])
{
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < HEX_NODES; a++)
            force[i][a] += stress[i][0] * n[0][a] + stress[i][1] * n[1][a] + stress[i][2] * n[2][a];
}

/* ret = factor det(F) F^-T */
LANES_INLINE void cofactor3(lanes F[3][3], lanes factor, lanes ret[3][3])
{
    for (int i = 0; i < 3; i++) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        for (int j = 0; j < 3; j++) {
            const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            ret[i][j] = factor * (F[i1][j1] * F[i2][j2] - F[i1][j2] * F[i2][j1]);
        }
    }
}

/* dv/du: det(F) F^-T is the stress of a unit pressure. */
LANES_INLINE void volume_gradient(const struct element_batch *batch, int at, struct points *p,
                                  lanes ret[3][HEX_NODES])
{
    memset(ret, 0, 3 * sizeof *ret);
    for (int g = 0; g < HEX_POINTS; g++) {
        lanes stress[3][3], dN[3][HEX_NODES];
        load_gradients(batch->dN[g], at, dN);
        cofactor3(p->F[g], lanes_load(batch->weight[g] + at), stress);
        add_force(stress, dN, ret);
    }
}

/* First row of an entry of the lower triangle, row by row. */
LANES_INLINE int row_start(int row) { return row * (row + 1) / 2; }

/* stiffness = factor (dv/du) (dv/du)^T: what the mean dilatation adds, first of all. */
LANES_INLINE void start_stiffness(lanes factor, lanes dv[3][HEX_NODES], int at,
                                  double stiffness[HEX_ENTRIES][BATCH])
{
    const lanes *q = dv[0];
    for (int i = 0; i < HEX_DOFS; i++) {
        const lanes scaled = factor * q[i];
        for (int j = 0; j <= i; j++) lanes_store(stiffness[row_start(i) + j] + at, scaled * q[j]);
    }
}

/* Raises the negative eigenvalues towards zero: all the way at convexity 1. */
LANES_INLINE void convexify(struct ogden_tangent *d, double convexity)
{
    struct eigen3 e;
    lanes vector[3][3];
    eigen3_init(&e, d->normal, d->mixed);
    eigen3_diagonalise(&e, 1);
    eigen3_vectors(&e, vector);
    for (int k = 0; k < 3; k++) {
        d->even[k] += convexity * lanes_max(lanes_all(0), -d->even[k]);
        d->odd[k] += convexity * lanes_max(lanes_all(0), -d->odd[k]);
    }
    for (int v = 0; v < 3; v++) {
        const lanes lift = convexity * lanes_max(lanes_all(0), -e.diagonal[v] * e.scale);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            d->normal[k] += lift * (vector[k][v] * vector[k][v]);
            d->mixed[k] += lift * (vector[i][v] * vector[j][v]);
        }
    }
}

/* Derivatives at the tracked pressure, with the volumetric law of the point. */
LANES_INLINE void point_tangent(const struct point_law *law, lanes pressure, double convexity,
                                const struct ogden_terms *terms, lanes J, struct ogden_tangent *ret)
{
    ogden_tangent(law->mu, law->pressure_share * pressure + law->kappa * (J - 1), terms, ret);
    const lanes bulk = law->kappa * J * J;
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        ret->normal[k] += bulk * (terms->inverse[k] * terms->inverse[k]);
        ret->mixed[k] += bulk * (terms->inverse[i] * terms->inverse[j]);
    }
    if (convexity > 0) convexify(ret, convexity);
}

LANES_INLINE void frame_gradients(const double dN[3][HEX_NODES][BATCH], int at, lanes V[3][3],
                                  lanes ret[3][HEX_NODES])
{
    for (int a = 0; a < HEX_NODES; a++) {
        const lanes x = lanes_load(dN[0][a] + at), y = lanes_load(dN[1][a] + at);
        const lanes z = lanes_load(dN[2][a] + at);
        for (int j = 0; j < 3; j++) ret[j][a] = V[0][j] * x + V[1][j] * y + V[2][j] * z;
    }
}

/* ret_iQ = weight U_iQ g_Q: between U and V, as n = V^T dN wants it. */
LANES_INLINE void frame_stress(lanes U[3][3], const lanes g[3], lanes weight, lanes ret[3][3])
{
    for (int q = 0; q < 3; q++) {
        const lanes weighted = weight * g[q];
        for (int i = 0; i < 3; i++) ret[i][q] = weighted * U[i][q];
    }
}

/* ret[P][Q] = weight * A_PQ(i, k) */
LANES_INLINE void turned_tangent(const struct ogden_tangent *d, lanes U[3][3], lanes weight, int i,
                                 int k, lanes ret[3][3])
{
    lanes same[3], cross[3];
    for (int r = 0; r < 3; r++) {
        same[r] = (d->even[r] + d->odd[r]) * 0.5;
        cross[r] = (d->even[r] - d->odd[r]) * 0.5;
    }
    for (int r = 0; r < 3; r++) {
        const int p = (r + 1) % 3, q = (r + 2) % 3;
        const lanes pq = weight * (U[i][p] * U[k][q]), qp = weight * (U[i][q] * U[k][p]);
        ret[r][r] = weight * (d->normal[r] * (U[i][r] * U[k][r]) + same[q] * (U[i][p] * U[k][p]) +
                              same[p] * (U[i][q] * U[k][q]));
        ret[p][q] = d->mixed[r] * pq + cross[r] * qp;
        ret[q][p] = d->mixed[r] * qp + cross[r] * pq;
    }
}

/* ret_Q = sum_P n_P A_PQ of node a. */
LANES_INLINE void left_product(lanes A[3][3], lanes n[3][HEX_NODES], int a, lanes ret[3])
{
    for (int q = 0; q < 3; q++) ret[q] = n[0][a] * A[0][q] + n[1][a] * A[1][q] + n[2][a] * A[2][q];
}

/* Adds left . n_b to the first columns of a row. */
LANES_INLINE void add_row(const lanes left[3], lanes n[3][HEX_NODES], int columns, int at,
                          double row[][BATCH])
{
    for (int b = 0; b < columns; b++)
        lanes_store(row[b] + at, lanes_load(row[b] + at) +
                                     (left[0] * n[0][b] + left[1] * n[1][b] + left[2] * n[2][b]));
}

/* Rows (i, a), columns (k, b) of the lower triangle: all where i > k, b <= a where i = k. */
LANES_INLINE void add_stiffness(const struct ogden_tangent *d, lanes U[3][3], lanes weight,
                                lanes n[3][HEX_NODES], int at, double stiffness[HEX_ENTRIES][BATCH])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k <= i; k++) {
            lanes A[3][3], left[3];
            turned_tangent(d, U, weight, i, k, A);
            for (int a = 0; a < HEX_NODES; a++) {
                left_product(A, n, a, left);
                double(*row)[BATCH] = stiffness + row_start(i * HEX_NODES + a) + k * HEX_NODES;
                add_row(left, n, i == k ? a + 1 : HEX_NODES, at, row);
            }
        }
}

LANES_INLINE void store_vector(lanes x[3][HEX_NODES], int at, double ret[3][HEX_NODES][BATCH])
{
    for (int c = 0; c < 3; c++)
        for (int a = 0; a < HEX_NODES; a++) lanes_store(ret[c][a] + at, x[c][a]);
}

/* --- entry points ----------------------------------------------------------------------------- */

static void kernel_volume(const struct element_batch *batch, const struct element_batch_u *u,
                          struct element_batch_volume *ret)
{
    for (int at = 0; at < BATCH; at += LANES) {
        struct points p;
        points_init(&p, batch, u, at);
        lanes_store(ret->pressure_MPa + at,
                    lanes_load(batch->kappa_mean_MPa + at) * dilatation(&p, batch, at));
        lanes_store(ret->det_F_min + at, p.det_F_min);
    }
}

static void kernel_energy(const struct element_batch *batch, const struct element_batch_u *u,
                          double ret_energy[BATCH])
{
    for (int at = 0; at < BATCH; at += LANES) {
        struct points p;
        struct eigen3 eigen[HEX_RULE_POINTS];
        lanes energy = lanes_all(0);
        points_init(&p, batch, u, at);
        decompose(&p, eigen);
        for (int g = 0; g < HEX_RULE_POINTS; g++) {
            const struct point_law law = point_law(batch, at, g);
            struct frame f;
            frame_init(&f, p.F[g], &eigen[g]);
            energy += lanes_load(batch->weight[g] + at) * point_energy(&law, &f, p.J[g]);
        }
        lanes_store(ret_energy + at, whole_energy(batch, at, &p, energy));
    }
}

/* The LANES elements from `at` on. */
LANES_INLINE void linearise(const struct element_batch *batch, const struct element_batch_u *u,
                            const struct element_batch_tangent *tangent, int at,
                            struct element_batch_derivatives *ret, double ret_energy[BATCH])
{
    struct points p;
    struct eigen3 eigen[HEX_RULE_POINTS];
    lanes energy = lanes_all(0), force[3][HEX_NODES] = {{{0}}}, dv[3][HEX_NODES];
    const lanes mean_kappa = lanes_load(batch->kappa_mean_MPa + at);
    points_init(&p, batch, u, at);
    decompose(&p, eigen);
    volume_gradient(batch, at, &p, dv);
    start_stiffness(mean_kappa / lanes_load(batch->volume + at), dv, at, ret->stiffness);
    const lanes pressure = mean_kappa * dilatation(&p, batch, at);
    const lanes tracked = lanes_load(tangent->pressure_MPa + at);
    for (int g = 0; g < HEX_RULE_POINTS; g++) {
        const struct point_law law = point_law(batch, at, g);
        struct frame f;
        struct ogden_tangent d;
        lanes n[3][HEX_NODES], gradient[3], stress[3][3];
        const lanes weight = lanes_load(batch->weight[g] + at);
        frame_init(&f, p.F[g], &eigen[g]);
        frame_gradients(batch->dN[g], at, f.V, n);
        energy += weight * point_energy(&law, &f, p.J[g]);
        ogden_gradient(law.mu, law.pressure_share * pressure + law.kappa * (p.J[g] - 1), &f.law,
                       gradient);
        frame_stress(f.U, gradient, weight, stress);
        add_force(stress, n, force);
        point_tangent(&law, tracked, tangent->convexity, &f.law, p.J[g], &d);
        add_stiffness(&d, f.U, weight, n, at, ret->stiffness);
    }
    store_vector(force, at, ret->force);
    store_vector(dv, at, ret->volume_gradient);
    lanes_store(ret->pressure_MPa + at, pressure);
    lanes_store(ret_energy + at, whole_energy(batch, at, &p, energy));
}

static void kernel_linearise(const struct element_batch *batch, const struct element_batch_u *u,
                             const struct element_batch_tangent *tangent,
                             struct element_batch_derivatives *ret, double ret_energy[BATCH])
{
    for (int at = 0; at < BATCH; at += LANES) linearise(batch, u, tangent, at, ret, ret_energy);
}

#define KERNEL_OF(width) element_kernel_##width
#define NAME_OF(width)   #width
#define KERNEL(width)    KERNEL_OF(width)
#define NAME(width)      NAME_OF(width)

const struct element_kernel KERNEL(ELEMENT_KERNEL) = {.name = NAME(ELEMENT_KERNEL),
                                                      .volume = kernel_volume,
                                                      .energy = kernel_energy,
                                                      .linearise = kernel_linearise};
