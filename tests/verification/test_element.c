/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The element on meshes: patch test, objectivity, order of convergence, no volumetric locking.
 *
 * Oracles: an affine deformation of a distorted patch leaves its inner nodes without force
 * (Irons); rotations and reflections do not change the energy; a manufactured solution is met with
 * second order in the L2 norm; a slender beam of nearly incompressible tissue bends as Euler,
 * Bernoulli and Timoshenko say.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/ogden.h"
#include "solver/units.h"
#include "tests/verification/bodies.h"

static void must(enum ischia_code code, const struct ischia_error *err)
{
    if (code != ISCHIA_OK) fail_msg("%s", err->message);
}

/* Reproducible numbers in [-1, 1] (a linear congruence of Numerical Recipes). */
static double noise(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return *seed / 2147483648.0 - 1;
}

/* --- a distorted patch ------------------------------------------------------------------------ */

enum { PATCH = 3 };
static const double patch_size[3] = {3, 3, 3};

/* A patch of PATCH^3 elements with its inner nodes moved by up to a quarter of an element, and an
 * assembly in which nothing is held. */
static void distorted_patch(struct bench *b, double bulk_ratio, double point_share,
                            double corner_share)
{
    const int m[3] = {PATCH, PATCH, PATCH};
    const struct element_material soft = {0.005, 0.005 * bulk_ratio,
                                          0.005 * bulk_ratio * point_share, corner_share};
    const struct element_material material[TISSUE_COUNT] = {soft, soft, soft};
    struct ischia_error err;
    uint32_t seed = 7;
    *b = (struct bench){0};
    must(block_init(&b->mesh, patch_size, m, 0, &err), &err);
    memset(b->mesh.node_flags, 0, (size_t)b->mesh.node_count);
    for (int n = 0; n < b->mesh.node_count; n++) {
        double *X = b->mesh.X_mm[n];
        const double inner =
            fmin(fmin(X[0], 3 - X[0]), fmin(fmin(X[1], 3 - X[1]), fmin(X[2], 3 - X[2])));
        for (int c = 0; c < 3 && inner > 0; c++) X[c] += 0.25 * noise(&seed);
    }
    must(bench_init(b, material, 0, &err), &err);
}

/* u = (F - I) X at every node. */
static void deform(struct bench *b, const double F[3][3])
{
    for (int n = 0; n < b->mesh.node_count; n++)
        for (int i = 0; i < 3; i++) {
            const double *X = b->mesh.X_mm[n];
            b->state.u_mm[n][i] = F[i][0] * X[0] + F[i][1] * X[1] + F[i][2] * X[2] - X[i];
        }
}

static double energy_and_force(struct bench *b, double (*ret_force)[3])
{
    struct body_derivatives derivatives = {.force = ret_force};
    derivatives.border = calloc((size_t)b->assembly.n, sizeof *derivatives.border);
    assert_non_null(derivatives.border);
    const double energy =
        body_linearise(&b->body, &b->assembly, (const double(*)[3])b->state.u_mm, 0, &derivatives);
    free(derivatives.border);
    return energy;
}

/* No force on inner nodes, and some on the others, under u = (F - I) X. */
static void check_patch(struct bench *b, const double F[3][3])
{
    double inner = 0, outer = 0;
    double(*force)[3] = calloc((size_t)b->mesh.node_count, sizeof *force);
    assert_non_null(force);
    deform(b, F);
    assert_true(energy_and_force(b, force) < HUGE_VAL);
    for (int n = 0; n < b->mesh.node_count; n++) {
        const double *X = b->mesh.X_mm[n];
        const bool is_inner = X[0] > 0 && X[0] < 3 && X[1] > 0 && X[1] < 3 && X[2] > 0 && X[2] < 3;
        double *largest = is_inner ? &inner : &outer;
        for (int c = 0; c < 3; c++) *largest = fmax(*largest, fabs(force[n][c]));
    }
    assert_true(outer > 1e-4);
    assert_true(inner < 1e-13 * (1 + outer));
    free(force);
}

