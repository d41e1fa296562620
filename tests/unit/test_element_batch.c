/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Batches of elements: every kernel of this processor against the others and against itself with
 * the elements in other lanes, bit for bit; and against finite differences of its own energies.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/element_batch.h"
#include "tests/unit/near.h"

static const double brick[HEX_NODES][3] = {{0, 0, 0}, {2, 0, 0}, {2, 1.5, 0}, {0, 1.5, 0},
                                           {0, 0, 1}, {2, 0, 1}, {2, 1.5, 1}, {0, 1.5, 1}};

/* What differs from element to element; move is relative to nearly the greatest that works. */
struct element {
    double shape, move, pressure_MPa;
    struct element_material material;
};
static const struct element elements[BATCH] = {
    {0, 0, 0, {0.008, 0.4, 0.04, 0.001}}, /* at rest: all stretches equal */
    {0.02, 0.1, 0.01, {0.008, 16, 0.08, 0.008}},
    {0.1, 1, -0.3, {0.004, 0.2, 0.02, 0.0004}},
    {0.1, 0.5, 0.2, {0.06, 3, 0.3, 0}},
    {0, 1e-9, 0, {0.008, 0.4, 0.04, 0.01}}, /* nearly equal */
    {0.05, 4, 0.1, {0.008, 0.4, 0.04, 0}},  /* inverted */
    {0.15, 0.8, 1, {0.008, 0.4, 0, 0.02}},
    {0.1, 0.9, -2, {0.005, 2, 0.025, 0.003}},
};
enum { INVERTED = 5 };

struct run {
    struct element_batch batch;
    struct element_batch_u u;
    struct element_batch_tangent tangent;
    struct element_batch_derivatives d;
    struct element_batch_volume volume;
    BATCH_ALIGNED double energy[BATCH];
    double energy_alone[BATCH];
};

/* Element k goes to lane (k + shift) % BATCH. */
static int lane_of(int k, int shift) { return (k + shift) % BATCH; }

static void put(struct run *r, int k, int lane)
{
    const struct element *e = &elements[k];
    struct element_reference reference;
    double X[HEX_NODES][3];
    for (int n = 0; n < HEX_NODES; n++)
        for (int c = 0; c < 3; c++) {
            X[n][c] = brick[n][c] + e->shape * sin(5.0 * n + 3.0 * c + k);
            r->u.mm[n][c][lane] = 0.25 * e->move * sin(3.0 * n + 2.0 * c + 1 + k);
        }
    element_reference_init(&reference, (const double(*)[3])X);
    element_batch_set(&r->batch, lane, &reference, &e->material);
    r->tangent.pressure_MPa[lane] = e->pressure_MPa;
}

static void compute(const struct element_kernel *kernel, struct run *r)
{
    BATCH_ALIGNED double energy[BATCH];
    kernel->linearise(&r->batch, &r->u, &r->tangent, &r->d, r->energy);
    kernel->energy(&r->batch, &r->u, energy);
    kernel->volume(&r->batch, &r->u, &r->volume);
    memcpy(r->energy_alone, energy, sizeof energy);
}

static void run(const struct element_kernel *kernel, int shift, double convexity, struct run *ret)
{
    memset(ret, 0, sizeof *ret);
    for (int k = 0; k < BATCH; k++) put(ret, k, lane_of(k, shift));
    ret->tangent.convexity = convexity;
    compute(kernel, ret);
}

static uint64_t bits(double x)
{
    uint64_t ret;
    memcpy(&ret, &x, sizeof ret);
    return ret;
}

static void same(const char *what, const double *a, int lane_a, const double *b, int lane_b,
                 int count)
{
    for (int i = 0; i < count; i++)
        if (bits(a[i * BATCH + lane_a]) != bits(b[i * BATCH + lane_b]))
            fail_msg("%s %d is %.17g in lane %d, %.17g in lane %d", what, i, a[i * BATCH + lane_a],
                     lane_a, b[i * BATCH + lane_b], lane_b);
}

/* All results of one element, wherever it is. */
static void same_element(const struct run *a, int lane_a, const struct run *b, int lane_b)
{
    same("energy", a->energy, lane_a, b->energy, lane_b, 1);
    same("energy alone", a->energy_alone, lane_a, b->energy_alone, lane_b, 1);
    same("det F", a->volume.det_F_min, lane_a, b->volume.det_F_min, lane_b, 1);
    if (a->energy[lane_a] == HUGE_VAL) return;
    same("pressure", a->volume.pressure_MPa, lane_a, b->volume.pressure_MPa, lane_b, 1);
    same("force", a->d.force[0][0], lane_a, b->d.force[0][0], lane_b, HEX_DOFS);
    same("stiffness", a->d.stiffness[0], lane_a, b->d.stiffness[0], lane_b, HEX_ENTRIES);
    same("volume gradient", a->d.volume_gradient[0][0], lane_a, b->d.volume_gradient[0][0], lane_b,
         HEX_DOFS);
}

static const double convexities[] = {0, 0.3, 1};
enum { CONVEXITY_COUNT = sizeof convexities / sizeof convexities[0] };

static void every_width_gives_the_same_bits(void **state)
{
    (void)state;
    struct run wide, other;
    for (int c = 0; c < CONVEXITY_COUNT; c++) {
        run(element_kernel(0), 0, convexities[c], &wide);
        for (int w = 1; element_kernel(w) != NULL; w++) {
            run(element_kernel(w), 0, convexities[c], &other);
            for (int l = 0; l < BATCH; l++) same_element(&wide, l, &other, l);
        }
    }
}

