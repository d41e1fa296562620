/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The only file that sees cholmod.h. Traps that it stays clear of: the default mode factors an
 * indefinite matrix as LDL^T in silence, so the supernodal LL^T is asked for by name; it returns
 * TRUE for an indefinite matrix and says so in `status` and `minor` only; and a singular one may
 * leave a factor that is not finite, which rcond shows.
 */
#include "solver/linear.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cholmod.h>

#include "solver/dense.h"

struct linear {
    int tail;            /* the last equations, condensed                       */
    double *tail_factor; /* [tail][tail] their part of L, by columns            */
    double *tail_spring; /* [tail] stiffness that was added to their diagonal   */
    cholmod_common common;
    cholmod_sparse *A;      /* the values                                          */
    cholmod_sparse *masked; /* what was factored: some equations may be taken out  */
    cholmod_factor *L;
    cholmod_dense *solution, *work_y, *work_e; /* reused from solve to solve */
};

static void common_init(cholmod_common *common, int ordering)
{
    cholmod_start(common);
    common->supernodal = CHOLMOD_SUPERNODAL;
    common->final_ll = 1;
    common->print = 0;
    common->nmethods = 1;
    common->method[0].ordering = ordering;
    common->postorder = ordering == CHOLMOD_GIVEN;
    /* Supernodes merged a little further than by default: docs/decisions/0008. */
    memcpy(common->nrelax, (size_t[]){8, 24, 64}, sizeof common->nrelax);
}

static cholmod_sparse *pattern_of(int n, const int *start, const int *row, cholmod_common *common)
{
    const size_t nnz = (size_t)start[n];
    cholmod_sparse *A =
        cholmod_allocate_sparse((size_t)n, (size_t)n, nnz, 1, 1, -1, CHOLMOD_REAL, common);
    if (A == NULL) return NULL;
    memcpy(A->p, start, sizeof(int) * (size_t)(n + 1));
    memcpy(A->i, row, sizeof(int) * nnz);
    memset(A->x, 0, sizeof(double) * nnz);
    return A;
}

/*
 * METIS is called apart from the analysis, because CHOLMOD ignores METIS' failures: without memory
 * it would go on with whatever the permutation held. It is filled with what is no permutation
 * instead, and must be one afterwards.
 */
static bool order_pattern(cholmod_sparse *A, int *order, cholmod_common *common)
{
    const size_t n = A->ncol;
    memset(order, 0xff, n * sizeof *order);
    if (!cholmod_metis(A, NULL, 0, 0, order, common) || !cholmod_check_perm(order, n, n, common))
        return false;
    cholmod_factor *L = cholmod_analyze_p(A, order, NULL, 0, common);
    const bool kept = L != NULL && L->ordering == CHOLMOD_GIVEN;
    if (kept) memcpy(order, L->Perm, n * sizeof *order);
    cholmod_free_factor(&L, common);
    return kept && common->status == CHOLMOD_OK;
}

/* The pattern without the last equations, which only its last rows and columns know. */
static cholmod_sparse *leading_pattern(int n, const int *start, const int *row,
                                       cholmod_common *common)
{
    cholmod_sparse *A = pattern_of(n, start, row, common);
    if (A == NULL) return NULL;
    int *kept_start = A->p, *kept_row = A->i, kept = 0;
    for (int j = 0; j < n; j++) {
        kept_start[j] = kept;
        for (int k = start[j]; k < start[j + 1]; k++)
            if (row[k] < n) kept_row[kept++] = row[k];
    }
    kept_start[n] = kept;
    return A;
}

/* Nor may an analysis take up another ordering when memory fails it: the solution's last bits would
 * differ. All that can go wrong with a pattern that is in order is memory. */
enum ischia_code linear_order(int n, int tail, const int *start, const int *row, int *ret_order,
                              struct ischia_error *err)
{
    const int leading = n - tail;
    cholmod_common common;
    int *order = malloc(((size_t)leading + 1) * sizeof *order); /* never of no bytes */
    CHECK(order != NULL, err, ISCHIA_E_MEMORY, "not enough memory to order %d equations", n);
    common_init(&common, CHOLMOD_GIVEN);
    cholmod_sparse *A = leading > 0 ? leading_pattern(leading, start, row, &common) : NULL;
    const bool ordered = leading == 0 || (A != NULL && order_pattern(A, order, &common));
    if (ordered) memcpy(ret_order, order, (size_t)leading * sizeof *order);
    for (int k = leading; ordered && k < n; k++) ret_order[k] = k;
    cholmod_free_sparse(&A, &common);
    cholmod_finish(&common);
    free(order);
    CHECK(ordered, err, ISCHIA_E_MEMORY, "not enough memory to order %d equations", n);
    return ISCHIA_OK;
}

