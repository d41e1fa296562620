/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The load path, which steps and then meets a force.
 *
 * Oracles: a block under a greased plate is compressed uniaxially, so that the force of a known
 * compression has a closed form, and so has the energy stored; friction can only stiffen a block;
 * on the local model the work of the bone, summed by the trapezium rule over small steps that share
 * no code with path.c, is what is stored and what friction takes.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/axis.h"
#include "solver/path.h"
#include "solver/units.h"
#include "tests/verification/bodies.h"

static const double size_mm[3] = {12, 9, 10};

static void must(enum ischia_code code, const struct ischia_error *err)
{
    if (code != ISCHIA_OK) fail_msg("%s", err->message);
}

static void block(struct bench *b, double bulk_ratio, unsigned top_flags, double friction)
{
    const int m[3] = {3, 2, 3};
    const double mu = 0.005;
    const struct element_material soft = {mu, mu * bulk_ratio, 0.3 * mu, 0};
    const struct element_material material[TISSUE_COUNT] = {soft, soft, soft};
    struct ischia_error err;
    *b = (struct bench){0};
    must(block_init(&b->mesh, size_mm, m, top_flags, &err), &err);
    must(bench_init(b, material, friction, &err), &err);
}

static struct path_report follow(struct bench *b, double force_N)
{
    const struct path_effort effort = {.pace = 1, .factorisations_max = 1500};
    struct path_report report;
    struct ischia_error err;
    must(path_follow(&b->body, &b->assembly, &b->seat, force_N, &effort, NULL, &b->state, &report,
                     &err),
         &err);
    return report;
}

/* Energy density and lateral Kirchhoff stress of the stretches (l3, lt, lt). */
static double uniaxial_energy(const struct element_material *m, double l3, double lt,
                              double *ret_lateral)
{
    const double J = l3 * lt * lt, scale = pow(J, -5.0 / 3);
    const double b3 = scale * pow(l3, 5), bt = scale * pow(lt, 5), mean = (b3 + 2 * bt) / 3;
    *ret_lateral = 2 * m->mu_MPa / 5 * (bt - mean) + m->kappa_MPa * J * (J - 1);
    return 2 * m->mu_MPa / 25 * (b3 + 2 * bt - 3) + m->kappa_MPa / 2 * (J - 1) * (J - 1);
}

/* Energy density of free uniaxial compression: the lateral stretch by bisection. */
static double free_energy(const struct element_material *m, double l3)
{
    double low = 0.9, high = 3, lateral;
    for (int i = 0; i < 200; i++) {
        const double middle = (low + high) / 2;
        (void)uniaxial_energy(m, l3, middle, &lateral);
        *(lateral > 0 ? &high : &low) = middle;
    }
    return uniaxial_energy(m, l3, low, &lateral);
}

/* The force is the slope of the energy (envelope theorem), by a five-point difference. */
static double uniaxial_force_N(const struct element_material *m, double l3)
{
    const double h = 1e-3, area = size_mm[0] * size_mm[1];
    const double near_slope = free_energy(m, l3 - h) - free_energy(m, l3 + h);
    const double far_slope = free_energy(m, l3 - 2 * h) - free_energy(m, l3 + 2 * h);
    return area * (8 * near_slope - far_slope) / (12 * h);
}

