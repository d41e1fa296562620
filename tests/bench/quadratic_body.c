/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * body.h with other elements, linked in its place: hexahedra of 27 nodes with a discontinuous
 * linear pressure (Q2/P1, inf-sup stable and of third order; Boffi, Brezzi and Fortin 2013, section
 * 8.7), condensed out as the mean dilatation is in element.h:
 *
 *     E(u) = sum_g w_g W(F_g) + kappa / 2 sum_a t_a^2,    t_a = sum_g w_g phi_a(g) (J_g - 1),
 *
 * over 3 x 3 x 3 Gauss points, with phi_0 ... phi_3 orthonormal in the unloaded element and
 * spanning 1, xi, eta, zeta. The pressure at a point is kappa sum_a t_a phi_a; the four kappa t_a
 * are what body->pressure_MPa tracks. The nodes are the mesh's own, so that contact and the
 * readings on the axis are those of the 8-node elements. Written to be read: plain loops, which the
 * compiler makes wide where it can.
 *
 * assembly_init comes here by --wrap, for the equations of 27 nodes act on each other, and
 * mesh_local_init, for their inner nodes must lie in the middles.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/body.h"
#include "solver/eigen3.h"
#include "solver/ogden.h"
#include "tests/bench/blocks.h"

enum { GAUSS = 27, DOFS = 3 * BLOCK_NODES, PRESSURES = 4 };

#if defined __x86_64__ && defined __GNUC__ && !defined __clang__
#define WIDE __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define WIDE
#endif

struct quadratic {
    int node[BLOCK_NODES];
    double dN[GAUSS][3][BLOCK_NODES]; /* 1/mm */
    double weight[GAUSS];             /* mm3  */
    double phi[GAUSS][PRESSURES];
    double mu_MPa, kappa_MPa;
    double rate[PRESSURES][DOFS]; /* dt/du at the last Hessian */
    double there_MPa[PRESSURES];  /* kappa t back then         */
};

/* The elements are kept where the batches of others are. */
static struct quadratic *elements_of(const struct body *body)
{
    return (struct quadratic *)(void *)body->batch;
}

/* --- reference -------------------------------------------------------------------------------- */

static double det3(double F[3][3])
{
    return F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1]) -
           F[0][1] * (F[1][0] * F[2][2] - F[1][2] * F[2][0]) +
           F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
}

static void cofactor3(double A[3][3], double ret[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            ret[i][j] = A[i1][j1] * A[i2][j2] - A[i1][j2] * A[i2][j1];
        }
}

static void shapes_1d(double x, double ret_N[3], double ret_dN[3])
{
    ret_N[0] = x * (x - 1) / 2;
    ret_N[1] = 1 - x * x;
    ret_N[2] = x * (x + 1) / 2;
    ret_dN[0] = x - 0.5;
    ret_dN[1] = -2 * x;
    ret_dN[2] = x + 0.5;
}

static void local_gradients(const double xi[3], double ret[3][BLOCK_NODES])
{
    double N[3][3], dN[3][3];
    for (int d = 0; d < 3; d++) shapes_1d(xi[d], N[d], dN[d]);
    for (int a = 0; a < BLOCK_NODES; a++) {
        const int i = a % 3, j = a / 3 % 3, k = a / 9;
        ret[0][a] = dN[0][i] * N[1][j] * N[2][k];
        ret[1][a] = N[0][i] * dN[1][j] * N[2][k];
        ret[2][a] = N[0][i] * N[1][j] * dN[2][k];
    }
}

/* Gradients, weight and the powers of xi, not orthonormal yet, at a point. */
static void point_init(struct quadratic *q, const struct mesh *mesh, int g)
{
    static const double place[3] = {-0.7745966692414834, 0, 0.7745966692414834};
    static const double weight[3] = {5.0 / 9, 8.0 / 9, 5.0 / 9};
    const int at[3] = {g % 3, g / 3 % 3, g / 9};
    const double xi[3] = {place[at[0]], place[at[1]], place[at[2]]};
    double local[3][BLOCK_NODES], jacobian[3][3] = {{0}}, cofactor[3][3];
    local_gradients(xi, local);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < BLOCK_NODES; a++)
                jacobian[i][k] += mesh->X_mm[q->node[a]][i] * local[k][a];
    const double det = det3(jacobian);
    cofactor3(jacobian, cofactor);
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < BLOCK_NODES; a++)
            q->dN[g][i][a] = (cofactor[i][0] * local[0][a] + cofactor[i][1] * local[1][a] +
                              cofactor[i][2] * local[2][a]) /
                             det;
    q->weight[g] = det * weight[at[0]] * weight[at[1]] * weight[at[2]];
    q->phi[g][0] = 1;
    for (int d = 0; d < 3; d++) q->phi[g][d + 1] = xi[d];
}

