/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/eigen3.h"
#include "tests/unit/near.h"

/* R = Rz Ry Rx by the given angles. */
static void rotation(const double angle[3], double ret[3][3])
{
    const double cx = cos(angle[0]), sx = sin(angle[0]), cy = cos(angle[1]), sy = sin(angle[1]);
    const double cz = cos(angle[2]), sz = sin(angle[2]);
    const double R[3][3] = {{cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx},
                            {sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx},
                            {-sy, cy * sx, cy * cx}};
    memcpy(ret, R, sizeof R);
}

/* A = R diag(value) R^T, symmetric to the bit. */
static void compose(const double value[3], const double angle[3], double ret[3][3])
{
    double R[3][3];
    rotation(angle, R);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j <= i; j++) {
            ret[i][j] = 0;
            for (int k = 0; k < 3; k++) ret[i][j] += R[i][k] * value[k] * R[j][k];
            ret[j][i] = ret[i][j];
        }
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double largest_of(const double value[3])
{
    return fmax(fabs(value[0]), fmax(fabs(value[1]), fabs(value[2])));
}

/* Orthonormal vectors whose dyads, by the values, make A again; the values are the expected. */
static void check(double A[3][3], const double expected[3])
{
    double value[3], v[3][3], sorted[3], wanted[3];
    const double scale = largest_of(expected);
    eigen3((const double(*)[3])A, value, v);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double made = 0, product = 0;
            for (int k = 0; k < 3; k++) made += value[k] * v[i][k] * v[j][k];
            for (int k = 0; k < 3; k++) product += v[k][i] * v[k][j];
            assert_near(made, A[i][j], 4e-15 * scale);
            assert_near(product, i == j, 4e-15);
        }
    memcpy(sorted, value, sizeof sorted);
    memcpy(wanted, expected, sizeof wanted);
    qsort(sorted, 3, sizeof sorted[0], compare);
    qsort(wanted, 3, sizeof wanted[0], compare);
    for (int k = 0; k < 3; k++) assert_near(sorted[k], wanted[k], 4e-15 * scale);
}

static void eigenvalues_of_every_kind(void **state)
{
    (void)state;
    static const double values[][3] = {
        {1, 2, 3},                 /* apart             */
        {2, 2, 5},                 /* two equal         */
        {4, 4, 4},                 /* three equal       */
        {1, 1 + 1e-12, 1 + 2e-12}, /* nearly equal      */
        {1, 1 + 1e-8, 7},          /* two nearly equal  */
        {1e-10, 1, 1e10},          /* graded            */
        {1e-200, 2e-200, 3e-200},  /* tiny              */
        {1e150, 2e150, 1e140},     /* huge              */
        {-3, 0, 3},                /* of both signs     */
        {-1, -1, 2},
        {0, 0, 1},
        {0, 0, 0},
    };
    static const double angles[][3] = {
        {0, 0, 0}, {0.3, -0.7, 1.1}, {M_PI_4, M_PI_4, M_PI_4}, {1e-9, 0, 0}, {0, M_PI_2, 1e-5}};
    for (size_t i = 0; i < sizeof values / sizeof values[0]; i++)
        for (size_t j = 0; j < sizeof angles / sizeof angles[0]; j++) {
            double A[3][3];
            compose(values[i], angles[j], A);
            check(A, values[i]);
        }
}

/* In a matrix D M D with M well conditioned, even the smallest value is right to its own digits:
 * what makes small stretches of a badly compressed element usable. */
static void graded_matrix_keeps_small_values(void **state)
{
    (void)state;
    const double d[3] = {1, 1e-4, 1e-8};
    const double M[3][3] = {{2, 0.3, -0.2}, {0.3, 1, 0.4}, {-0.2, 0.4, 3}};
    double A[3][3], value[3], v[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) A[i][j] = d[i] * M[i][j] * d[j];
    eigen3((const double(*)[3])A, value, v);
    const double product = value[0] * value[1] * value[2];
    const double det = 2 * (1 * 3 - 0.16) - 0.3 * (0.9 + 0.08) - 0.2 * (0.12 + 0.2);
    assert_near(product / (det * 1e-24), 1, 1e-12);
}

static void same_matrix_same_bits(void **state)
{
    (void)state;
    double A[3][3], value[2][3], v[2][3][3];
    compose((const double[3]){1, 1 + 1e-13, 2}, (const double[3]){0.1, 0.2, 0.3}, A);
    for (int i = 0; i < 2; i++) eigen3((const double(*)[3])A, value[i], v[i]);
    assert_memory_equal(value[0], value[1], sizeof value[0]);
    assert_memory_equal(v[0], v[1], sizeof v[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(eigenvalues_of_every_kind),
        cmocka_unit_test(graded_matrix_keeps_small_values),
        cmocka_unit_test(same_matrix_same_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
