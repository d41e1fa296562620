/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/body.h"
#include "solver/ogden.h"
#include "tests/unit/box_mesh.h"
#include "tests/unit/near.h"

static const struct element_material materials[TISSUE_COUNT] = {
    [TISSUE_MUSCLE] = {0.008, 0.4, 0.04, 0},
    [TISSUE_FAT] = {0.004, 0.2, 0.02, 0},
    [TISSUE_SKIN] = {0.06, 3, 0.3, 0},
};

/* A box of all three tissues with its equations; a distorted state u, and room for derivatives. */
struct bench {
    struct mesh mesh;
    struct body body;
    struct assembly assembly;
    double (*u)[3];
    struct body_derivatives d;
};

static void bench_init(struct bench *b, double distortion)
{
    static const struct box box = {{2, 2, 3}, {4, 4, 6}, 1, 1};
    struct ischia_error err;
    b->mesh = box_mesh(&box);
    box_distort(&b->mesh, distortion);
    if (body_init(&b->body, &b->mesh, materials, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    if (assembly_init(&b->assembly, &b->mesh, &err) != ISCHIA_OK) fail_msg("%s", err.message);
    const size_t nodes = (size_t)b->mesh.node_count;
    b->u = box_alloc(nodes, sizeof *b->u);
    b->d.force = box_alloc(nodes, sizeof *b->d.force);
    b->d.border = box_alloc((size_t)b->assembly.n, sizeof *b->d.border);
}

static void bench_finish(struct bench *b)
{
    free(b->u);
    free(b->d.force);
    free(b->d.border);
    assembly_finish(&b->assembly);
    body_finish(&b->body);
    box_mesh_free(&b->mesh);
}

static const double (*at(const struct bench *b))[3] { return (const double(*)[3])b->u; }

static void shake(struct bench *b, double amplitude)
{
    for (int n = 0; n < b->mesh.node_count; n++)
        for (int c = 0; c < 3; c++) b->u[n][c] = amplitude * sin(3.0 * n + 2.0 * c + 1);
}

/* Sum of volume times the energy density of stretches (sx, sy, sz). */
static void homogeneous_energy_is_the_laws(void **state)
{
    (void)state;
    static const double s[3] = {1.2, 0.9, 0.85};
    struct bench b;
    bench_init(&b, 0);
    for (int n = 0; n < b.mesh.node_count; n++)
        for (int c = 0; c < 3; c++) b.u[n][c] = (s[c] - 1) * b.mesh.X_mm[n][c];
    const double dJ = s[0] * s[1] * s[2] - 1;
    double expected = 0;
    for (int t = 0; t < TISSUE_COUNT; t++) /* one layer of 4 x 4 x 2 mm each */
        expected +=
            32 * (ogden_energy(materials[t].mu_MPa, s) + materials[t].kappa_MPa / 2 * dJ * dJ);
    assert_near(body_energy(&b.body, at(&b)), expected, 1e-12);
    assert_near(body_linearise(&b.body, &b.assembly, at(&b), 0, &b.d), expected, 1e-12);
    assert_near(body_det_F_min(&b.body, at(&b)), dJ + 1, 1e-13);
    bench_finish(&b);
}

static void rest_has_no_energy_and_no_force(void **state)
{
    (void)state;
    struct bench b;
    bench_init(&b, 0.02);
    assert_near(body_linearise(&b.body, &b.assembly, at(&b), 0, &b.d), 0, 1e-14);
    for (int n = 0; n < b.mesh.node_count; n++)
        for (int c = 0; c < 3; c++) assert_near(b.d.force[n][c], 0, 1e-14);
    assert_near(body_det_F_min(&b.body, at(&b)), 1, 1e-13);
    bench_finish(&b);
}

static void force_is_the_gradient(void **state)
{
    (void)state;
    static const double h = 1e-6;
    struct bench b;
    bench_init(&b, 0.02);
    shake(&b, 0.15);
    (void)body_linearise(&b.body, &b.assembly, at(&b), 0, &b.d);
    for (int n = 0; n < b.mesh.node_count; n++)
        for (int c = 0; c < 3; c++) {
            const double was = b.u[n][c];
            b.u[n][c] = was + h;
            const double up = body_energy(&b.body, at(&b));
            b.u[n][c] = was - h;
            const double down = body_energy(&b.body, at(&b));
            b.u[n][c] = was;
            assert_near(b.d.force[n][c], (up - down) / (2 * h), 1e-7);
        }
    bench_finish(&b);
}

/* Moves the free nodes by `by` times x, and the bone by -by * dd. */
static void displace(struct bench *b, const double *x, double dd, double by)
{
    for (int n = 0; n < b->mesh.node_count; n++)
        for (int c = 0; c < 3; c++) {
            const int eq = b->assembly.equation[n][c];
            if (eq >= 0) b->u[n][c] += by * x[eq];
            if (eq == EQUATION_BONE) b->u[n][c] -= by * dd;
        }
}

/* ret[n + 1]: the gradient by the unknowns, d the last. */
static void gradient(struct bench *b, double *ret)
{
    (void)body_linearise(&b->body, &b->assembly, at(b), 0, &b->d);
    ret[b->assembly.n] = 0;
    for (int n = 0; n < b->mesh.node_count; n++)
        for (int c = 0; c < 3; c++) {
            const int eq = b->assembly.equation[n][c];
            if (eq >= 0) ret[eq] = b->d.force[n][c];
            if (eq == EQUATION_BONE) ret[b->assembly.n] -= b->d.force[n][c];
        }
}

/* K x + border dd and border . x + corner dd, with true pressures, against differences. */
static void hessian_and_border_are_the_second_derivative(void **state)
{
    (void)state;
    static const double h = 1e-6, dd = 0.7;
    struct bench b;
    bench_init(&b, 0.02);
    shake(&b, 0.15);
    const int n = b.assembly.n;
    double *x = box_alloc((size_t)n, sizeof *x), *y = box_alloc((size_t)n + 1, sizeof *y);
    double *up = box_alloc((size_t)n + 1, sizeof *up), *down = box_alloc((size_t)n + 1, sizeof *up);
    for (int i = 0; i < n; i++) x[i] = cos(1.3 * i);
    body_reset_pressure(&b.body, at(&b));
    gradient(&b, up);
    linear_multiply(b.assembly.linear, x, y);
    y[n] = b.d.corner * dd;
    for (int i = 0; i < n; i++) {
        y[n] += b.d.border[i] * x[i];
        y[i] += b.d.border[i] * dd;
    }
    displace(&b, x, dd, h);
    gradient(&b, up);
    displace(&b, x, dd, -2 * h);
    gradient(&b, down);
    for (int i = 0; i <= n; i++) assert_near(y[i], (up[i] - down[i]) / (2 * h), 1e-5);
    free(x);
    free(y);
    free(up);
    free(down);
    bench_finish(&b);
}

static void inversion_has_no_finite_energy(void **state)
{
    (void)state;
    struct bench b;
    bench_init(&b, 0);
    b.u[0][2] = 5; /* through the layer above */
    assert_true(body_energy(&b.body, at(&b)) == HUGE_VAL);
    assert_true(body_linearise(&b.body, &b.assembly, at(&b), 0, &b.d) == HUGE_VAL);
    assert_true(body_det_F_min(&b.body, at(&b)) < 0);
    bench_finish(&b);
}

/* Tracked along a straight line, the pressures are the true ones to first order: halving the move
 * takes three quarters of the difference away. */
static double tracking_error(struct bench *b, double move)
{
    const size_t nodes = (size_t)b->mesh.node_count;
    const size_t elements = (size_t)b->mesh.element_count;
    double(*to)[3] = box_alloc(nodes, sizeof *to);
    double *tracked = box_alloc(elements, sizeof *tracked), most = 0;
    shake(b, 0.1);
    for (size_t n = 0; n < nodes; n++)
        for (int c = 0; c < 3; c++) to[n][c] = b->u[n][c] + move * cos(5.0 * (double)n + c);
    body_reset_pressure(&b->body, at(b));
    (void)body_linearise(&b->body, &b->assembly, at(b), 0, &b->d);
    body_track_pressure(&b->body, 1, at(b), (const double(*)[3])to);
    memcpy(tracked, b->body.pressure_MPa, elements * sizeof *tracked);
    body_reset_pressure(&b->body, (const double(*)[3])to);
    for (size_t e = 0; e < elements; e++)
        most = fmax(most, fabs(tracked[e] - b->body.pressure_MPa[e]));
    free(to);
    free(tracked);
    return most;
}

static void tracked_pressure_is_right_to_first_order(void **state)
{
    (void)state;
    struct bench b;
    bench_init(&b, 0.02);
    const double whole = tracking_error(&b, 0.02), half = tracking_error(&b, 0.01);
    bench_finish(&b);
    assert_true(whole > 1e-6);
    assert_near(half / whole, 0.25, 0.02);
}

/* alpha blends the true pressure of the last state with the tracked one. */
static void partial_steps_blend_pressures(void **state)
{
    (void)state;
    struct bench b;
    bench_init(&b, 0);
    shake(&b, 0.1);
    body_reset_pressure(&b.body, at(&b));
    /* The analyzer forgets b.u, which bench_finish frees, when &b.body is handed on. */
    const double truth = b.body.pressure_MPa[3]; /* NOLINT(clang-analyzer-unix.Malloc) */
    assert_true(fabs(truth) > 1e-4);
    (void)body_linearise(&b.body, &b.assembly, at(&b), 0, &b.d);
    b.body.pressure_MPa[3] = 2;
    body_track_pressure(&b.body, 0, at(&b), at(&b));
    assert_near(b.body.pressure_MPa[3], 2, 0);
    body_track_pressure(&b.body, 0.25, at(&b), at(&b));
    assert_near(b.body.pressure_MPa[3], 0.25 * truth + 0.75 * 2, 1e-14);
    body_track_pressure(&b.body, 1, at(&b), at(&b));
    assert_near(b.body.pressure_MPa[3], truth, 1e-14);
    bench_finish(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(homogeneous_energy_is_the_laws),
        cmocka_unit_test(rest_has_no_energy_and_no_force),
        cmocka_unit_test(force_is_the_gradient),
        cmocka_unit_test(hessian_and_border_are_the_second_derivative),
        cmocka_unit_test(inversion_has_no_finite_energy),
        cmocka_unit_test(tracked_pressure_is_right_to_first_order),
        cmocka_unit_test(partial_steps_blend_pressures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
