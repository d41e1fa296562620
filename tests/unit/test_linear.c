/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "solver/linear.h"
#include "tests/unit/near.h"

/* A dense symmetric matrix and the same as a struct linear: a band and some entries outside it, or
 * the diagonal alone. */
enum { N_MAX = 50 };

struct pair {
    int n;
    double dense[N_MAX][N_MAX];
    int start[N_MAX + 1], row[N_MAX * N_MAX];
    struct linear *sparse;
};

static bool is_present(int i, int j, int band)
{
    return i == j || (band > 0 && (abs(i - j) <= band || (i + j) % 7 == 0));
}

static void must(enum ischia_code code, const struct ischia_error *err)
{
    if (code != ISCHIA_OK) fail_msg("%s", err->message);
}

static void pair_init_with_tail(struct pair *p, int n, int band, int tail)
{
    struct ischia_error err;
    int count = 0;
    *p = (struct pair){.n = n};
    for (int j = 0; j < n; j++) {
        for (int i = j; i < n; i++)
            if (is_present(i, j, band)) p->row[count++] = i;
        p->start[j + 1] = count;
    }
    must(linear_create(&p->sparse, n, tail, p->start, p->row, &err), &err);
}

static void pair_init(struct pair *p, int n, int band) { pair_init_with_tail(p, n, band, 0); }

/* Diagonally dominant, times `scale`. */
static void pair_fill(struct pair *p, double scale)
{
    double *value = linear_values(p->sparse);
    memset(p->dense, 0, sizeof p->dense);
    for (int j = 0; j < p->n; j++)
        for (int k = p->start[j]; k < p->start[j + 1]; k++) {
            const int i = p->row[k];
            value[k] = scale * (i == j ? p->n + 1.0 : sin(3.0 * i + 5.0 * j));
            p->dense[i][j] = p->dense[j][i] = value[k];
        }
}

static void set_entry(struct pair *p, int i, int j, double value)
{
    for (int k = p->start[j]; k < p->start[j + 1]; k++)
        if (p->row[k] == i) linear_values(p->sparse)[k] = value;
    p->dense[i][j] = p->dense[j][i] = value;
}

/* Gauss elimination on a copy. */
static void dense_solve(const struct pair *p, double *x)
{
    double a[N_MAX][N_MAX];
    memcpy(a, p->dense, sizeof a);
    for (int k = 0; k < p->n; k++)
        for (int i = k + 1; i < p->n; i++) { /* dominant: no pivoting needed */
            const double factor = a[i][k] / a[k][k];
            for (int j = k; j < p->n; j++) a[i][j] -= factor * a[k][j];
            x[i] -= factor * x[k];
        }
    for (int i = p->n - 1; i >= 0; i--) {
        for (int j = i + 1; j < p->n; j++) x[i] -= a[i][j] * x[j];
        x[i] /= a[i][i];
    }
}

static void factor(struct pair *p, const unsigned char *keep, enum linear_outcome expected)
{
    struct ischia_error err;
    enum linear_outcome outcome;
    must(linear_factor(p->sparse, keep, &outcome, &err), &err);
    assert_int_equal(outcome, expected);
}

/* Without a tail, the two halves of a solution are all of it. */
static void solve(struct pair *p, int count, double *x)
{
    struct ischia_error err;
    must(linear_reduce(p->sparse, count, x, &err), &err);
    for (int r = 0; r < count; r++) must(linear_expand(p->sparse, x + r * p->n, &err), &err);
}

static void solution_is_the_dense_one(void **state)
{
    (void)state;
    static const int sizes[] = {1, 2, 7, N_MAX};
    struct pair p;
    for (size_t s = 0; s < sizeof sizes / sizeof sizes[0]; s++) {
        double x[3][N_MAX], flat[3 * N_MAX];
        pair_init(&p, sizes[s], 2);
        for (int magnitude = -1; magnitude <= 1; magnitude++) {
            const double scale = pow(1e6, magnitude);
            pair_fill(&p, scale);
            factor(&p, NULL, LINEAR_FACTORED);
            for (int r = 0; r < 3; r++)
                for (int i = 0; i < p.n; i++) flat[r * p.n + i] = x[r][i] = cos(i + 2.0 * r);
            solve(&p, 3, flat);
            for (int r = 0; r < 3; r++) {
                dense_solve(&p, x[r]);
                for (int i = 0; i < p.n; i++)
                    assert_near(flat[r * p.n + i], x[r][i], 1e-13 / scale);
            }
        }
        linear_destroy(p.sparse);
    }
}

