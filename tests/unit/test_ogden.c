/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/ogden.h"
#include "tests/unit/near.h"

static const double mu_MPa = 0.008;

/* Stretches that a solve meets: small, equal in pairs, nearly equal, far apart, not isochoric. */
static const double states[][3] = {
    {1, 1, 1},       {1.01, 0.98, 1.02},     {1.7, 1.7, 0.3}, {0.6, 1.3, 1.3},
    {2.4, 1.6, 0.2}, {1.2, 1.2 + 1e-9, 0.8}, {1.4, 1.5, 1.6}, {0.5, 0.5, 0.5},
};
enum { STATE_COUNT = sizeof states / sizeof states[0] };

/* The definition, by pow instead of powers written out. */
static double energy_by_definition(const double s[3])
{
    const double J = s[0] * s[1] * s[2];
    double sum = -3;
    for (int i = 0; i < 3; i++) sum += pow(s[i] * pow(J, -1.0 / 3), OGDEN_ALPHA);
    return 2 * mu_MPa / (OGDEN_ALPHA * OGDEN_ALPHA) * sum;
}

static void energy_is_the_definition(void **state)
{
    (void)state;
    for (int i = 0; i < STATE_COUNT; i++)
        assert_near(ogden_energy(mu_MPa, states[i]), energy_by_definition(states[i]), 1e-13);
}

static void energy_ignores_a_change_of_size(void **state)
{
    (void)state;
    for (int i = 0; i < STATE_COUNT; i++) {
        const double larger[3] = {3 * states[i][0], 3 * states[i][1], 3 * states[i][2]};
        const double W = ogden_energy(mu_MPa, states[i]);
        assert_near(ogden_energy(mu_MPa, larger), W, 1e-13 * (1 + W));
    }
}

/* At rest: no stress, shear modulus mu (the convention of the header), no bulk stiffness. */
static void mu_is_the_initial_shear_modulus(void **state)
{
    (void)state;
    struct ogden_derivatives d;
    ogden_derivatives(mu_MPa, 0, (const double[3]){1, 1, 1}, &d);
    for (int i = 0; i < 3; i++) {
        assert_near(d.gradient[i], 0, 1e-16);
        assert_near(d.even[i], 2 * mu_MPa, 1e-15);
        assert_near(d.odd[i], 0, 1e-16);
        for (int j = 0; j < 3; j++)
            assert_near(d.normal[i][j], 2 * mu_MPa * ((i == j) - 1.0 / 3), 1e-15);
    }
}

static double total_energy(const double s[3], double pressure)
{
    return ogden_energy(mu_MPa, s) + pressure * s[0] * s[1] * s[2];
}

static void moved(const double s[3], int i, double by, double ret[3])
{
    memcpy(ret, s, sizeof(double[3]));
    ret[i] += by;
}

static void derivatives_match_differences(void **state)
{
    (void)state;
    static const double h = 1e-6, pressure = -0.03;
    for (int k = 0; k < STATE_COUNT; k++) {
        struct ogden_derivatives d, plus, minus;
        ogden_derivatives(mu_MPa, pressure, states[k], &d);
        for (int i = 0; i < 3; i++) {
            double up[3], down[3];
            moved(states[k], i, h, up);
            moved(states[k], i, -h, down);
            const double slope =
                (total_energy(up, pressure) - total_energy(down, pressure)) / (2 * h);
            assert_near(d.gradient[i], slope, 1e-8 * (1 + fabs(slope)));
            ogden_derivatives(mu_MPa, pressure, up, &plus);
            ogden_derivatives(mu_MPa, pressure, down, &minus);
            for (int j = 0; j < 3; j++) {
                const double rate = (plus.gradient[j] - minus.gradient[j]) / (2 * h);
                assert_near(d.normal[j][i], rate, 1e-8 * (1 + fabs(rate)));
            }
        }
    }
}

/* The quotients are written as polynomials; here they are taken as quotients, or as their limit
 * d2W/ds_i2 - d2W/ds_i ds_j where the two stretches are the same. */
static void quotients_are_those_of_the_gradient(void **state)
{
    (void)state;
    for (int n = 0; n < STATE_COUNT; n++) {
        const double *s = states[n];
        struct ogden_derivatives d;
        ogden_derivatives(mu_MPa, 0.02, s, &d);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const double *g = d.gradient;
            assert_near(d.odd[k], (g[i] + g[j]) / (s[i] + s[j]), 1e-14 * (1 + fabs(d.odd[k])));
            const double even = fabs(s[i] - s[j]) < 1e-6 ? d.normal[i][i] - d.normal[i][j]
                                                         : (g[i] - g[j]) / (s[i] - s[j]);
            assert_near(d.even[k], even, 1e-9 * (1 + fabs(even)));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(energy_is_the_definition),
        cmocka_unit_test(energy_ignores_a_change_of_size),
        cmocka_unit_test(mu_is_the_initial_shear_modulus),
        cmocka_unit_test(derivatives_match_differences),
        cmocka_unit_test(quotients_are_those_of_the_gradient),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