static double phi_product(const struct quadratic *q, int a, int b)
{
    double sum = 0;
    for (int g = 0; g < GAUSS; g++) sum += q->weight[g] * q->phi[g][a] * q->phi[g][b];
    return sum;
}

/* Gram and Schmidt's. */
static void make_orthonormal(struct quadratic *q)
{
    for (int a = 0; a < PRESSURES; a++) {
        for (int b = 0; b < a; b++) {
            const double share = phi_product(q, a, b);
            for (int g = 0; g < GAUSS; g++) q->phi[g][a] -= share * q->phi[g][b];
        }
        const double norm = sqrt(phi_product(q, a, a));
        for (int g = 0; g < GAUSS; g++) q->phi[g][a] /= norm;
    }
}

static void quadratic_init(struct quadratic *q, const struct mesh *mesh, const struct block *block,
                           const struct element_material *material)
{
    memcpy(q->node, block->node, sizeof q->node);
    q->mu_MPa = material->mu_MPa;
    q->kappa_MPa = material->kappa_MPa;
    for (int g = 0; g < GAUSS; g++) point_init(q, mesh, g);
    make_orthonormal(q);
}

enum ischia_code body_init(struct body *ret, const struct mesh *mesh,
                           const struct element_material material[TISSUE_COUNT],
                           struct ischia_error *err)
{
    struct body b = {.mesh = mesh};
    int count = 0;
    struct block *block = blocks_of(mesh, &count);
    CHECK(block != NULL, err, ISCHIA_E_MEMORY, "no blocks of 2 x 2 x 2 elements");
    memcpy(b.material, material, sizeof b.material);
    b.batch_count = (count * PRESSURES + BATCH - 1) / BATCH; /* what pressure_MPa is long by */
    struct quadratic *element = calloc((size_t)count, sizeof *element);
    b.batch = (struct element_batch *)(void *)element;
    b.pressure_MPa = calloc((size_t)b.batch_count * BATCH, sizeof *b.pressure_MPa);
    if (b.batch == NULL || b.pressure_MPa == NULL) {
        free(block);
        body_finish(&b);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the elements");
    }
    for (int e = 0; e < count; e++)
        quadratic_init(&element[e], mesh, &block[e], &material[block[e].tissue]);
    free(block);
    *ret = b;
    return ISCHIA_OK;
}

void body_finish(struct body *body)
{
    free(body->batch);
    free(body->pressure_MPa);
    *body = (struct body){0};
}

static int element_count(const struct body *body)
{
    return body->mesh->element_count / BLOCK_HEXES;
}

enum ischia_code __real_mesh_local_init(struct mesh *, const struct ischia_case *,
                                        const struct mesh_divisions *, struct ischia_error *);
enum ischia_code __wrap_mesh_local_init(struct mesh *ret, const struct ischia_case *c,
                                        const struct mesh_divisions *divisions,
                                        struct ischia_error *err);
enum ischia_code __wrap_mesh_local_init(struct mesh *ret, const struct ischia_case *c,
                                        const struct mesh_divisions *divisions,
                                        struct ischia_error *err)
{
    int count = 0;
    TRY(__real_mesh_local_init(ret, c, divisions, err));
    struct block *block = blocks_of(ret, &count);
    CHECK(block != NULL, err, ISCHIA_E_MEMORY, "no blocks of 2 x 2 x 2 elements");
    blocks_straighten(ret, block, count);
    free(block);
    return ISCHIA_OK;
}

enum ischia_code __wrap_assembly_init(struct assembly *ret, const struct mesh *mesh,
                                      struct ischia_error *err);
