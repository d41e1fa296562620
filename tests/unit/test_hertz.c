/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "near.h"
#include "solver/study/hertz.h"

static const double pi = 3.14159265358979323846;

static struct ischia_case ball(double R_mm, double layer_mm, double mu_kPa, double F_N)
{
    struct ischia_case c = ischia_case_default();
    const double param[] = {R_mm, R_mm, layer_mm / 2, layer_mm / 2, mu_kPa, mu_kPa, F_N};
    memcpy(c.param, param, sizeof param);
    c.option[ISCHIA_R2_SURFACE] = 1;
    return c;
}

static void a_ball_on_a_thick_layer_is_hertz(void **state)
{
    (void)state;
    /* delta^3 = (9/16) F^2 / (R E*^2), a^2 = R delta, p0 = 3F / (2 pi a^2); the layer's correction
     * is put in by hand: chi = a / h. */
    const struct ischia_case c = ball(8, 110, 30, 1);
    const struct hertz_baseline r = hertz_baseline_of(&c);
    const double a = r.contact_a_mm, chi = a / 110, E_star_MPa = 4 * 30e-3;
    const double corrected =
        1 / (1 + 1.133 * chi + 1.283 * chi * chi + 0.769 * pow(chi, 3) + 0.0975 * pow(chi, 4));
    assert_near(r.contact_b_mm, a, 1e-6 * a);
    assert_near(a * a, 8 * r.indentation_mm, 1e-6);
    assert_near(pow(r.indentation_mm, 3),
                9.0 / 16 * corrected * corrected / (8 * E_star_MPa * E_star_MPa), 1e-6);
    assert_near(r.peak_pressure_kPa, 1500 * corrected / (pi * a * a), 1e-3);
}

static void a_circle_has_the_closed_form_on_its_axis(void **state)
{
    (void)state;
    /* Incompressible: sigma_r - sigma_z = p0 (3/2 / (1 + s^2) - 3/2 (1 - s atan(1/s))), s = z/a;
     * (Johnson 1985, eq. 3.45 with nu = 1/2). */
    double best = 0, where = 0, depth;
    for (double s = 0.1; s < 2; s += 1e-4) {
        const double d = 1.5 / (1 + s * s) - 1.5 * (1 - s * atan(1 / s));
        if (d > best) best = d, where = s;
    }
    assert_near(hertz_axis_shear(1, &depth), best, 1e-5);
    assert_near(depth, where, 2e-3);
}

static void a_long_contact_tends_to_the_cylinder(void **state)
{
    (void)state;
    /* Line contact: largest shear 0.300 p0 at 0.786 b (Johnson 1985, section 4.2c). */
    double depth;
    assert_near(hertz_axis_shear(0.02, &depth) / 2, 0.300, 2e-3);
    assert_near(depth, 0.786, 0.02);
}

static void an_ellipse_obeys_the_published_table(void **state)
{
    (void)state;
    /* R''/R' = 3.0: b/a = 0.49 within the rule b/a ~ (R'/R'')^(-2/3), good to a few per cent. */
    struct ischia_case c = ball(8, 110, 30, 1);
    c.param[ISCHIA_R2] = 24;
    const struct hertz_baseline r = hertz_baseline_of(&c);
    assert_near(r.contact_b_mm / r.contact_a_mm, pow(3, -2.0 / 3), 0.02);
    assert_true(r.valid == (r.indentation_mm <= 11 && r.contact_a_mm <= 55 && r.eps_max <= 0.1));
}

static void more_force_and_softer_tissue_strain_more(void **state)
{
    (void)state;
    struct ischia_case c = ball(8, 40, 5, 250);
    const double reference = hertz_baseline_of(&c).eps_max;
    assert_false(hertz_baseline_of(&c).valid);
    c.param[ISCHIA_F] = 300;
    assert_true(hertz_baseline_of(&c).eps_max > reference);
    c.param[ISCHIA_F] = 250;
    c.param[ISCHIA_MUM] = 3;
    assert_true(hertz_baseline_of(&c).eps_max > reference);
    c.param[ISCHIA_MUM] = 5;
    c.param[ISCHIA_R2] = 30;
    assert_true(hertz_baseline_of(&c).eps_max < reference);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ball_on_a_thick_layer_is_hertz),
        cmocka_unit_test(a_circle_has_the_closed_form_on_its_axis),
        cmocka_unit_test(a_long_contact_tends_to_the_cylinder),
        cmocka_unit_test(an_ellipse_obeys_the_published_table),
        cmocka_unit_test(more_force_and_softer_tissue_strain_more),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
