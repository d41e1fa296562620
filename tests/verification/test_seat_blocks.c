/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A block between the bone, or a greased plate, and the seat.
 *
 * Oracles: uniaxial compression has a closed form; a block that sticks to both faces is its own
 * mirror image in the middle plane; all nodes that slide carry Coulomb's force mu N against the
 * slip; the work of the force is the stored energy plus what friction dissipates.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "solver/ogden.h"
#include "tests/verification/bodies.h"

static const double size_mm[3] = {10, 10, 10};
static const struct element_material tissue = {
    .mu_MPa = 0.005, .kappa_MPa = 0.1, .kappa_point_MPa = 0.1};

static void must(enum ischia_code code, const struct ischia_error *err)
{
    if (code != ISCHIA_OK) fail_msg("%s", err->message);
}

/* Fills b with divisions^3 elements; `cleared` flags are taken off every node. The parts point to
 * each other, so b must not be copied. */
static void block(struct bench *b, int divisions, unsigned top_flags, unsigned cleared,
                  double friction)
{
    const int m[3] = {divisions, divisions, divisions};
    const struct element_material material[TISSUE_COUNT] = {tissue, tissue, tissue};
    struct ischia_error err;
    *b = (struct bench){0};
    must(block_init(&b->mesh, size_mm, m, top_flags, &err), &err);
    for (int n = 0; n < b->mesh.node_count; n++)
        b->mesh.node_flags[n] = (unsigned char)(b->mesh.node_flags[n] & ~cleared);
    must(bench_init(b, material, friction, &err), &err);
}

/* Kirchhoff stresses of the stretches (l3, lt, lt). */
static void kirchhoff(double l3, double lt, double *ret_axial, double *ret_lateral)
{
    const double J = l3 * lt * lt, scale = pow(J, -1.0 / 3);
    const double a3 = pow(l3 * scale, OGDEN_ALPHA), at = pow(lt * scale, OGDEN_ALPHA);
    const double mean = (a3 + 2 * at) / 3, volumetric = tissue.kappa_MPa * J * (J - 1);
    *ret_axial = 2 * tissue.mu_MPa / OGDEN_ALPHA * (a3 - mean) + volumetric;
    *ret_lateral = 2 * tissue.mu_MPa / OGDEN_ALPHA * (at - mean) + volumetric;
}

/* Lateral stretch at which the lateral stress vanishes, by bisection. */
static double free_lateral_stretch(double l3)
{
    double low = 0.5, high = 3, axial, lateral;
    for (int i = 0; i < 200; i++) {
        const double middle = (low + high) / 2;
        kirchhoff(l3, middle, &axial, &lateral);
        *(lateral > 0 ? &high : &low) = middle;
    }
    return low;
}

static void frictionless_block_is_uniaxial(void **state)
{
    (void)state;
    struct bench b;
    block(&b, 3, NODE_ON_PLATE, 0, 0);
    for (int step = 1; step <= 12; step++) {
        const double d = 0.5 * step;
        struct ischia_error err;
        double axial, lateral;
        must(bench_press(&b, d, &err), &err);
        const double l3 = 1 - d / size_mm[2], lt = free_lateral_stretch(l3);
        kirchhoff(l3, lt, &axial, &lateral);
        const double force_N = -axial / l3 * size_mm[0] * size_mm[1];
        const int corner = b.mesh.node_count - 1;
        assert_true(fabs(b.state.force_N / force_N - 1) < 1e-7);
        assert_true(fabs(b.state.u_mm[corner][0] - (lt - 1) * size_mm[0]) < 1e-6);
    }
    bench_finish(&b);
}