static void inner_nodes_of_a_patch_carry_no_force(void **state)
{
    (void)state;
    const double F[3][3] = {{1.2, 0.5, -0.1}, {-0.2, 0.7, 0.3}, {0.1, 0.2, 1.1}};
    for (int share = 0; share <= 2; share++)
        for (int corners = 0; corners <= 2; corners++) {
            struct bench b;
            distorted_patch(&b, 20, share / 2.0, corners / 2.0);
            check_patch(&b, F);
            bench_finish(&b);
        }
}

static void random_state(struct bench *b)
{
    uint32_t seed = 11;
    for (int n = 0; n < b->mesh.node_count; n++)
        for (int c = 0; c < 3; c++) b->state.u_mm[n][c] = 0.15 * noise(&seed);
}

/* x := Q x for all nodes, x the deformed position; Q orthogonal. */
static void rotate_deformed(struct bench *b, const double Q[3][3])
{
    for (int n = 0; n < b->mesh.node_count; n++) {
        double x[3];
        const double *X = b->mesh.X_mm[n];
        for (int c = 0; c < 3; c++) x[c] = X[c] + b->state.u_mm[n][c];
        for (int i = 0; i < 3; i++)
            b->state.u_mm[n][i] = Q[i][0] * x[0] + Q[i][1] * x[1] + Q[i][2] * x[2] - X[i];
    }
}

static void rotations_turn_the_forces_and_keep_the_energy(void **state)
{
    (void)state;
    const double c = cos(0.7), s = sin(0.7);
    const double Q[3][3] = {{c, -s, 0}, {s * c, c * c, -s}, {s * s, s * c, c}};
    struct bench b;
    distorted_patch(&b, 2000, 0.05, 0.4);
    double(*force)[3] = calloc(2 * (size_t)b.mesh.node_count, sizeof *force);
    assert_non_null(force);
    double(*turned)[3] = force + b.mesh.node_count;
    random_state(&b);
    const double before = energy_and_force(&b, force);
    assert_true(before > 0 && before < HUGE_VAL);
    rotate_deformed(&b, Q);
    assert_true(fabs(energy_and_force(&b, turned) / before - 1) < 1e-12);
    for (int n = 0; n < b.mesh.node_count; n++)
        for (int i = 0; i < 3; i++) {
            const double expected =
                Q[i][0] * force[n][0] + Q[i][1] * force[n][1] + Q[i][2] * force[n][2];
            assert_true(fabs(turned[n][i] - expected) < 1e-10 * before);
        }
    free(force);
    bench_finish(&b);
}

static void a_rotated_body_at_rest_is_at_rest(void **state)
{
    (void)state;
    const double Q[3][3] = {{0, -1, 0}, {0, 0, -1}, {1, 0, 0}};
    struct bench b;
    distorted_patch(&b, 2000, 0.05, 0.4);
    rotate_deformed(&b, Q);
    assert_true(fabs(body_energy(&b.body, (const double(*)[3])b.state.u_mm)) < 1e-15);
    bench_finish(&b);
}

/* x -> -x of nodes and displacements; hexahedra turned so that their volumes stay positive. */
static void mirror(struct bench *b)
{
    for (int n = 0; n < b->mesh.node_count; n++) {
        b->mesh.X_mm[n][0] *= -1;
        b->state.u_mm[n][0] *= -1;
    }
    for (int e = 0; e < b->mesh.element_count; e++)
        for (int k = 0; k < 4; k++) {
            const int low = b->mesh.hex[e][k];
            b->mesh.hex[e][k] = b->mesh.hex[e][k + 4];
            b->mesh.hex[e][k + 4] = low;
        }
}