static void multiply_is_the_dense_one(void **state)
{
    (void)state;
    struct pair p;
    double x[N_MAX], y[N_MAX];
    pair_init(&p, N_MAX, 3);
    pair_fill(&p, 1);
    for (int i = 0; i < p.n; i++) x[i] = sin(7.0 * i);
    linear_multiply(p.sparse, x, y);
    for (int i = 0; i < p.n; i++) {
        double sum = 0;
        for (int j = 0; j < p.n; j++) sum += p.dense[i][j] * x[j];
        assert_near(y[i], sum, 1e-12);
    }
    linear_clear(p.sparse);
    linear_multiply(p.sparse, x, y);
    for (int i = 0; i < p.n; i++) assert_true(y[i] == 0);
    linear_destroy(p.sparse);
}

/* The tail's own part of A^-1 is S^-1: its columns, solved by elimination, are those of S. */
static void check_condensed(const struct pair *p, int tail, const double *S)
{
    const int first = p->n - tail;
    for (int j = 0; j < tail; j++) {
        double column[N_MAX] = {0};
        column[first + j] = 1;
        dense_solve(p, column);
        for (int i = 0; i < tail; i++) {
            double product = 0;
            for (int k = 0; k < tail; k++) product += S[k * tail + i] * column[first + k];
            assert_near(product, i == j, 1e-12);
        }
    }
}

static void tail_is_condensed(void **state)
{
    (void)state;
    static const int tails[] = {1, 5, 17, N_MAX};
    static double S[N_MAX * N_MAX];
    struct pair p;
    for (size_t t = 0; t < sizeof tails / sizeof tails[0]; t++) {
        struct ischia_error err;
        const int tail = tails[t];
        double x[N_MAX], expected[N_MAX], reduced[N_MAX] = {0};
        pair_init_with_tail(&p, N_MAX, 4, tail);
        pair_fill(&p, 1);
        factor(&p, NULL, LINEAR_FACTORED);
        linear_condensed(p.sparse, S);
        check_condensed(&p, tail, S);
        for (int i = 0; i < p.n; i++) x[i] = expected[i] = cos(i);
        dense_solve(&p, expected);
        must(linear_reduce(p.sparse, 1, x, &err), &err);
        for (int i = 0; i < tail; i++)
            for (int k = 0; k < tail; k++) reduced[i] += S[k * tail + i] * expected[p.n - tail + k];
        for (int i = 0; i < tail; i++) {
            assert_near(x[p.n - tail + i], reduced[i], 1e-12);
            x[p.n - tail + i] = expected[p.n - tail + i];
        }
        must(linear_expand(p.sparse, x, &err), &err);
        for (int i = 0; i < p.n; i++) assert_near(x[i], expected[i], 1e-13);
        linear_destroy(p.sparse);
    }
}

/* An order is a permutation that leaves the tail where it is. */
static void order_keeps_the_tail(void **state)
{
    (void)state;
    struct pair p;
    for (int tail = 0; tail <= N_MAX; tail += 10) {
        struct ischia_error err;
        int order[N_MAX], seen[N_MAX] = {0};
        pair_init_with_tail(&p, N_MAX, 4, tail);
        must(linear_order(N_MAX, tail, p.start, p.row, order, &err), &err);
        for (int k = 0; k < N_MAX; k++) {
            assert_in_range(order[k], 0, N_MAX - 1);
            seen[order[k]]++;
            if (k >= N_MAX - tail) assert_int_equal(order[k], k);
        }
        for (int k = 0; k < N_MAX; k++) assert_int_equal(seen[k], 1);
        linear_destroy(p.sparse);
    }
}

/* What is eliminated must be definite; the tail need not, and is condensed as it is. */
static void tail_may_be_indefinite(void **state)
{
    (void)state;
    static double S[1];
    struct pair p;
    pair_init_with_tail(&p, 2, 1, 1);
    pair_fill(&p, 1);
    set_entry(&p, 0, 0, 2);
    set_entry(&p, 1, 0, 1);
    set_entry(&p, 1, 1, 0.45);
    factor(&p, NULL, LINEAR_FACTORED);
    linear_condensed(p.sparse, S);
    assert_near(S[0], -0.05, 1e-15);
    linear_destroy(p.sparse);
}