enum ischia_code __wrap_assembly_init(struct assembly *ret, const struct mesh *mesh,
                                      struct ischia_error *err)
{
    int count = 0;
    struct block *block = blocks_of(mesh, &count);
    CHECK(block != NULL, err, ISCHIA_E_MEMORY, "no blocks of 2 x 2 x 2 elements");
    int(*node)[BLOCK_NODES] = calloc((size_t)count, sizeof *node);
    for (int e = 0; node != NULL && e < count; e++) memcpy(node[e], block[e].node, sizeof node[e]);
    free(block);
    CHECK(node != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the elements' nodes");
    const struct connectivity c = {count, BLOCK_NODES, &node[0][0]};
    const enum ischia_code code = assembly_init_elements(ret, mesh, &c, err);
    free(node);
    return code;
}

/* --- one element ------------------------------------------------------------------------------ */

struct state {
    double u[3][BLOCK_NODES];
    double F[GAUSS][3][3], J[GAUSS];
    double pressure_MPa[PRESSURES]; /* kappa t */
    double det_F_min;
};

static void deform(struct state *s, const struct quadratic *q, const double (*u)[3])
{
    s->det_F_min = HUGE_VAL;
    memset(s->pressure_MPa, 0, sizeof s->pressure_MPa);
    for (int a = 0; a < BLOCK_NODES; a++)
        for (int i = 0; i < 3; i++) s->u[i][a] = u[q->node[a]][i];
    for (int g = 0; g < GAUSS; g++) {
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                double sum = i == j;
                for (int a = 0; a < BLOCK_NODES; a++) sum += s->u[i][a] * q->dN[g][j][a];
                s->F[g][i][j] = sum;
            }
        s->J[g] = det3(s->F[g]);
        s->det_F_min = fmin(s->det_F_min, s->J[g]);
        for (int a = 0; a < PRESSURES; a++)
            s->pressure_MPa[a] += q->kappa_MPa * q->weight[g] * q->phi[g][a] * (s->J[g] - 1);
    }
}

/* F = U diag(s) V^T */
struct frame {
    double U[3][3], V[3][3], stretch[3];
};

static void frame_init(struct frame *f, double F[3][3])
{
    double C[3][3] = {{0}}, value[3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++) C[i][j] += F[k][i] * F[k][j];
    eigen3((const double(*)[3])C, value, f->V);
    for (int k = 0; k < 3; k++) {
        double square = 0;
        for (int i = 0; i < 3; i++) {
            f->U[i][k] = F[i][0] * f->V[0][k] + F[i][1] * f->V[1][k] + F[i][2] * f->V[2][k];
            square += f->U[i][k] * f->U[i][k];
        }
        f->stretch[k] = sqrt(square);
        for (int i = 0; i < 3; i++) f->U[i][k] /= f->stretch[k];
    }
}

static double volume_energy(const struct quadratic *q, const struct state *s)
{
    double sum = 0;
    for (int a = 0; a < PRESSURES; a++) sum += s->pressure_MPa[a] * s->pressure_MPa[a];
    return sum / (2 * q->kappa_MPa);
}

static double element_energy_of(const struct quadratic *q, const double (*u)[3])
{
    struct state s;
    deform(&s, q, u);
    if (!(s.det_F_min > 0)) return HUGE_VAL;
    double energy = volume_energy(q, &s);
    for (int g = 0; g < GAUSS; g++) {
        struct frame f;
        frame_init(&f, s.F[g]);
        energy += q->weight[g] * ogden_energy(q->mu_MPa, f.stretch);
    }
    return energy;
}

static double pressure_at(const struct quadratic *q, const double pressure_MPa[PRESSURES], int g)
{
    double sum = 0;
    for (int a = 0; a < PRESSURES; a++) sum += pressure_MPa[a] * q->phi[g][a];
    return sum;
}