static void a_path_meets_the_force_of_uniaxial_compression(void **state)
{
    (void)state;
    static const double bulk_ratios[] = {20, 2000};
    for (int i = 0; i < 2; i++) {
        struct bench b;
        block(&b, bulk_ratios[i], NODE_ON_PLATE, 0);
        const struct element_material *m = &b.body.material[TISSUE_MUSCLE];
        const double l3 = 0.4, volume = size_mm[0] * size_mm[1] * size_mm[2];
        const struct path_report report = follow(&b, uniaxial_force_N(m, l3));
        const double stored = volume * free_energy(m, l3);
        print_message("kappa/mu %g: travel off by %.1e mm, energy by %.1e, balance %.1e\n",
                      bulk_ratios[i], b.state.d_mm - (1 - l3) * size_mm[2],
                      b.state.elastic_Nmm / stored - 1, report.energy_residual);
        assert_int_equal(report.reason, ISCHIA_CONVERGED);
        assert_true(report.force_residual <= 1e-8);
        assert_true(fabs(b.state.d_mm - (1 - l3) * size_mm[2]) < 1e-7);
        assert_true(fabs(b.state.elastic_Nmm / stored - 1) < 1e-7);
        assert_true(fabs(report.energy_residual) < 1e-3);
        bench_finish(&b);
    }
}

/* Travel of a bonded block under one force, with this friction on the seat. */
static double travel_mm(double friction, struct path_report *ret)
{
    struct bench b;
    block(&b, 2000, NODE_ON_BONE, friction);
    *ret = follow(&b, 1.0);
    const double d_mm = b.state.d_mm;
    bench_finish(&b);
    return d_mm;
}

static void friction_only_stiffens(void **state)
{
    (void)state;
    static const double frictions[] = {0, 0.1, 0.2, 0.4, 10};
    double before = HUGE_VAL, travel[5];
    for (int i = 0; i < 5; i++) {
        struct path_report report;
        travel[i] = travel_mm(frictions[i], &report);
        print_message("friction %g: travel %.4f mm, balance %.1e\n", frictions[i], travel[i],
                      report.energy_residual);
        assert_int_equal(report.reason, ISCHIA_CONVERGED);
        assert_true(fabs(report.energy_residual) < 5e-3);
        assert_true(travel[i] < before);
        before = travel[i];
    }
    assert_true(travel[4] < 0.95 * travel[0]);
}

/* --- the local model, row 1R of Table 2, coarse ----------------------------------------------- */

static const double row_1R[ISCHIA_PARAM_COUNT] = {6.9, 19.7, 28, 10, 8.0, 5.0, 196};

static void local_model(struct bench *b, double friction)
{
    struct ischia_case c = ischia_case_default();
    struct element_material material[TISSUE_COUNT];
    const double mu_kPa[TISSUE_COUNT] = {8, 5, 67};
    struct ischia_error err;
    for (int t = 0; t < TISSUE_COUNT; t++) {
        const double mu = MPa_from_kPa(mu_kPa[t]);
        material[t] = (struct element_material){mu, 2000 * mu, 0.3 * mu, 0.1 * mu};
    }
    memcpy(c.param, row_1R, sizeof row_1R);
    *b = (struct bench){0};
    must(mesh_local_init(&b->mesh, &c, &mesh_divisions[ISCHIA_COARSE], &err), &err);
    must(bench_init(b, material, friction, &err), &err);
}

static void local_model_keeps_its_energy(void **state)
{
    (void)state;
    const double step_mm = 0.25;
    struct bench b;
    struct ischia_error err;
    double work = 0, dissipated = 0, before_N = 0;
    local_model(&b, 0.4);
    for (int s = 1; s <= 80; s++) {
        must(bench_press(&b, step_mm * s, &err), &err);
        work += step_mm * (before_N + b.state.force_N) / 2;
        before_N = b.state.force_N;
        dissipated += bench_end_step(&b);
    }
    const double sprung = seat_energy(&b.seat, (const double(*)[3])b.state.u_mm);
    const double balance = (work - b.state.elastic_Nmm - sprung - dissipated) / work;
    print_message("at %.1f N: work %.2f N mm, balance %.1e, friction takes %.2f %%\n",
                  side_force_N(before_N), work, balance, 100 * dissipated / work);
    assert_true(dissipated > 0.002 * work);
    assert_true(fabs(balance) < 5e-3);
    bench_finish(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_path_meets_the_force_of_uniaxial_compression),
        cmocka_unit_test(friction_only_stiffens),
        cmocka_unit_test(local_model_keeps_its_energy),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
