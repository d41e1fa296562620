/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/axis.h"
#include "tests/unit/near.h"

/* An axis by itself: on each level a node at z, and two neighbours along +x and +y each. */
enum { LEVELS = 4, NODES = 5 * LEVELS };
static double X[NODES][3], u[NODES][3];
static int rows[LEVELS][5];

static struct mesh axis_mesh(void)
{
    static const double offset[5][2] = {{0, 0}, {1, 0}, {2.5, 0}, {0, 1.5}, {0, 2}};
    memset(u, 0, sizeof u);
    for (int l = 0; l < LEVELS; l++)
        for (int k = 0; k < 5; k++) {
            const int n = 5 * l + k;
            rows[l][k] = n;
            X[n][0] = offset[k][0];
            X[n][1] = offset[k][1];
            X[n][2] =
                40 - 3 * l - 0.1 * (offset[k][0] + offset[k][1]); /* levels need not be flat */
        }
    return (struct mesh){
        .X_mm = X, .axis = rows, .axis_count = LEVELS, .node_count = NODES, .tip_z_mm = 40};
}

static void at_rest_there_is_no_shear(void **state)
{
    (void)state;
    const struct mesh mesh = axis_mesh();
    const struct axis_strain s = axis_strain_of(&mesh, (const double(*)[3])u);
    assert_true(s.recovered == 0 && s.raw == 0);
}

static void homogeneous_field_is_read_exactly(void **state)
{
    (void)state;
    static const double stretch[3] = {1.4, 1.25, 1 / (1.4 * 1.25)};
    const struct mesh mesh = axis_mesh();
    for (int n = 0; n < NODES; n++)
        for (int k = 0; k < 3; k++) u[n][k] = (stretch[k] - 1) * X[n][k];
    const struct axis_strain s = axis_strain_of(&mesh, (const double(*)[3])u);
    const double expected = (1.4 - 1 / (1.4 * 1.25)) / 2;
    assert_near(s.recovered, expected, 1e-14);
    assert_near(s.raw, expected, 1e-14);
}

/* u_x = a X + b X^3 at one level: the slope on the axis is a, whatever b; the raw one is not. */
static void cubic_field_peaks_where_it_should(void **state)
{
    (void)state;
    const struct mesh mesh = axis_mesh();
    const double a = 0.6, b = -0.03;
    for (int k = 0; k < 5; k++) {
        double *at = u[5 * 2 + k];
        const double *p = X[5 * 2 + k];
        at[0] = a * p[0] + b * pow(p[0], 3);
        at[1] = 0.2 * p[1] + 0.01 * pow(p[1], 3);
    }
    const struct axis_strain s = axis_strain_of(&mesh, (const double(*)[3])u);
    assert_near(s.recovered, (1.6 - 1 / (1.6 * 1.2)) / 2, 1e-14);
    assert_near(s.depth_mm, 6, 1e-12);
    /* Raw: the mean of this level and one at rest, between the nodes next to the axis. */
    assert_near(s.raw, (1 + (a + b) / 2 - 1) / 2, 1e-14);
}

/* Shear that rises with depth is largest at the muscle's end, half an element beyond the last mean:
 * both readings are the same there when it rises evenly. */
static void the_muscles_end_counts(void **state)
{
    (void)state;
    const struct mesh mesh = axis_mesh();
    for (int l = 0; l < LEVELS; l++)
        for (int k = 0; k < 5; k++)
            for (int c = 0; c < 2; c++) u[5 * l + k][c] = 0.1 * l * X[5 * l + k][c];
    /* raw: (1 + 0.1 l - 1) / 2, z does not move; means at l = 0.5, 1.5, 2.5; the end is l = 3 */
    const struct axis_strain s = axis_strain_of(&mesh, (const double(*)[3])u);
    assert_near(s.raw, 0.15, 1e-14);
    assert_near(s.eps_max, s.recovered + (s.recovered - s.raw) / 2, 1e-14);
    assert_near(s.depth_mm, 9, 1e-12);
}

static void a_folded_level_does_not_count(void **state)
{
    (void)state;
    const struct mesh mesh = axis_mesh();
    for (int k = 0; k < 5; k++) u[5 + k][0] = -1.5 * X[5 + k][0];
    for (int k = 0; k < 5; k++) u[10 + k][0] = 0.1 * X[10 + k][0];
    const struct axis_strain s = axis_strain_of(&mesh, (const double(*)[3])u);
    assert_near(s.recovered, (1.1 - 1 / 1.1) / 2, 1e-14);
    assert_near(s.depth_mm, 6, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(at_rest_there_is_no_shear),
        cmocka_unit_test(homogeneous_field_is_read_exactly),
        cmocka_unit_test(cubic_field_peaks_where_it_should),
        cmocka_unit_test(the_muscles_end_counts),
        cmocka_unit_test(a_folded_level_does_not_count),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