/* Raises the negative eigenvalues towards zero: all the way at convexity 1 (element_kernel.c). */
static void convexify(struct ogden_derivatives *d, double convexity)
{
    double value[3], vector[3][3];
    eigen3((const double(*)[3])d->normal, value, vector);
    for (int k = 0; k < 3; k++) {
        d->even[k] += convexity * fmax(0, -d->even[k]);
        d->odd[k] += convexity * fmax(0, -d->odd[k]);
    }
    for (int v = 0; v < 3; v++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                d->normal[i][j] += convexity * fmax(0, -value[v]) * vector[i][v] * vector[j][v];
}

/* ret[P][Q] = weight * A_PQ(i, k), see element_kernel.c. */
static void turned_tangent(const struct ogden_derivatives *d, const struct frame *f, double weight,
                           int i, int k, double ret[3][3])
{
    for (int r = 0; r < 3; r++) {
        const int p = (r + 1) % 3, q = (r + 2) % 3;
        const double cross = (d->even[r] - d->odd[r]) / 2;
        const double same_p = (d->even[p] + d->odd[p]) / 2, same_q = (d->even[q] + d->odd[q]) / 2;
        const double pq = weight * f->U[i][p] * f->U[k][q], qp = weight * f->U[i][q] * f->U[k][p];
        ret[r][r] = weight * (d->normal[r][r] * f->U[i][r] * f->U[k][r] +
                              same_q * f->U[i][p] * f->U[k][p] + same_p * f->U[i][q] * f->U[k][q]);
        ret[p][q] = d->normal[p][q] * pq + cross * qp;
        ret[q][p] = d->normal[p][q] * qp + cross * pq;
    }
}

/* Lower triangle of K += n^T A n by blocks of components. */
WIDE static void add_block_stiffness(double A[3][3], double n[3][BLOCK_NODES], int i, int k,
                                     double K[DOFS][DOFS])
{
    for (int a = 0; a < BLOCK_NODES; a++) {
        double left[3];
        for (int q = 0; q < 3; q++)
            left[q] = n[0][a] * A[0][q] + n[1][a] * A[1][q] + n[2][a] * A[2][q];
        double *row = &K[i * BLOCK_NODES + a][k * BLOCK_NODES];
        for (int b = 0; b < BLOCK_NODES; b++)
            row[b] += left[0] * n[0][b] + left[1] * n[1][b] + left[2] * n[2][b];
    }
}

/* K = kappa sum_a (dt_a/du) (dt_a/du)^T, to begin with. */
WIDE static void start_stiffness(const struct quadratic *q, double K[DOFS][DOFS])
{
    for (int i = 0; i < DOFS; i++)
        for (int j = 0; j < DOFS; j++) {
            double sum = 0;
            for (int a = 0; a < PRESSURES; a++) sum += q->rate[a][i] * q->rate[a][j];
            K[i][j] = q->kappa_MPa * sum;
        }
}

static void find_rates(struct quadratic *q, struct state *s)
{
    memset(q->rate, 0, sizeof q->rate);
    for (int g = 0; g < GAUSS; g++) {
        double cofactor[3][3];
        cofactor3(s->F[g], cofactor);
        for (int i = 0; i < 3; i++)
            for (int n = 0; n < BLOCK_NODES; n++) {
                const double dJ = cofactor[i][0] * q->dN[g][0][n] +
                                  cofactor[i][1] * q->dN[g][1][n] + cofactor[i][2] * q->dN[g][2][n];
                for (int a = 0; a < PRESSURES; a++)
                    q->rate[a][i * BLOCK_NODES + n] += q->weight[g] * q->phi[g][a] * dJ;
            }
    }
    memcpy(q->there_MPa, s->pressure_MPa, sizeof q->there_MPa);
}

struct derivatives {
    double force[DOFS];
    double K[DOFS][DOFS];
};

/* What a point adds to force and stiffness; returns its energy density. */
static double add_point(const struct quadratic *q, struct state *s, int g, double tracked_MPa,
                        double convexity, struct derivatives *ret)
{
    struct frame f;
    struct ogden_derivatives law, tangent;
    double n[3][BLOCK_NODES];
    const double weight = q->weight[g];
    frame_init(&f, s->F[g]);
    for (int p = 0; p < 3; p++)
        for (int a = 0; a < BLOCK_NODES; a++)
            n[p][a] = f.V[0][p] * q->dN[g][0][a] + f.V[1][p] * q->dN[g][1][a] +
                      f.V[2][p] * q->dN[g][2][a];
    ogden_derivatives(q->mu_MPa, pressure_at(q, s->pressure_MPa, g), f.stretch, &law);
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < BLOCK_NODES; a++)
            for (int p = 0; p < 3; p++)
                ret->force[i * BLOCK_NODES + a] += weight * f.U[i][p] * law.gradient[p] * n[p][a];
    ogden_derivatives(q->mu_MPa, tracked_MPa, f.stretch, &tangent);
    if (convexity > 0) convexify(&tangent, convexity);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k <= i; k++) {
            double A[3][3];
            turned_tangent(&tangent, &f, weight, i, k, A);
            add_block_stiffness(A, n, i, k, ret->K);
        }
    return ogden_energy(q->mu_MPa, f.stretch);
}

static double linearise_element(struct quadratic *q, const double (*u)[3],
                                const double tracked_MPa[PRESSURES], double convexity,
                                struct derivatives *ret)
{
    struct state s;
    deform(&s, q, u);
    if (!(s.det_F_min > 0)) return HUGE_VAL;
    find_rates(q, &s);
    memset(ret->force, 0, sizeof ret->force);
    start_stiffness(q, ret->K);
    double energy = volume_energy(q, &s);
    for (int g = 0; g < GAUSS; g++)
        energy +=
            q->weight[g] * add_point(q, &s, g, pressure_at(q, tracked_MPa, g), convexity, ret);
    return energy;
}

