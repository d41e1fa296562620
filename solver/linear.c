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

struct linear {
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

/* Nor may an analysis take up another ordering when memory fails it: the solution's last bits would
 * differ. All that can go wrong with a pattern that is in order is memory. */
enum ischia_code linear_order(int n, const int *start, const int *row, int *ret_order,
                              struct ischia_error *err)
{
    cholmod_common common;
    int *order = malloc((size_t)n * sizeof *order);
    CHECK(order != NULL, err, ISCHIA_E_MEMORY, "not enough memory to order %d equations", n);
    common_init(&common, CHOLMOD_GIVEN);
    cholmod_sparse *A = pattern_of(n, start, row, &common);
    const bool ordered = A != NULL && order_pattern(A, order, &common);
    if (ordered) memcpy(ret_order, order, (size_t)n * sizeof *order);
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
    if (l->masked == NULL) return false;
    l->L = cholmod_analyze(l->A, &l->common);
    return l->L != NULL && l->common.status == CHOLMOD_OK;
}

enum ischia_code linear_create(struct linear **ret, int n, const int *start, const int *row,
                               struct ischia_error *err)
{
    struct linear *l = calloc(1, sizeof *l);
    CHECK(l != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the linear solver");
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
    return ISCHIA_OK;
}

/* Makes what cholmod_solve2 works with, because it does not notice when it cannot. */
static bool reserve_solution(struct linear *l, size_t count)
{
    const size_t n = l->A->nrow;
    cholmod_common *c = &l->common;
    return cholmod_ensure_dense(&l->solution, n, count, n, CHOLMOD_REAL, c) != NULL &&
           cholmod_ensure_dense(&l->work_y, n, count, n, CHOLMOD_REAL, c) != NULL &&
           cholmod_ensure_dense(&l->work_e, count, l->L->maxesize, count, CHOLMOD_REAL, c) != NULL;
}

enum ischia_code linear_solve(struct linear *l, int count, double *x, struct ischia_error *err)
{
    const size_t n = l->A->nrow;
    CHECK(reserve_solution(l, (size_t)count), err, ISCHIA_E_MEMORY,
          "not enough memory to solve %zu equations", n);
    cholmod_dense b = {.nrow = n,
                       .ncol = (size_t)count,
                       .nzmax = n * (size_t)count,
                       .d = n,
                       .x = x,
                       .xtype = CHOLMOD_REAL,
                       .dtype = CHOLMOD_DOUBLE};
    const int done = cholmod_solve2(CHOLMOD_A, l->L, &b, NULL, &l->solution, NULL, &l->work_y,
                                    &l->work_e, &l->common);
    CHECK(done, err, l->common.status == CHOLMOD_OUT_OF_MEMORY ? ISCHIA_E_MEMORY : ISCHIA_E_NUMERIC,
          "CHOLMOD could not solve (status %d)", l->common.status);
    memcpy(x, l->solution->x, sizeof *x * n * (size_t)count);
    return ISCHIA_OK;
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

double linear_diagonal(const struct linear *l, int i)
{
    return ((const double *)l->A->x)[((const int *)l->A->p)[i]];
}

double linear_flops(const struct linear *l) { return l->common.fl; }
double linear_factor_nonzeros(const struct linear *l) { return l->common.lnz; }
