/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A stand-in for the solver, for tests of what is around it. It computes no mechanics: its numbers
 * are arithmetic on the inputs, repeatable to the bit, and the force says how a solve is to end.
 *
 *   F 401 N  does not converge        F 402 N  out of memory      F 403 N  the process is killed
 *   F 404 N  cancelled                F 405 N  takes half a second
 */
#include "solver/solver.h"

#include <assert.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

struct ischia_solver {
    int solves;
};

enum ischia_code ischia_solver_create(struct ischia_solver **ret_solver, struct ischia_error *err)
{
    *ret_solver = calloc(1, sizeof **ret_solver);
    CHECK(*ret_solver != NULL, err, ISCHIA_E_MEMORY, "out of memory");
    return ISCHIA_OK;
}

void ischia_solver_destroy(struct ischia_solver *solver) { free(solver); }

static void fill_cluster(struct ischia_cluster_set *set, double volume_mm3)
{
    set->volume_mm3 = volume_mm3;
    set->count = volume_mm3 > 0;
    set->has_largest = volume_mm3 > 0;
    set->largest = (struct ischia_cluster){.volume_mm3 = volume_mm3,
                                           .eps_max = 1.0 / 3,
                                           .E_shear_max = 0.8,
                                           .E_comp_max = 0.46,
                                           .centroid_mm = {0, 0, 0.1 * volume_mm3}};
}

static void fill(const struct ischia_case *c, struct ischia_result *r)
{
    double sum = 0;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) sum += c->param[i] / (i + 7);
    *r = (struct ischia_result){
        .strain = {sum / 90, sum / 30, sum / 70, 0.49 - 1 / (sum + 10)},
        .muscle_volume_mm3 = 1e5 + sum / 3,
        .seat = {sum / 7, sum * 11, sum / 3, sum / 2},
        .load_curve = {{c->param[ISCHIA_F] / 2, sum / 14, sum / 180, sum / 140, 0.2},
                       {c->param[ISCHIA_F], sum / 7, sum / 90, sum / 70, 0.4}},
        .load_curve_count = 2,
        .threshold_force_shear_N = c->param[ISCHIA_F] / 3,
        .threshold_force_compression_N = (double)NAN,
        .numerics = {.reason = ISCHIA_CONVERGED,
                     .elements = 10,
                     .dof = 99,
                     .load_steps = 3,
                     .newton_iterations = 12,
                     .factorisations = 13,
                     .force_residual = 1e-9 / 3,
                     .energy_residual = 1e-4 / 3,
                     .det_F_min = 0.9,
                     .eps_max_error = sum / 9000,
                     .last_converged_F_N = c->param[ISCHIA_F]},
    };
    fill_cluster(&r->clusters[ISCHIA_OVER_SHEAR], sum * 10);
    fill_cluster(&r->clusters[ISCHIA_OVER_COMPRESSION], sum / 3);
    fill_cluster(&r->clusters[ISCHIA_OVER_BOTH], 0);
}

static void diverge(const struct ischia_case *c, struct ischia_result *r)
{
    r->numerics.reason = ISCHIA_DIVERGED_STEP;
    r->numerics.last_converged_F_N = 0.625 * c->param[ISCHIA_F];
    r->load_curve_count = 1;
    (void)snprintf(r->numerics.detail, sizeof r->numerics.detail, "the double was told to");
}

/* One "node" for each input. */
static enum ischia_code fill_field(const struct ischia_case *c, struct ischia_field *ret_field,
                                   struct ischia_error *err)
{
    double *displacement_mm = calloc(3 * ISCHIA_PARAM_COUNT, sizeof *displacement_mm);
    CHECK(displacement_mm != NULL, err, ISCHIA_E_MEMORY, "out of memory");
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) displacement_mm[3 * i + 2] = c->param[i] / -100;
    *ret_field = (struct ischia_field){ISCHIA_PARAM_COUNT, displacement_mm};
    return ISCHIA_OK;
}

static bool observe(const struct ischia_observer *observer, const struct ischia_case *c)
{
    const struct ischia_progress progress = {0.5, 2, 3, c->param[ISCHIA_F] / 2, "halfway"};
    return observer == NULL || observer->on_progress(observer->context, &progress);
}

enum ischia_code ischia_solve(struct ischia_solver *solver, const struct ischia_case *c,
                              const struct ischia_observer *observer,
                              struct ischia_result *ret_result, struct ischia_field *ret_field,
                              struct ischia_error *err)
{
    const struct timespec half = {.tv_nsec = 500 * 1000 * 1000};
    const int how = (int)c->param[ISCHIA_F];
    assert(ischia_case_is_valid(c));
    solver->solves++;
    if (how == 403) (void)kill(getpid(), SIGKILL);
    if (how == 405) (void)nanosleep(&half, NULL);
    CHECK(how != 402, err, ISCHIA_E_MEMORY, "out of memory in the double");
    CHECK(how != 404 && observe(observer, c), err, ISCHIA_E_CANCELLED, "the solve was cancelled");
    fill(c, ret_result);
    if (how == 401) diverge(c, ret_result);
    if (ret_field == NULL) return ISCHIA_OK;
    *ret_field = (struct ischia_field){0};
    return how == 401 ? ISCHIA_OK : fill_field(c, ret_field, err);
}

void ischia_field_finish(struct ischia_field *field)
{
    if (field != NULL) free(field->displacement_mm);
}

static enum ischia_code write_words(FILE *out, const char *words, struct ischia_error *err)
{
    CHECK(fputs(words, out) >= 0, err, ISCHIA_E_IO, "cannot write");
    return ISCHIA_OK;
}

enum ischia_code ischia_write_vtu(FILE *out, const struct ischia_case *c,
                                  const struct ischia_field *field, struct ischia_error *err)
{
    (void)c, (void)field;
    return write_words(out, "<VTKFile/>\n", err);
}

enum ischia_code
ischia_write_section_svg(FILE *out, const struct ischia_case *c, const struct ischia_field *field,
                         const struct ischia_section_labels *labels, struct ischia_error *err)
{
    (void)c, (void)field, (void)labels;
    return write_words(out, "<svg/>\n", err);
}

enum ischia_code ischia_write_inp(FILE *out, const struct ischia_case *c, struct ischia_error *err)
{
    CHECK((int)c->param[ISCHIA_F] != 401, err, ISCHIA_E_IO, "cannot write: the double was told to");
    return write_words(out, "*HEADING\n", err);
}

enum ischia_code ischia_check_tangents(FILE *out, struct ischia_error *err)
{
    return write_words(out, "nothing to compare in the double\n", err);
}