/* --- the body --------------------------------------------------------------------------------- */

double body_energy(const struct body *body, const double (*u)[3])
{
    double energy = 0;
    for (int e = 0; e < element_count(body) && energy < HUGE_VAL; e++)
        energy += element_energy_of(&elements_of(body)[e], u);
    return energy;
}

static void scatter(const struct quadratic *q, int e, const struct assembly *a,
                    const struct derivatives *d, struct body_derivatives *ret)
{
    const int *place = assembly_element_scatter(a, e);
    double *values = linear_values(a->linear);
    int eq[DOFS];
    for (int n = 0; n < BLOCK_NODES; n++)
        for (int c = 0; c < 3; c++) ret->force[q->node[n]][c] += d->force[c * BLOCK_NODES + n];
    assembly_element_equations(a, q->node, BLOCK_NODES, eq);
    for (int i = 0, k = 0; i < DOFS; i++)
        for (int j = 0; j <= i; j++, k++) {
            if (place[k] >= 0) values[place[k]] += d->K[i][j];
            /* The bone's rows: u_z = -d of all of them. */
            const bool row = eq[i] == EQUATION_BONE, column = eq[j] == EQUATION_BONE;
            if (row && column) ret->corner += (i == j ? 1 : 2) * d->K[i][j];
            if (row && eq[j] >= 0) ret->border[eq[j]] -= d->K[i][j];
            if (column && eq[i] >= 0) ret->border[eq[i]] -= d->K[i][j];
        }
}

double body_linearise(struct body *body, const struct assembly *a, const double (*u)[3],
                      double convexity, struct body_derivatives *ret)
{
    static struct derivatives d;
    double energy = 0;
    ret->corner = 0;
    memset(ret->force, 0, sizeof *ret->force * (size_t)body->mesh->node_count);
    memset(ret->border, 0, sizeof *ret->border * (size_t)a->n);
    linear_clear(a->linear);
    for (int e = 0; e < element_count(body); e++) {
        struct quadratic *q = &elements_of(body)[e];
        energy += linearise_element(q, u, body->pressure_MPa + e * PRESSURES, convexity, &d);
        if (energy == HUGE_VAL) return HUGE_VAL;
        scatter(q, e, a, &d, ret);
    }
    return energy;
}

void body_track_pressure(struct body *body, double alpha, const double (*from)[3],
                         const double (*to)[3])
{
    for (int e = 0; e < element_count(body); e++) {
        const struct quadratic *q = &elements_of(body)[e];
        for (int a = 0; a < PRESSURES; a++) {
            double *p = &body->pressure_MPa[e * PRESSURES + a], change = 0;
            for (int c = 0; c < 3; c++)
                for (int n = 0; n < BLOCK_NODES; n++)
                    change +=
                        q->rate[a][c * BLOCK_NODES + n] * (to[q->node[n]][c] - from[q->node[n]][c]);
            *p = alpha * q->there_MPa[a] + (1 - alpha) * *p + q->kappa_MPa * change;
        }
    }
}

void body_reset_pressure(struct body *body, const double (*u)[3])
{
    for (int e = 0; e < element_count(body); e++) {
        struct state s;
        deform(&s, &elements_of(body)[e], u);
        if (s.det_F_min > 0)
            memcpy(body->pressure_MPa + e * PRESSURES, s.pressure_MPa, sizeof s.pressure_MPa);
    }
}

/* Equal shares of every element: for drag in snaps, which nobody follows here. */
void body_shear_of_nodes(const struct body *body, double *ret_Nmm)
{
    memset(ret_Nmm, 0, sizeof *ret_Nmm * (size_t)body->mesh->node_count);
    for (int e = 0; e < element_count(body); e++) {
        const struct quadratic *q = &elements_of(body)[e];
        for (int g = 0; g < GAUSS; g++)
            for (int n = 0; n < BLOCK_NODES; n++)
                ret_Nmm[q->node[n]] += q->mu_MPa * q->weight[g] / BLOCK_NODES;
    }
}

double body_det_F_min(const struct body *body, const double (*u)[3])
{
    double smallest = HUGE_VAL;
    for (int e = 0; e < element_count(body); e++) {
        struct state s;
        deform(&s, &elements_of(body)[e], u);
        smallest = fmin(smallest, s.det_F_min);
    }
    return smallest;
}