static bool pattern_init(struct linear *l, int n, const int *start, const int *row)
{
    l->A = pattern_of(n, start, row, &l->common);
    if (l->A == NULL) return false;
    l->masked = cholmod_copy_sparse(l->A, &l->common);
    l->tail_factor = calloc((size_t)l->tail * (size_t)l->tail + 1, sizeof *l->tail_factor);
    l->tail_spring = calloc((size_t)l->tail + 1, sizeof *l->tail_spring);
    if (l->masked == NULL || l->tail_factor == NULL || l->tail_spring == NULL) {
        l->common.status = CHOLMOD_OUT_OF_MEMORY;
        return false;
    }
    l->L = cholmod_analyze(l->A, &l->common);
    return l->L != NULL && l->common.status == CHOLMOD_OK;
}

enum ischia_code linear_create(struct linear **ret, int n, int tail, const int *start,
                               const int *row, struct ischia_error *err)
{
    struct linear *l = calloc(1, sizeof *l);
    CHECK(l != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the linear solver");
    l->tail = tail;
    common_init(&l->common, CHOLMOD_NATURAL);
    if (!pattern_init(l, n, start, row)) {
        const int status = l->common.status;
        linear_destroy(l);
        CHECK(status != CHOLMOD_OUT_OF_MEMORY, err, ISCHIA_E_MEMORY,
              "not enough memory to analyse %d equations", n);
        return FAIL(err, ISCHIA_E_NUMERIC, "CHOLMOD could not analyse (status %d)", status);
    }
    *ret = l;
    return ISCHIA_OK;
}

void linear_destroy(struct linear *l)
{
    if (l == NULL) return;
    cholmod_free_sparse(&l->A, &l->common);
    cholmod_free_sparse(&l->masked, &l->common);
    cholmod_free_factor(&l->L, &l->common);
    cholmod_free_dense(&l->solution, &l->common);
    cholmod_free_dense(&l->work_y, &l->common);
    cholmod_free_dense(&l->work_e, &l->common);
    cholmod_finish(&l->common);
    free(l->tail_factor);
    free(l->tail_spring);
    free(l);
}

double *linear_values(struct linear *l) { return l->A->x; }

void linear_clear(struct linear *l) { memset(l->A->x, 0, sizeof(double) * l->A->nzmax); }

/* What is factored: the values with the rows and columns of dropped equations replaced by 1. */
static void copy_masked(struct linear *l, const unsigned char *keep)
{
    const int *start = l->A->p, *row = l->A->i;
    const double *from = l->A->x;
    double *to = l->masked->x;
    for (int j = 0; j < (int)l->A->ncol; j++)
        for (int k = start[j]; k < start[j + 1]; k++)
            to[k] = keep == NULL || (keep[j] && keep[row[k]]) ? from[k] : row[k] == j;
    const int leading = (int)l->A->ncol - l->tail;
    for (int t = 0; t < l->tail; t++) {
        double *diagonal = &to[start[leading + t]];
        l->tail_spring[t] = fabs(*diagonal);
        *diagonal += l->tail_spring[t];
    }
}

/* Copies what a supernode holds of the tail's own columns. */
static void copy_supernode(struct linear *l, int s)
{
    const int *super = l->L->super, *pi = l->L->pi, *px = l->L->px, *rows = l->L->s;
    const double *x = l->L->x;
    const int leading = (int)l->A->ncol - l->tail, height = pi[s + 1] - pi[s];
    for (int j = super[s] > leading ? super[s] : leading; j < super[s + 1]; j++)
        for (int k = j - super[s]; k < height; k++)
            l->tail_factor[(j - leading) * l->tail + rows[pi[s] + k] - leading] =
                x[px[s] + (j - super[s]) * height + k];
}

static void copy_tail(struct linear *l)
{
    const int *super = l->L->super;
    for (int s = (int)l->L->nsuper - 1; s >= 0; s--) {
        if (super[s + 1] <= (int)l->A->ncol - l->tail) break;
        copy_supernode(l, s);
    }
}

enum ischia_code linear_factor(struct linear *l, const unsigned char *keep,
                               enum linear_outcome *ret_outcome, struct ischia_error *err)
{
    copy_masked(l, keep);
    cholmod_factorize(l->masked, l->L, &l->common);
    CHECK(l->common.status != CHOLMOD_OUT_OF_MEMORY, err, ISCHIA_E_MEMORY,
          "not enough memory to factor %zu equations", l->A->ncol);
    CHECK(l->common.status >= CHOLMOD_OK, err, ISCHIA_E_NUMERIC, "CHOLMOD reported status %d",
          l->common.status);
    const bool complete = l->common.status == CHOLMOD_OK && l->L->minor == l->L->n;
    const double rcond = complete ? cholmod_rcond(l->L, &l->common) : 0;
    *ret_outcome = rcond > 0 && isfinite(rcond) ? LINEAR_FACTORED : LINEAR_NOT_POSITIVE_DEFINITE;
    if (*ret_outcome == LINEAR_FACTORED) copy_tail(l);
    return ISCHIA_OK;
}

void linear_condensed(const struct linear *l, double *ret)
{
    dense_square_of_lower(l->tail, l->tail_factor, ret);
    for (int t = 0; t < l->tail; t++) ret[t * l->tail + t] -= l->tail_spring[t];
}

/* Makes what cholmod_solve2 works with, because it does not notice when it cannot. */
static bool reserve_solution(struct linear *l)
{
    const size_t n = l->A->nrow;
    cholmod_common *c = &l->common;
    return cholmod_ensure_dense(&l->solution, n, 1, n, CHOLMOD_REAL, c) != NULL &&
           cholmod_ensure_dense(&l->work_y, n, 1, n, CHOLMOD_REAL, c) != NULL &&
           cholmod_ensure_dense(&l->work_e, 1, l->L->maxesize, 1, CHOLMOD_REAL, c) != NULL;
}

/* x = L^-1 x or L^-T x. One right-hand side at a time: with several, products of matrices take the
 * place of those with vectors, in which OpenBLAS dies when there is no memory. */
static enum ischia_code triangular_solve(struct linear *l, int system, double *x,
                                         struct ischia_error *err)
{
    const size_t n = l->A->nrow;
    CHECK(reserve_solution(l), err, ISCHIA_E_MEMORY, "not enough memory to solve %zu equations", n);
    cholmod_dense b = {.nrow = n,
                       .ncol = 1,
                       .nzmax = n,
                       .d = n,
                       .x = x,
                       .xtype = CHOLMOD_REAL,
                       .dtype = CHOLMOD_DOUBLE};
    const int done = cholmod_solve2(system, l->L, &b, NULL, &l->solution, NULL, &l->work_y,
                                    &l->work_e, &l->common);
    CHECK(done, err, l->common.status == CHOLMOD_OUT_OF_MEMORY ? ISCHIA_E_MEMORY : ISCHIA_E_NUMERIC,
          "CHOLMOD could not solve (status %d)", l->common.status);
    memcpy(x, l->solution->x, sizeof *x * n);
    return ISCHIA_OK;
}

enum ischia_code linear_reduce(struct linear *l, int count, double *x, struct ischia_error *err)
{
    const size_t n = l->A->nrow, leading = n - (size_t)l->tail;
    for (size_t k = 0; k < (size_t)count; k++) {
        TRY(triangular_solve(l, CHOLMOD_L, x + k * n, err));
        dense_multiply_lower(l->tail, l->tail_factor, false, x + k * n + leading);
    }
    return ISCHIA_OK;
}

enum ischia_code linear_expand(struct linear *l, double *x, struct ischia_error *err)
{
    const size_t leading = l->A->nrow - (size_t)l->tail;
    dense_multiply_lower(l->tail, l->tail_factor, true, x + leading);
    return triangular_solve(l, CHOLMOD_Lt, x, err);
}

void linear_multiply(const struct linear *l, const double *x, double *ret)
{
    const int *start = l->A->p, *row = l->A->i;
    const double *value = l->A->x;
    const int n = (int)l->A->ncol;
    memset(ret, 0, sizeof *ret * (size_t)n);
    for (int j = 0; j < n; j++) {
        double sum = 0;
        for (int k = start[j]; k < start[j + 1]; k++) {
            sum += value[k] * x[row[k]];
            if (row[k] != j) ret[row[k]] += value[k] * x[j];
        }
        ret[j] += sum;
    }
}

double linear_flops(const struct linear *l) { return l->common.fl; }
double linear_factor_nonzeros(const struct linear *l) { return l->common.lnz; }