static void reflections_keep_energy_and_det_F(void **state)
{
    (void)state;
    struct bench b;
    struct body image;
    struct ischia_error err;
    distorted_patch(&b, 2000, 0.05, 0.4);
    random_state(&b);
    const double(*u)[3] = (const double(*)[3])b.state.u_mm;
    const double energy = body_energy(&b.body, u);
    const double det_F = body_det_F_min(&b.body, u);
    mirror(&b);
    must(body_init(&image, &b.mesh, b.body.material, &err), &err);
    assert_true(fabs(body_energy(&image, u) / energy - 1) < 1e-12);
    assert_true(fabs(body_det_F_min(&image, u) - det_F) < 1e-13);
    body_finish(&image);
    bench_finish(&b);
}

/* --- a manufactured solution ------------------------------------------------------------------ */

static const double pi = 3.14159265358979323846;
static const struct element_material firm = {
    .mu_MPa = 1, .kappa_MPa = 20, .kappa_point_MPa = 1, .corner_share = 0.4};
static const double amplitude[3] = {0.10, -0.06, 0.08}; /* of u*, in a cube of 1 mm */

/* u*_i = a_i sin(pi x) sin(pi y) sin(pi z): zero on the faces of the unit cube. */
static void exact(const double X[3], double ret_u[3], double ret_F[3][3])
{
    double s[3], c[3];
    for (int k = 0; k < 3; k++) s[k] = sin(pi * X[k]), c[k] = cos(pi * X[k]);
    const double gradient[3] = {pi * c[0] * s[1] * s[2], pi * s[0] * c[1] * s[2],
                                pi * s[0] * s[1] * c[2]};
    for (int i = 0; i < 3; i++) {
        ret_u[i] = amplitude[i] * s[0] * s[1] * s[2];
        for (int j = 0; j < 3; j++) ret_F[i][j] = amplitude[i] * gradient[j] + (i == j);
    }
}

/* Energy from the eigenvalues of C = F^T F, by Cardano: none of the solver's code. */
static double energy_density(const double F[3][3])
{
    double C[3][3], trace = 0, J, sum = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            C[i][j] = 0;
            for (int k = 0; k < 3; k++) C[i][j] += F[k][i] * F[k][j];
        }
    for (int i = 0; i < 3; i++) trace += C[i][i];
    J = F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1]) -
        F[0][1] * (F[1][0] * F[2][2] - F[1][2] * F[2][0]) +
        F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) sum += C[i][j] * C[j][i];
    /* Cardano: C = q I + p B, eigenvalues of B are 2 cos(...). */
    const double q = trace / 3, p = sqrt(fmax(0, (sum - trace * trace / 3) / 6));
    double half_det_B = 0, W = 0;
    if (p > 1e-14) {
        const double B[3] = {C[0][0] - q, C[1][1] - q, C[2][2] - q};
        half_det_B = (B[0] * (B[1] * B[2] - C[1][2] * C[1][2]) -
                      C[0][1] * (C[0][1] * B[2] - C[1][2] * C[0][2]) +
                      C[0][2] * (C[0][1] * C[1][2] - B[1] * C[0][2])) /
                     (2 * p * p * p);
    }
    const double angle = acos(fmax(-1, fmin(1, half_det_B))) / 3;
    for (int k = 0; k < 3; k++)
        W += pow((q + 2 * p * cos(angle + 2 * pi * k / 3)) * pow(J, -2.0 / 3), OGDEN_ALPHA / 2.0);
    return 2 * firm.mu_MPa / (OGDEN_ALPHA * OGDEN_ALPHA) * (W - 3) +
           firm.kappa_MPa / 2 * (J - 1) * (J - 1);
}

/* First Piola-Kirchhoff stress by central differences of the energy. */
static void exact_stress(const double F[3][3], double ret[3][3])
{
    const double h = 1e-5;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double moved[3][3];
            memcpy(moved, F, sizeof moved);
            moved[i][j] = F[i][j] + h;
            const double above = energy_density((const double(*)[3])moved);
            moved[i][j] = F[i][j] - h;
            ret[i][j] = (above - energy_density((const double(*)[3])moved)) / (2 * h);
        }
}

