/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/solver.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/axis.h"
#include "solver/clusters.h"
#include "solver/path.h"
#include "solver/seat_pressure.h"
#include "solver/strain.h"
#include "solver/units.h"

/*
 * Share of the volumetric stiffness that acts point by point, over mu: keeps det F from scattering
 * inside the elements at the bonded rim. Its effect on eps_max: docs/VERIFICATION.md.
 */
static const double kappa_point_over_mu = 5;

/* What a result must pass to be called converged. */
static const double energy_residual_max = 5e-3;

/* Allowance of the error estimate beside half the bracket [raw, recovered]: friction history and
 * what the bracket does not see, over eps_max. */
static const double error_allowance = 0.005;

struct ischia_solver {
    struct assembly assembly[ISCHIA_RESOLUTION_COUNT]; /* made when first needed */
    bool has_assembly[ISCHIA_RESOLUTION_COUNT];
};

enum ischia_code ischia_solver_create(struct ischia_solver **ret_solver, struct ischia_error *err)
{
    struct ischia_solver *solver = calloc(1, sizeof *solver);
    CHECK(solver != NULL, err, ISCHIA_E_MEMORY, "not enough memory for a solver");
    *ret_solver = solver;
    return ISCHIA_OK;
}

void ischia_solver_destroy(struct ischia_solver *solver)
{
    if (solver == NULL) return;
    for (int r = 0; r < ISCHIA_RESOLUTION_COUNT; r++)
        if (solver->has_assembly[r]) assembly_finish(&solver->assembly[r]);
    free(solver);
}

void ischia_field_finish(struct ischia_field *field)
{
    if (field == NULL) return;
    free(field->displacement_mm);
    *field = (struct ischia_field){0};
}

/* --- one solve -------------------------------------------------------------------------------- */

struct solve {
    const struct ischia_case *c;
    const struct ischia_observer *observer;
    struct mesh mesh;
    struct body body;
    struct seat seat;
    struct equilibrium state;
    struct assembly *assembly; /* the solver's */
    struct ischia_result result;
    double fraction; /* of the progress last reported */
};

static void solve_finish(struct solve *s)
{
    free(s->state.u_mm);
    seat_finish(&s->seat);
    body_finish(&s->body);
    mesh_finish(&s->mesh);
}

static void set_materials(const struct ischia_case *c, struct element_material ret[TISSUE_COUNT])
{
    const double mu_kPa[TISSUE_COUNT] = {[TISSUE_MUSCLE] = c->param[ISCHIA_MUM],
                                         [TISSUE_FAT] = c->param[ISCHIA_MUF],
                                         [TISSUE_SKIN] = c->option[ISCHIA_SKIN_MU]};
    for (int t = 0; t < TISSUE_COUNT; t++) {
        const double mu = MPa_from_kPa(mu_kPa[t]);
        ret[t] = (struct element_material){.mu_MPa = mu,
                                           .kappa_MPa = mu * c->option[ISCHIA_BULK_RATIO],
                                           .kappa_point_MPa = mu * kappa_point_over_mu};
    }
}

