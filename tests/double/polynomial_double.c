/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Stands in for the mechanics behind solver/solver.h where a test is about what happens around a
 * solve: a known polynomial instead of a finite element model, in microseconds.
 *
 * In x normalised to Table 1:
 *   eps_max = 1.3 - 0.18 muM - 0.16 R2 + 0.12 F - 0.09 R1 + 0.02 eM + 0.02 eF - 0.02 muF
 *             - 0.05 muM^2 + 0.1 R2^2 - 0.04 F^2 + 0.02 R1^2 - 0.115 muM eM + 0.108 muM F
 *
 * Rehearsed troubles: muM = 1 under F = 428 on R1 = 5 diverges; R1 = 8.125 kills the process; the
 * environment's ISCHIA_DOUBLE_DELAY_MS makes every solve take that long.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "solver/solver.h"

struct ischia_solver {
    long delay_ms;
};

struct term {
    double coefficient;
    int i, j; /* -1: none */
};
static const struct term terms[] = {
    {1.3, -1, -1},
    {-0.18, ISCHIA_MUM, -1},
    {-0.16, ISCHIA_R2, -1},
    {0.12, ISCHIA_F, -1},
    {-0.09, ISCHIA_R1, -1},
    {0.02, ISCHIA_EM, -1},
    {0.02, ISCHIA_EF, -1},
    {-0.02, ISCHIA_MUF, -1},
    {-0.05, ISCHIA_MUM, ISCHIA_MUM},
    {0.1, ISCHIA_R2, ISCHIA_R2},
    {-0.04, ISCHIA_F, ISCHIA_F},
    {0.02, ISCHIA_R1, ISCHIA_R1},
    {-0.115, ISCHIA_MUM, ISCHIA_EM},
    {0.108, ISCHIA_MUM, ISCHIA_F},
};

static double normalised(const struct ischia_case *c, int p)
{
    static const double middle[] = {7, 39, 29, 22, 4.5, 5.4, 310};
    static const double half[] = {2, 24, 10, 13, 3.5, 2.6, 118};
    return (c->param[p] - middle[p]) / half[p];
}

static double eps_max_of(const struct ischia_case *c)
{
    double sum = 0;
    for (size_t t = 0; t < sizeof terms / sizeof terms[0]; t++) {
        const double xi = terms[t].i < 0 ? 1 : normalised(c, terms[t].i);
        const double xj = terms[t].j < 0 ? 1 : normalised(c, terms[t].j);
        sum += terms[t].coefficient * xi * xj;
    }
    return sum;
}

enum ischia_code ischia_solver_create(struct ischia_solver **ret_solver, struct ischia_error *err)
{
    const char *delay = getenv("ISCHIA_DOUBLE_DELAY_MS");
    struct ischia_solver *solver = calloc(1, sizeof *solver);
    CHECK(solver != NULL, err, ISCHIA_E_MEMORY, "out of memory");
    solver->delay_ms = delay != NULL ? strtol(delay, NULL, 10) : 0;
    *ret_solver = solver;
    return ISCHIA_OK;
}

void ischia_solver_destroy(struct ischia_solver *solver) { free(solver); }

static void fill_converged(struct ischia_result *r, const struct ischia_case *c)
{
    r->strain.eps_max = eps_max_of(c);
    r->strain.E_shear_max = r->strain.eps_max * 1.5;
    r->strain.E_comp_max = 0.45;
    r->seat.displacement_mm = 30;
    r->seat.contact_area_mm2 = 4000;
    r->seat.mean_pressure_kPa = c->param[ISCHIA_F] / 4000 * 1e3;
    r->seat.peak_pressure_kPa = 3 * r->seat.mean_pressure_kPa;
    r->load_curve_count = 1;
    r->numerics.reason = ISCHIA_CONVERGED;
    r->numerics.last_converged_F_N = c->param[ISCHIA_F];
}

enum ischia_code ischia_solve(struct ischia_solver *solver, const struct ischia_case *c,
                              const struct ischia_observer *observer,
                              struct ischia_result *ret_result, struct ischia_field *ret_field,
                              struct ischia_error *err)
{
    struct ischia_result r = {.threshold_force_shear_N = (double)NAN,
                              .threshold_force_compression_N = (double)NAN};
    const struct timespec delay = {solver->delay_ms / 1000, solver->delay_ms % 1000 * 1000000};
    (void)observer;
    (void)nanosleep(&delay, NULL);
    if (c->param[ISCHIA_R1] == 8.125) abort();
    if (c->param[ISCHIA_MUM] == 1 && c->param[ISCHIA_F] == 428 && c->param[ISCHIA_R1] == 5) {
        r.numerics.reason = ISCHIA_DIVERGED_STEP;
        r.numerics.last_converged_F_N = 300;
        (void)snprintf(r.numerics.detail, sizeof r.numerics.detail,
                       "double: the step fell to 1e-6, \"too small\"");
    } else {
        fill_converged(&r, c);
    }
    r.numerics.newton_iterations = 7;
    *ret_result = r;
    if (ret_field == NULL) return ISCHIA_OK;
    double *nowhere = calloc(3, sizeof *nowhere); /* one node, for a service to keep */
    CHECK(nowhere != NULL, err, ISCHIA_E_MEMORY, "out of memory");
    *ret_field = (struct ischia_field){1, nowhere};
    return ISCHIA_OK;
}

void ischia_field_finish(struct ischia_field *field)
{
    if (field != NULL) free(field->displacement_mm);
}

static enum ischia_code no_field(struct ischia_error *err)
{
    return FAIL(err, ISCHIA_E_STATE, "the polynomial double has no field");
}

enum ischia_code ischia_write_vtu(FILE *out, const struct ischia_case *c,
                                  const struct ischia_field *field, struct ischia_error *err)
{
    (void)out, (void)c, (void)field;
    return no_field(err);
}

enum ischia_code
ischia_write_section_svg(FILE *out, const struct ischia_case *c, const struct ischia_field *field,
                         const struct ischia_section_labels *labels, struct ischia_error *err)
{
    (void)out, (void)c, (void)field, (void)labels;
    return no_field(err);
}

enum ischia_code ischia_write_inp(FILE *out, const struct ischia_case *c, struct ischia_error *err)
{
    (void)out, (void)c;
    return no_field(err);
}

enum ischia_code ischia_check_tangents(FILE *out, struct ischia_error *err)
{
    (void)out;
    return no_field(err);
}