/* Trilinear shape function of corner k of a cube of side h and its gradient, xi in [-1, 1]^3. */
static double shape(int k, const double xi[3], double h, double ret_gradient[3])
{
    const double sign[3] = {(k + 1) / 2 % 2 ? 1 : -1, k / 2 % 2 ? 1 : -1, k / 4 ? 1 : -1};
    double f[3];
    for (int c = 0; c < 3; c++) f[c] = (1 + sign[c] * xi[c]) / 2;
    for (int c = 0; c < 3; c++) ret_gradient[c] = sign[c] / h * f[(c + 1) % 3] * f[(c + 2) % 3];
    return f[0] * f[1] * f[2];
}

static const double gauss_at[3] = {-0.774596669241483377, 0, 0.774596669241483377};
static const double gauss_weight[3] = {5.0 / 9, 8.0 / 9, 5.0 / 9};
typedef void visit_point(const struct mesh *mesh, int e, const double xi[3], double volume,
                         double h, void *context);

/* Calls visit at the 27 Gauss points of every element of a mesh of cubes of side h. */
static void integrate(const struct mesh *mesh, double h, visit_point *visit, void *context)
{
    for (int e = 0; e < mesh->element_count; e++)
        for (int g = 0; g < 27; g++) {
            const int at[3] = {g % 3, g / 3 % 3, g / 9};
            const double xi[3] = {gauss_at[at[0]], gauss_at[at[1]], gauss_at[at[2]]};
            const double weight = gauss_weight[at[0]] * gauss_weight[at[1]] * gauss_weight[at[2]];
            visit(mesh, e, xi, weight * h * h * h / 8, h, context);
        }
}

static void position(const struct mesh *mesh, int e, const double xi[3], double h, double ret[3])
{
    const double *corner = mesh->X_mm[mesh->hex[e][0]];
    for (int c = 0; c < 3; c++) ret[c] = corner[c] + h * (1 + xi[c]) / 2;
}

/* Adds P(u*) : grad N to the nodal loads that hold u* in equilibrium. */
static void add_load(const struct mesh *mesh, int e, const double xi[3], double volume, double h,
                     void *context)
{
    double(*load)[3] = context, X[3], u[3], F[3][3], P[3][3];
    position(mesh, e, xi, h, X);
    exact(X, u, F);
    exact_stress((const double(*)[3])F, P);
    for (int k = 0; k < HEX_NODES; k++) {
        double gradient[3];
        (void)shape(k, xi, h, gradient);
        for (int i = 0; i < 3; i++)
            load[mesh->hex[e][k]][i] +=
                volume * (P[i][0] * gradient[0] + P[i][1] * gradient[1] + P[i][2] * gradient[2]);
    }
}

struct error_sum {
    const double (*u)[3];
    double square;
};

