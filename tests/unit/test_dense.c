/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/dense.h"
#include "tests/unit/near.h"

enum { N = 6 };

/* A lower triangle with something above it that must not count. */
static void lower_triangle(double ret[N * N])
{
    for (int j = 0; j < N; j++)
        for (int i = 0; i < N; i++) ret[j * N + i] = i < j ? 99 : i == j ? 2 + i : sin(3.0 * i + j);
}

static double lower(const double *L, int i, int j) { return i < j ? 0 : L[j * N + i]; }

static void square_is_that_of_the_triangle(void **state)
{
    (void)state;
    double L[N * N], A[N * N];
    lower_triangle(L);
    dense_square_of_lower(N, L, A);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            double sum = 0;
            for (int k = 0; k < N; k++) sum += lower(L, i, k) * lower(L, j, k);
            assert_near(A[j * N + i], sum, 1e-13);
        }
}

static void products_are_those_of_the_matrix(void **state)
{
    (void)state;
    double L[N * N], A[N * N], x[N], forth[N], back[N], y[N];
    lower_triangle(L);
    dense_square_of_lower(N, L, A);
    for (int i = 0; i < N; i++) x[i] = forth[i] = back[i] = cos(i);
    dense_multiply_lower(N, L, false, forth);
    dense_multiply_lower(N, L, true, back);
    dense_multiply(N, A, x, y);
    for (int i = 0; i < N; i++) {
        double first = 0, second = 0, third = 0;
        for (int j = 0; j < N; j++) {
            first += lower(L, i, j) * x[j];
            second += lower(L, j, i) * x[j];
            third += A[j * N + i] * x[j];
        }
        assert_near(forth[i], first, 1e-14);
        assert_near(back[i], second, 1e-14);
        assert_near(y[i], third, 1e-13);
    }
}

static void definiteness_is_found(void **state)
{
    (void)state;
    double L[N * N], A[N * N], B[N * N];
    lower_triangle(L);
    dense_square_of_lower(N, L, A);
    memcpy(B, A, sizeof B);
    assert_true(dense_is_definite(N, B));
    memcpy(B, A, sizeof B);
    B[N * N - 1] = -1;
    assert_false(dense_is_definite(N, B));
    assert_true(dense_is_definite(0, B));
}

static void solution_solves(void **state)
{
    (void)state;
    double A[N * N], B[N * N], x[N], y[N];
    int pivot[N];
    for (int i = 0; i < N * N; i++) A[i] = sin(7.0 * i) + (i % (N + 1) == 3); /* needs pivots */
    for (int i = 0; i < N; i++) x[i] = cos(i);
    memcpy(B, A, sizeof B);
    assert_true(dense_solve(N, B, pivot, x));
    dense_multiply(N, A, x, y);
    for (int i = 0; i < N; i++) assert_near(y[i], cos(i), 1e-11);
    memset(B, 0, sizeof B);
    assert_false(dense_solve(N, B, pivot, x));
    memcpy(B, A, sizeof B);
    x[2] = (double)NAN;
    assert_false(dense_solve(N, B, pivot, x));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(square_is_that_of_the_triangle),
        cmocka_unit_test(products_are_those_of_the_matrix),
        cmocka_unit_test(definiteness_is_found),
        cmocka_unit_test(solution_solves),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