static enum ischia_code solve_init(struct solve *s, struct ischia_solver *solver,
                                   struct ischia_error *err)
{
    struct element_material material[TISSUE_COUNT];
    const int r = (int)s->c->resolution;
    TRY(mesh_local_init(&s->mesh, s->c, &mesh_divisions[r], err));
    if (!solver->has_assembly[r]) TRY(assembly_init(&solver->assembly[r], &s->mesh, err));
    solver->has_assembly[r] = true;
    s->assembly = &solver->assembly[r];
    set_materials(s->c, material);
    TRY(body_init(&s->body, &s->mesh, material, err));
    TRY(seat_init(&s->seat, &s->mesh, s->c->option[ISCHIA_FRICTION], err));
    s->state.u_mm = calloc((size_t)s->mesh.node_count, sizeof *s->state.u_mm);
    CHECK(s->state.u_mm != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the displacements");
    return ISCHIA_OK;
}

static bool report_iteration(void *context, int load_step, int newton_iteration, double force_N)
{
    struct solve *s = context;
    const double F_N = side_force_N(force_N);
    /* The force is what a user waits for; early steps carry little of it, hence the root. */
    const double share = sqrt(fmax(0, fmin(1, F_N / s->c->param[ISCHIA_F])));
    if (s->observer == NULL || s->observer->on_progress == NULL) return true;
    s->fraction = fmax(s->fraction, 0.99 * share);
    const struct ischia_progress progress = {.fraction = s->fraction,
                                             .load_step = load_step,
                                             .newton_iteration = newton_iteration,
                                             .F_N = F_N,
                                             .message = "pressing the tissue on the seat"};
    return s->observer->on_progress(s->observer->context, &progress);
}

static double eps_max_of(const struct axis_strain *axis)
{
    return (axis->recovered + axis->raw) / 2;
}

/* One point of the load curve. */
static enum ischia_code record_step(void *context, const struct equilibrium *state,
                                    struct ischia_error *err)
{
    struct solve *s = context;
    struct ischia_result *r = &s->result;
    struct strain_field field;
    if (r->load_curve_count == ISCHIA_LOAD_POINTS_MAX) return ISCHIA_OK;
    const struct axis_strain axis = axis_strain_of(&s->mesh, (const double(*)[3])state->u_mm);
    TRY(strain_field_init(&field, &s->mesh, &state->u_mm[0][0], err));
    const struct strain_measures most = strain_muscle_maxima(&s->mesh, &field);
    strain_field_finish(&field);
    r->load_curve[r->load_curve_count++] =
        (struct ischia_load_point){.F_N = side_force_N(state->force_N),
                                   .displacement_mm = state->d_mm,
                                   .eps_max = eps_max_of(&axis),
                                   .E_shear_max = most.green_lagrange_shear,
                                   .E_comp_max = most.green_lagrange_compression};
    return ISCHIA_OK;
}

/* Force at which a measure of the load curve first crosses its threshold, linear between steps. */
static double crossing_N(const struct ischia_result *r, size_t offset, double threshold)
{
    double F = 0, value = 0;
    for (int i = 0; i < r->load_curve_count; i++) {
        const struct ischia_load_point *p = &r->load_curve[i];
        double next;
        memcpy(&next, (const char *)p + offset, sizeof next);
        if (next > threshold) return F + (p->F_N - F) * (threshold - value) / (next - value);
        F = p->F_N;
        value = next;
    }
    return (double)NAN;
}

static enum ischia_code measure(struct solve *s, struct ischia_error *err)
{
    struct ischia_result *r = &s->result;
    const struct axis_strain axis = axis_strain_of(&s->mesh, (const double(*)[3])s->state.u_mm);
    const struct seat_state seat = {&s->state.u_mm[0][0], s->seat.normal_N};
    struct strain_field field;
    TRY(strain_field_init(&field, &s->mesh, &s->state.u_mm[0][0], err));
    const struct strain_measures most = strain_muscle_maxima(&s->mesh, &field);
    r->strain.eps_max = eps_max_of(&axis);
    r->strain.eps_max_depth_mm = axis.depth_mm;
    r->strain.E_shear_max = most.green_lagrange_shear;
    r->strain.E_comp_max = most.green_lagrange_compression;
    r->numerics.eps_max_error =
        fabs(axis.recovered - axis.raw) / 2 + error_allowance * r->strain.eps_max;
    r->muscle_volume_mm3 = side_extent(strain_muscle_volume_mm3(&s->mesh, &field));
    r->threshold_force_shear_N =
        crossing_N(r, offsetof(struct ischia_load_point, E_shear_max), ISCHIA_E_SHEAR_THRESHOLD);
    r->threshold_force_compression_N =
        crossing_N(r, offsetof(struct ischia_load_point, E_comp_max), ISCHIA_E_COMP_THRESHOLD);
    enum ischia_code code = clusters_find_all(&s->mesh, &field, r->clusters, err);
    strain_field_finish(&field);
    TRY(code);
    r->seat.displacement_mm = s->state.d_mm;
    return seat_pressure(&s->mesh, &seat, &r->seat, err);
}

/* The checks that a converged load path must still pass. */
static void judge(struct solve *s)
{
    struct ischia_numerics *n = &s->result.numerics;
    n->det_F_min = body_det_F_min(&s->body, (const double(*)[3])s->state.u_mm);
    if (n->reason < 0) return;
    if (!(n->det_F_min > 0) || !(fabs(n->energy_residual) <= energy_residual_max)) {
        n->reason = ISCHIA_DIVERGED_CHECKS;
        (void)snprintf(n->detail, sizeof n->detail,
                       "the load path ended, but det F is %.3g at the least (> 0 wanted) and the "
                       "energy balance is off by %.2g (at most %g)",
                       n->det_F_min, n->energy_residual, energy_residual_max);
    }
}

static void take_report(struct solve *s, const struct path_report *report)
{
    struct ischia_numerics *n = &s->result.numerics;
    n->reason = report->reason;
    n->elements = s->mesh.element_count;
    n->dof = s->assembly->n + 1;
    n->load_steps = report->load_steps;
    n->newton_iterations = report->newton_iterations;
    n->factorisations = report->factorisations;
    n->force_residual = report->force_residual;
    n->energy_residual = report->energy_residual;
    n->last_converged_F_N = side_force_N(report->last_force_N);
    (void)snprintf(n->detail, sizeof n->detail, "%s", report->tried);
}

static enum ischia_code keep_field(struct solve *s, struct ischia_field *ret,
                                   struct ischia_error *err)
{
    const size_t numbers = 3 * (size_t)s->mesh.node_count;
    ret->displacement_mm = malloc(numbers * sizeof *ret->displacement_mm);
    CHECK(ret->displacement_mm != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the field");
    memcpy(ret->displacement_mm, s->state.u_mm, numbers * sizeof *ret->displacement_mm);
    ret->node_count = (size_t)s->mesh.node_count;
    return ISCHIA_OK;
}

static enum ischia_code solve_run(struct solve *s, struct ischia_solver *solver,
                                  struct ischia_field *ret_field, struct ischia_error *err)
{
    const struct path_observer observer = {report_iteration, record_step, s};
    struct path_report report;
    TRY(solve_init(s, solver, err));
    TRY(path_follow(&s->body, s->assembly, &s->seat, quarter_force_N(s->c->param[ISCHIA_F]),
                    &observer, &s->state, &report, err));
    take_report(s, &report);
    TRY(measure(s, err));
    judge(s);
    if (ret_field != NULL && ischia_result_converged(&s->result))
        return keep_field(s, ret_field, err);
    return ISCHIA_OK;
}

enum ischia_code ischia_solve(struct ischia_solver *solver, const struct ischia_case *c,
                              const struct ischia_observer *observer,
                              struct ischia_result *ret_result, struct ischia_field *ret_field,
                              struct ischia_error *err)
{
    struct solve s = {.c = c, .observer = observer};
    struct ischia_field field = {0};
    assert(ischia_case_is_valid(c));
    const enum ischia_code code = solve_run(&s, solver, ret_field != NULL ? &field : NULL, err);
    if (code == ISCHIA_OK) {
        *ret_result = s.result;
        if (ret_field != NULL) *ret_field = field;
    }
    solve_finish(&s);
    return code;
}