static void add_error(const struct mesh *mesh, int e, const double xi[3], double volume, double h,
                      void *context)
{
    struct error_sum *sum = context;
    double X[3], u[3], F[3][3], gradient[3];
    position(mesh, e, xi, h, X);
    exact(X, u, F);
    for (int k = 0; k < HEX_NODES; k++) {
        const double N = shape(k, xi, h, gradient);
        for (int i = 0; i < 3; i++) u[i] -= N * sum->u[mesh->hex[e][k]][i];
    }
    sum->square += volume * (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
}

/* L2 error of the solution on divisions^3 elements, its faces held. */
static double manufactured_error(int divisions)
{
    const double size[3] = {1, 1, 1}, h = 1.0 / divisions;
    const int m[3] = {divisions, divisions, divisions};
    const struct element_material material[TISSUE_COUNT] = {firm, firm, firm};
    struct bench b = {0};
    struct ischia_error err;
    must(block_init(&b.mesh, size, m, 0, &err), &err);
    for (int n = 0; n < b.mesh.node_count; n++) {
        const double *X = b.mesh.X_mm[n];
        bool face = false;
        for (int c = 0; c < 3; c++) face = face || X[c] <= 0 || X[c] >= 1;
        b.mesh.node_flags[n] = face ? NODE_ON_BONE : 0;
    }
    must(bench_init(&b, material, 0, &err), &err);
    double(*load)[3] = calloc((size_t)b.mesh.node_count, sizeof *load);
    assert_non_null(load);
    integrate(&b.mesh, h, add_load, load);
    must(bench_load(&b, (const double(*)[3])load, 2, &err), &err);
    struct error_sum sum = {.u = (const double(*)[3])b.state.u_mm};
    integrate(&b.mesh, h, add_error, &sum);
    free(load);
    bench_finish(&b);
    return sqrt(sum.square);
}

static void manufactured_solution_converges_with_second_order(void **state)
{
    (void)state;
    const double e4 = manufactured_error(4), e8 = manufactured_error(8),
                 e16 = manufactured_error(16);
    print_message("L2 errors %.2e, %.2e, %.2e mm: orders %.2f, %.2f\n", e4, e8, e16, log2(e4 / e8),
                  log2(e8 / e16));
    assert_true(log2(e8 / e16) > 1.9);
    assert_true(e16 < 1e-3);
}

/* --- bending ---------------------------------------------------------------------------------- */

static const double beam_size[3] = {1, 1, 12};

/* Tip deflection over beam theory's of a cantilever 1 x 1 x 12 mm, 4 x 4 x 48 elements, held at
 * the top, under a small force across at the other end. */
static double deflection_ratio(double bulk_ratio, double point_share)
{
    const double mu = 0.005, force_N = 1e-7;
    const double kappa = mu * bulk_ratio, E = 9 * kappa * mu / (3 * kappa + mu);
    const int m[3] = {4, 4, 48};
    const struct element_material soft = {mu, kappa, kappa * point_share, 0};
    const struct element_material material[TISSUE_COUNT] = {soft, soft, soft};
    struct bench b = {0};
    struct ischia_error err;
    must(block_init(&b.mesh, beam_size, m, NODE_ON_BONE, &err), &err);
    for (int n = 0; n < b.mesh.node_count; n++) b.mesh.node_flags[n] &= NODE_ON_BONE;
    must(bench_init(&b, material, 0, &err), &err);
    double(*load)[3] = calloc((size_t)b.mesh.node_count, sizeof *load);
    assert_non_null(load);
    for (int n = 0; n < 25; n++) load[n][0] = force_N / 25;
    must(bench_load(&b, (const double(*)[3])load, 1, &err), &err);
    const double L = beam_size[2], inertia = 1.0 / 12;
    const double expected = force_N * L * L * L / (3 * E * inertia) + force_N * L / (mu * 5 / 6);
    const double ratio = b.state.u_mm[12][0] / expected;
    free(load);
    bench_finish(&b);
    return ratio;
}

static void nearly_incompressible_beam_does_not_lock(void **state)
{
    (void)state;
    const double compressible = deflection_ratio(2, 0), ours = deflection_ratio(2000, 0),
                 plain = deflection_ratio(2000, 1);
    print_message("tip deflection over beam theory: kappa/mu 2: %.3f, 2000: %.3f; "
                  "2000, volume at the points: %.3f\n",
                  compressible, ours, plain);
    assert_true(fabs(ours - 1) < 0.1);
    assert_true(fabs(ours - compressible) < 0.05);
    assert_true(plain < 0.5); /* what locking looks like: the test can tell */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(inner_nodes_of_a_patch_carry_no_force),
        cmocka_unit_test(rotations_turn_the_forces_and_keep_the_energy),
        cmocka_unit_test(a_rotated_body_at_rest_is_at_rest),
        cmocka_unit_test(reflections_keep_energy_and_det_F),
        cmocka_unit_test(manufactured_solution_converges_with_second_order),
        cmocka_unit_test(nearly_incompressible_beam_does_not_lock),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