static void every_lane_gives_the_same_bits(void **state)
{
    (void)state;
    struct run first, other;
    for (int w = 0; element_kernel(w) != NULL; w++) {
        run(element_kernel(w), 0, 0.3, &first);
        for (int shift = 1; shift < BATCH; shift++) {
            run(element_kernel(w), shift, 0.3, &other);
            for (int k = 0; k < BATCH; k++)
                same_element(&first, lane_of(k, 0), &other, lane_of(k, shift));
        }
    }
}

/* Neither do the bits depend on what the other lanes hold. */
static void neighbours_do_not_matter(void **state)
{
    (void)state;
    struct run together, alone;
    for (int w = 0; element_kernel(w) != NULL; w++) {
        run(element_kernel(w), 0, 1, &together);
        for (int k = 0; k < BATCH; k++) {
            memset(&alone, 0, sizeof alone);
            for (int l = 0; l < BATCH; l++) put(&alone, k, l);
            alone.tangent.convexity = 1;
            compute(element_kernel(w), &alone);
            for (int l = 0; l < BATCH; l++) same_element(&together, k, &alone, l);
        }
    }
}

static void only_the_inverted_lane_has_no_energy(void **state)
{
    (void)state;
    struct run r;
    run(element_kernel(0), 0, 0, &r);
    for (int k = 0; k < BATCH; k++) {
        assert_int_equal(r.energy[k] == HUGE_VAL, k == INVERTED);
        assert_int_equal(r.volume.det_F_min[k] > 0, k != INVERTED);
        assert_true(r.energy[k] == r.energy_alone[k]);
        assert_true(k == INVERTED || r.d.pressure_MPa[k] == r.volume.pressure_MPa[k]);
    }
    assert_near(r.energy[0], 0, 1e-16);
    assert_near(r.volume.det_F_min[0], 1, 1e-15);
}

/* Central differences by one displacement of every lane at once. */
static void check_column(const struct run *at, int node, int component)
{
    static const double h = 1e-6;
    struct run up = *at, down = *at;
    const int q = component * HEX_NODES + node;
    for (int l = 0; l < BATCH; l++) {
        up.u.mm[node][component][l] += h;
        down.u.mm[node][component][l] -= h;
    }
    compute(element_kernel(0), &up);
    compute(element_kernel(0), &down);
    for (int l = 0; l < BATCH; l++) {
        if (l == INVERTED) continue;
        assert_near(at->d.force[component][node][l], (up.energy[l] - down.energy[l]) / (2 * h),
                    1e-7);
        assert_near(at->d.volume_gradient[component][node][l] * at->batch.kappa_mean_MPa[l],
                    (up.d.pressure_MPa[l] - down.d.pressure_MPa[l]) / (2 * h) * at->batch.volume[l],
                    1e-6);
        for (int p = q; p < HEX_DOFS; p++) {
            const int c = p / HEX_NODES, n = p % HEX_NODES;
            const double *plus = up.d.force[c][n], *minus = down.d.force[c][n];
            assert_near(at->d.stiffness[p * (p + 1) / 2 + q][l], (plus[l] - minus[l]) / (2 * h),
                        2e-6);
        }
    }
}

static void derivatives_match_differences(void **state)
{
    (void)state;
    struct run r;
    run(element_kernel(0), 0, 0, &r);
    memcpy(r.tangent.pressure_MPa, r.d.pressure_MPa, sizeof r.tangent.pressure_MPa);
    compute(element_kernel(0), &r);
    for (int n = 0; n < HEX_NODES; n++)
        for (int c = 0; c < 3; c++) check_column(&r, n, c);
}

/* y^T K y of an element's lower triangle. */
static double curvature(const struct run *r, int lane, const double y[HEX_DOFS])
{
    double sum = 0;
    for (int i = 0, k = 0; i < HEX_DOFS; i++)
        for (int j = 0; j <= i; j++, k++)
            sum += (i == j ? 1 : 2) * y[i] * y[j] * r->d.stiffness[k][lane];
    return sum;
}

/* The smallest curvature over fixed directions: plane waves of the nodes, and single nodes. */
static double least_curvature(const struct run *r, int lane)
{
    double least = HUGE_VAL, y[HEX_DOFS];
    for (int m = 0; m < 400; m++) {
        for (int i = 0; i < HEX_DOFS; i++)
            y[i] = m < HEX_DOFS ? i == m : sin(1.7 * m + (0.3 + 0.01 * m) * i * i);
        least = fmin(least, curvature(r, lane, y));
    }
    return least;
}

/* Under compressive pressure the Hessian bends down; convexity 1 lets no direction, 0.3 fewer. */
static void convexity_lifts_negative_curvature(void **state)
{
    (void)state;
    struct run exact, partly, convex;
    run(element_kernel(0), 0, 0, &exact);
    run(element_kernel(0), 0, 0.3, &partly);
    run(element_kernel(0), 0, 1, &convex);
    int bent = 0;
    for (int l = 0; l < BATCH; l++) {
        if (l == INVERTED) continue;
        const double before = least_curvature(&exact, l), after = least_curvature(&convex, l);
        assert_true(after > -1e-12);
        if (before > -1e-6) continue;
        bent++;
        assert_true(least_curvature(&partly, l) > before);
        assert_true(least_curvature(&partly, l) < after);
    }
    assert_true(bent >= 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_width_gives_the_same_bits),
        cmocka_unit_test(every_lane_gives_the_same_bits),
        cmocka_unit_test(neighbours_do_not_matter),
        cmocka_unit_test(only_the_inverted_lane_has_no_energy),
        cmocka_unit_test(derivatives_match_differences),
        cmocka_unit_test(convexity_lifts_negative_curvature),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
