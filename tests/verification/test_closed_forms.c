/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Homogeneous deformations of one element against closed forms of the incompressible Ogden law,
 *
 *     s_i - s_j = 2 mu / alpha (l_i^alpha - l_j^alpha)        (Cauchy stress, J = 1; Ogden 1972),
 *
 * and the volumetric stress kappa (J - 1) of a pure dilatation.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "solver/element.h"
#include "solver/ogden.h"

static const struct element_material soft = {
    .mu_MPa = 0.008, .kappa_MPa = 16, .kappa_point_MPa = 0};

static const double cube[HEX_NODES][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                          {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};

/* Nominal stress P of the unit cube under x = F X: ret[i][j], force in i on the face whose normal
 * is j. */
static void nominal_stress(const double F[3][3], double ret[3][3])
{
    struct element_reference reference;
    struct element_derivatives derivatives;
    double u[HEX_NODES][3];
    element_reference_init(&reference, cube);
    for (int n = 0; n < HEX_NODES; n++)
        for (int i = 0; i < 3; i++) {
            u[n][i] = -cube[n][i];
            for (int j = 0; j < 3; j++) u[n][i] += F[i][j] * cube[n][j];
        }
    assert_true(element_energy(&reference, &soft, (const double(*)[3])u, NULL, &derivatives) <
                HUGE_VAL);
    memset(ret, 0, 9 * sizeof **ret);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int n = 0; n < HEX_NODES; n++) ret[i][j] += cube[n][j] * derivatives.force[i][n];
}

static void check(double found, double expected)
{
    const double tolerance = 1e-11 * fmax(fabs(expected), soft.mu_MPa);
    if (fabs(found - expected) > tolerance) fail_msg("%.15g, expected %.15g", found, expected);
}

/* Difference of the Cauchy stresses 1 and 3 of a volume-preserving stretch. */
static void check_stretch(double l1, double l2, double l3)
{
    const double F[3][3] = {{l1, 0, 0}, {0, l2, 0}, {0, 0, l3}};
    double P[3][3];
    nominal_stress(F, P);
    check(P[0][0] * l1 - P[2][2] * l3,
          2 * soft.mu_MPa / OGDEN_ALPHA * (pow(l1, OGDEN_ALPHA) - pow(l3, OGDEN_ALPHA)));
    check(P[0][0] * l1 - P[1][1] * l2,
          2 * soft.mu_MPa / OGDEN_ALPHA * (pow(l1, OGDEN_ALPHA) - pow(l2, OGDEN_ALPHA)));
    check(P[0][1], 0);
}

static void uniaxial(void **state)
{
    (void)state;
    for (int i = 3; i <= 30; i++) check_stretch(0.1 * i, 1 / sqrt(0.1 * i), 1 / sqrt(0.1 * i));
}

static void equibiaxial(void **state)
{
    (void)state;
    for (int i = 5; i <= 20; i++) check_stretch(0.1 * i, 0.1 * i, 100.0 / (i * i));
}

static void simple_shear(void **state)
{
    (void)state;
    for (int step = -12; step <= 12; step++) {
        const double gamma = 0.25 * step;
        const double F[3][3] = {{1, gamma, 0}, {0, 1, 0}, {0, 0, 1}};
        const double l = gamma / 2 + sqrt(1 + gamma * gamma / 4);
        double P[3][3];
        nominal_stress(F, P);
        check(P[0][1], 2 * soft.mu_MPa / OGDEN_ALPHA *
                           (pow(l, OGDEN_ALPHA) - pow(l, -OGDEN_ALPHA)) / (l + 1 / l));
        check(P[0][2], 0);
    }
}

static void dilatation(void **state)
{
    (void)state;
    for (int step = -2; step <= 2; step++) {
        const double l = 1 + 0.05 * step;
        const double F[3][3] = {{l, 0, 0}, {0, l, 0}, {0, 0, l}};
        double P[3][3];
        nominal_stress(F, P);
        check(P[0][0] / (l * l), soft.kappa_MPa * (l * l * l - 1));
    }
}

static void mu_is_the_initial_shear_modulus(void **state)
{
    (void)state;
    const double gamma = 1e-5, F[3][3] = {{1, gamma, 0}, {0, 1, 0}, {0, 0, 1}};
    double P[3][3];
    nominal_stress(F, P);
    assert_true(fabs(P[0][1] / gamma / soft.mu_MPa - 1) < 1e-8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(uniaxial),
        cmocka_unit_test(equibiaxial),
        cmocka_unit_test(simple_shear),
        cmocka_unit_test(dilatation),
        cmocka_unit_test(mu_is_the_initial_shear_modulus),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