/* Not positive definite is an outcome, wherever the bad pivot is; the next matrix is factored. */
static void indefinite_and_singular_are_found(void **state)
{
    (void)state;
    static const double bad[] = {-1, 0, (double)NAN, (double)INFINITY};
    struct pair p;
    pair_init(&p, N_MAX, 2);
    for (size_t b = 0; b < sizeof bad / sizeof bad[0]; b++)
        for (int at = 0; at < p.n; at += 7) {
            pair_fill(&p, 1);
            set_entry(&p, at, at, bad[b]);
            factor(&p, NULL, LINEAR_NOT_POSITIVE_DEFINITE);
        }
    linear_clear(p.sparse);
    factor(&p, NULL, LINEAR_NOT_POSITIVE_DEFINITE);
    pair_fill(&p, 1);
    factor(&p, NULL, LINEAR_FACTORED);
    linear_destroy(p.sparse);
}

/* An indefinite matrix with positive diagonal: the trap of an LDL^T factorisation. */
static void large_off_diagonal_is_found(void **state)
{
    (void)state;
    struct pair p;
    pair_init(&p, 20, 2);
    pair_fill(&p, 1);
    set_entry(&p, 11, 10, 40);
    factor(&p, NULL, LINEAR_NOT_POSITIVE_DEFINITE);
    linear_destroy(p.sparse);
}

static void dropped_equations_are_as_if_absent(void **state)
{
    (void)state;
    struct pair p;
    unsigned char keep[N_MAX];
    double x[N_MAX], reduced[N_MAX];
    pair_init(&p, N_MAX, 2);
    pair_fill(&p, 1);
    set_entry(&p, 9, 9, -5); /* dropped: its pivot does not matter */
    for (int i = 0; i < p.n; i++) {
        keep[i] = i % 3 != 0;
        x[i] = reduced[i] = keep[i] ? cos(i) : 0.25 * i;
    }
    factor(&p, keep, LINEAR_FACTORED);
    solve(&p, 1, x);
    for (int i = 0; i < p.n; i++)
        for (int j = 0; j < p.n; j++)
            if (!keep[i] || !keep[j]) p.dense[i][j] = i == j;
    dense_solve(&p, reduced);
    for (int i = 0; i < p.n; i++) assert_near(x[i], reduced[i], 1e-13);
    assert_near(linear_values(p.sparse)[p.start[9]], -5, 0); /* values stay as they are */
    linear_destroy(p.sparse);
}

/* METIS draws random numbers: what was ordered before must not change the bits. */
static void same_values_same_bits(void **state)
{
    (void)state;
    double x[2][N_MAX];
    for (int run = 0; run < 2; run++) {
        struct pair p;
        for (int before = 0; before < 3 * run; before++) {
            pair_init(&p, N_MAX - before, 3);
            linear_destroy(p.sparse);
        }
        pair_init(&p, N_MAX, 4);
        pair_fill(&p, 1);
        factor(&p, NULL, LINEAR_FACTORED);
        for (int i = 0; i < p.n; i++) x[run][i] = cos(i);
        solve(&p, 1, x[run]);
        linear_destroy(p.sparse);
    }
    assert_memory_equal(x[0], x[1], sizeof x[0]);
}

/* Graphs that orderings stumble over: no edges at all, and everything connected. */
static void any_pattern_is_analysed(void **state)
{
    (void)state;
    struct pair p;
    for (int band = 0; band <= N_MAX; band += N_MAX) {
        pair_init(&p, N_MAX, band);
        pair_fill(&p, 1);
        factor(&p, NULL, LINEAR_FACTORED);
        assert_true(linear_factor_nonzeros(p.sparse) >= p.n);
        assert_true(linear_factor_nonzeros(p.sparse) <= p.n * (p.n + 1) / 2.0);
        assert_true(linear_flops(p.sparse) > 0);
        linear_destroy(p.sparse);
    }
    linear_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solution_is_the_dense_one),
        cmocka_unit_test(multiply_is_the_dense_one),
        cmocka_unit_test(tail_is_condensed),
        cmocka_unit_test(order_keeps_the_tail),
        cmocka_unit_test(tail_may_be_indefinite),
        cmocka_unit_test(indefinite_and_singular_are_found),
        cmocka_unit_test(large_off_diagonal_is_found),
        cmocka_unit_test(dropped_equations_are_as_if_absent),
        cmocka_unit_test(same_values_same_bits),
        cmocka_unit_test(any_pattern_is_analysed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