static void sticking_block_is_its_own_mirror_image(void **state)
{
    (void)state;
    struct bench b;
    block(&b, 4, NODE_ON_BONE, 0, 100);
    const int plane = 5 * 5;
    struct ischia_error err;
    for (int s = 1; s <= 10; s++) {
        must(bench_press(&b, 0.3 * s, &err), &err);
        (void)bench_end_step(&b);
    }
    for (int k = 0; k <= 4; k++)
        for (int i = 0; i < plane; i++) {
            const double *low = b.state.u_mm[k * plane + i];
            const double *high = b.state.u_mm[(4 - k) * plane + i];
            assert_true(fabs(low[0] - high[0]) < 2e-3 && fabs(low[1] - high[1]) < 2e-3);
            assert_true(fabs(low[2] + high[2] + 3) < 2e-3);
        }
    assert_true(b.state.u_mm[2 * plane + 4][0] > 0.5); /* it does bulge */
    bench_finish(&b);
}

/* Sums of the friction force along x and of the normal force over all nodes, N. */
static void seat_forces(const struct bench *b, double *ret_tangential, double *ret_normal)
{
    double(*force)[3] = calloc((size_t)b->mesh.node_count, sizeof *force);
    assert_non_null(force);
    seat_add_force(&b->seat, b->seat.normal_N, (const double(*)[3])b->state.u_mm, force);
    *ret_tangential = *ret_normal = 0;
    for (int n = 0; n < b->mesh.node_count; n++) {
        *ret_tangential += force[n][0];
        *ret_normal += b->seat.normal_N[n];
    }
    free(force);
}

/* The seat is drawn sideways under a pressed block, by moving the anchors, until all slides. */
static void sliding_block_carries_mu_N(void **state)
{
    (void)state;
    const double friction = 0.4;
    struct bench b;
    block(&b, 3, NODE_ON_BONE, NODE_ON_X0 | NODE_ON_Y0, friction);
    struct ischia_error err;
    double tangential, normal;
    for (int s = 1; s <= 10; s++) {
        must(bench_press(&b, 0.1 * s, &err), &err);
        (void)bench_end_step(&b);
    }
    seat_forces(&b, &tangential, &normal);
    assert_true(fabs(tangential) < 0.01 * friction * normal);
    for (int s = 0; s < 80; s++) {
        for (int n = 0; n < b.mesh.node_count; n++) b.seat.anchor_mm[n][0] += 0.1;
        must(bench_press(&b, 1, &err), &err);
        (void)bench_end_step(&b);
    }
    seat_forces(&b, &tangential, &normal);
    assert_true(normal > 0.1);
    assert_true(fabs(-tangential / (friction * normal) - 1) < 1e-3);
    bench_finish(&b);
}

/* |work - stored - dissipated| / work of a frictional block pressed by 4 mm in `steps` steps. */
static double energy_error(int steps, double *ret_dissipated_share)
{
    struct bench b;
    block(&b, 3, NODE_ON_BONE, 0, 0.2);
    double work = 0, dissipated = 0, force_before = 0;
    for (int s = 1; s <= steps; s++) {
        struct ischia_error err;
        must(bench_press(&b, 4.0 * s / steps, &err), &err);
        work += (force_before + b.state.force_N) / 2 * 4.0 / steps;
        force_before = b.state.force_N;
        dissipated += bench_end_step(&b);
    }
    *ret_dissipated_share = dissipated / work;
    const double error = fabs(work - b.state.elastic_Nmm - dissipated) / work;
    bench_finish(&b);
    return error;
}

static void work_is_stored_or_dissipated(void **state)
{
    (void)state;
    double share;
    const double coarse = energy_error(40, &share), fine = energy_error(160, &share);
    print_message(
        "energy error %.2e in 40 steps, %.2e in 160; friction takes %.1f %% of the work\n", coarse,
        fine, 100 * share);
    assert_true(share > 0.05);
    assert_true(fine < 0.005);
    assert_true(fine < coarse / 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frictionless_block_is_uniaxial),
        cmocka_unit_test(sticking_block_is_its_own_mirror_image),
        cmocka_unit_test(sliding_block_carries_mu_N),
        cmocka_unit_test(work_is_stored_or_dissipated),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
