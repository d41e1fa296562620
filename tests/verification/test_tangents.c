/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * `ischia check-tangent` passes, and it can fail: each derivative that the solver takes by hand is
 * put wrong in turn, by one part in ten thousand of its size, and must be found out. The linker
 * sends the calls through here (-Wl,--wrap). The oracle behind it is finite differences of energies
 * and forces, at states with three, two and nearly two equal stretches among others (check.c).
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "solver/element.h"
#include "solver/ogden.h"
#include "solver/seat.h"
#include "solver/solver.h"

static const double error_share = 1e-4;

enum fault {
    NO_FAULT,
    LAW_GRADIENT,
    LAW_NORMAL,
    LAW_MIXED,
    LAW_EVEN,
    LAW_ODD,
    ELEMENT_FORCE,
    ELEMENT_STIFFNESS,
    FRICTION_FORCE,
    FRICTION_STIFFNESS,
    FAULT_COUNT
};
static const char *const fault_names[FAULT_COUNT] = {
    [NO_FAULT] = "none",
    [LAW_GRADIENT] = "dW/ds_1",
    [LAW_NORMAL] = "d2W/ds_2 ds_2",
    [LAW_MIXED] = "d2W/ds_1 ds_3",
    [LAW_EVEN] = "(g_2 - g_3) / (s_2 - s_3)",
    [LAW_ODD] = "(g_1 + g_2) / (s_1 + s_2)",
    [ELEMENT_FORCE] = "element force",
    [ELEMENT_STIFFNESS] = "element stiffness",
    [FRICTION_FORCE] = "friction force",
    [FRICTION_STIFFNESS] = "friction stiffness",
};
static enum fault fault;

static double factor; /* what the fault multiplies by */

static void spoil(enum fault where, double *value)
{
    if (fault == where) *value *= factor;
}

void __real_ogden_derivatives(double mu_MPa, double pressure_MPa, const double stretch[3],
                              struct ogden_derivatives *ret);
void __wrap_ogden_derivatives(double mu_MPa, double pressure_MPa, const double stretch[3],
                              struct ogden_derivatives *ret);
double __real_element_energy(const struct element_reference *ref,
                             const struct element_material *material,
                             const double u_mm[HEX_NODES][3], const struct element_tangent *tangent,
                             struct element_derivatives *ret);
double __wrap_element_energy(const struct element_reference *ref,
                             const struct element_material *material,
                             const double u_mm[HEX_NODES][3], const struct element_tangent *tangent,
                             struct element_derivatives *ret);
void __real_seat_add_force(const struct seat *seat, const double *normal_N, const double (*u_mm)[3],
                           double (*force_N)[3]);
void __wrap_seat_add_force(const struct seat *seat, const double *normal_N, const double (*u_mm)[3],
                           double (*force_N)[3]);
void __real_seat_hessian(const struct seat *seat, const double (*u_mm)[3], int node,
                         double ret[2][2]);
void __wrap_seat_hessian(const struct seat *seat, const double (*u_mm)[3], int node,
                         double ret[2][2]);

void __wrap_ogden_derivatives(double mu_MPa, double pressure_MPa, const double stretch[3],
                              struct ogden_derivatives *ret)
{
    __real_ogden_derivatives(mu_MPa, pressure_MPa, stretch, ret);
    spoil(LAW_GRADIENT, &ret->gradient[0]);
    spoil(LAW_NORMAL, &ret->normal[1][1]);
    spoil(LAW_MIXED, &ret->normal[0][2]);
    spoil(LAW_EVEN, &ret->even[0]);
    spoil(LAW_ODD, &ret->odd[2]);
}

double __wrap_element_energy(const struct element_reference *ref,
                             const struct element_material *material,
                             const double u_mm[HEX_NODES][3], const struct element_tangent *tangent,
                             struct element_derivatives *ret)
{
    const double energy = __real_element_energy(ref, material, u_mm, tangent, ret);
    if (ret == NULL) return energy;
    spoil(ELEMENT_FORCE, &ret->force[1][3]);
    if (tangent != NULL) spoil(ELEMENT_STIFFNESS, &ret->stiffness[5][5]);
    return energy;
}

void __wrap_seat_add_force(const struct seat *seat, const double *normal_N, const double (*u_mm)[3],
                           double (*force_N)[3])
{
    __real_seat_add_force(seat, normal_N, u_mm, force_N);
    spoil(FRICTION_FORCE, &force_N[0][0]);
}

void __wrap_seat_hessian(const struct seat *seat, const double (*u_mm)[3], int node,
                         double ret[2][2])
{
    __real_seat_hessian(seat, u_mm, node, ret);
    spoil(FRICTION_STIFFNESS, &ret[1][1]);
}

static enum ischia_code check_with(enum fault wrong, double wrong_factor)
{
    FILE *out = tmpfile();
    assert_non_null(out);
    fault = wrong;
    factor = wrong_factor;
    const enum ischia_code code = ischia_check_tangents(out, NULL);
    fault = NO_FAULT;
    assert_int_equal(fclose(out), 0);
    return code;
}

static void hand_written_tangents_agree_with_differences(void **state)
{
    (void)state;
    assert_int_equal(check_with(NO_FAULT, 1), ISCHIA_OK);
}

static void a_wrong_derivative_is_found_out(void **state)
{
    (void)state;
    for (int f = NO_FAULT + 1; f < FAULT_COUNT; f++)
        if (check_with((enum fault)f, 1 + error_share) != ISCHIA_E_NUMERIC)
            fail_msg("an error in %s was not noticed", fault_names[f]);
}

static void a_derivative_that_is_no_number_is_found_out(void **state)
{
    (void)state;
    for (int f = NO_FAULT + 1; f < FAULT_COUNT; f++)
        if (check_with((enum fault)f, (double)NAN) != ISCHIA_E_NUMERIC)
            fail_msg("NaN for %s was not noticed", fault_names[f]);
}

/* g_i and the quotients at equal stretches against their limits: even = H_ii - H_ij. */
static void equal_stretches_are_the_limit_of_unequal_ones(void **state)
{
    (void)state;
    const double mu = 0.008, pressure = 0.03;
    for (int step = 0; step < 8; step++) {
        const double s = 0.4 + 0.3 * step, equal[3] = {s, s, s};
        struct ogden_derivatives d;
        ogden_derivatives(mu, pressure, equal, &d);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const double limit = d.normal[i][i] - d.normal[i][j];
            assert_true(fabs(d.even[k] - limit) < 1e-13 * (fabs(limit) + mu));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hand_written_tangents_agree_with_differences),
        cmocka_unit_test(a_wrong_derivative_is_found_out),
        cmocka_unit_test(a_derivative_that_is_no_number_is_found_out),
        cmocka_unit_test(equal_stretches_are_the_limit_of_unequal_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
