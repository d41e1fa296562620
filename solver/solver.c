/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/solver.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/axis.h"
#include "solver/clusters.h"
#include "solver/curve.h"
#include "solver/path.h"
#include "solver/seat_pressure.h"
#include "solver/strain.h"
#include "solver/units.h"

/* What a result must pass to be called converged. */
static const double energy_residual_max = 5e-3;

/* What the error estimate allows for beside the two levels of resolution, over eps_max: friction
 * history, regularisation, and orders that are not quite two. */
static const double error_allowance = 0.005;
/* Of the extrapolation's own correction, how much may be wrong. */
static const double correction_doubt = 0.25;

/*
 * How a case is solved, and how it is tried again when the load path has not arrived: with the
 * corners weighing more in the rule that integrates the isochoric energy (element.h), which lets
 * strongly sheared tissue resist zigzags, and in shorter steps. All are rules of the same order for
 * the same energy; what the corners' weight does to eps_max: docs/VERIFICATION.md.
 */
static const struct attempt {
    double corner_share;
    struct path_effort effort;
} attempts[] = {
    {0.4, {.pace = 1, .factorisations_max = 600}},
    {0.7, {.pace = 1, .factorisations_max = 1000}},
    {1, {.pace = 1, .factorisations_max = 1500}},
    {0.7, {.pace = 0.6, .factorisations_max = 2000}},
    {1, {.pace = 0.6, .factorisations_max = 2500}},
};
static const char *const attempts_tried =
    "the corners weighing 0.4, 0.7 and 1, and the latter two in steps of 0.6 of the length";
enum { ATTEMPT_COUNT = sizeof attempts / sizeof attempts[0] };

/* Coarsest first. */
enum { LEVEL_COMPANION, LEVEL_MAIN, LEVEL_COUNT };
static const struct mesh_divisions *const level_divisions[LEVEL_COUNT] = {mesh_companions,
                                                                          mesh_divisions};

struct ischia_solver {
    struct assembly assembly[ISCHIA_RESOLUTION_COUNT][LEVEL_COUNT]; /* made when first needed */
    bool has_assembly[ISCHIA_RESOLUTION_COUNT][LEVEL_COUNT];
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
        for (int l = 0; l < LEVEL_COUNT; l++)
            if (solver->has_assembly[r][l]) assembly_finish(&solver->assembly[r][l]);
    free(solver);
}

void ischia_field_finish(struct ischia_field *field)
{
    if (field == NULL) return;
    free(field->displacement_mm);
    *field = (struct ischia_field){0};
}

/* --- one solve -------------------------------------------------------------------------------- */

/* The case on one mesh. */
struct level {
    struct mesh mesh;
    struct body body;
    struct seat seat;
    struct equilibrium state;
    struct assembly *assembly; /* the solver's */
    struct path_report report;
    struct load_curve curve;
};

struct solve {
    const struct ischia_case *c;
    const struct ischia_observer *observer;
    struct level level[LEVEL_COUNT];
    int current; /* the level being solved                   */
    int attempt; /* at it                                    */
    struct ischia_result result;
    double fraction; /* of the progress last reported         */
};

static bool is_sound(const struct path_report *report)
{
    return report->reason > 0 && fabs(report->energy_residual) <= energy_residual_max;
}

static void solve_finish(struct solve *s)
{
    for (int l = 0; l < LEVEL_COUNT; l++) {
        free(s->level[l].state.u_mm);
        seat_finish(&s->level[l].seat);
        body_finish(&s->level[l].body);
        mesh_finish(&s->level[l].mesh);
    }
}

static void set_materials(const struct ischia_case *c, double corner_share,
                          struct element_material ret[TISSUE_COUNT])
{
    const double mu_kPa[TISSUE_COUNT] = {[TISSUE_MUSCLE] = c->param[ISCHIA_MUM],
                                         [TISSUE_FAT] = c->param[ISCHIA_MUF],
                                         [TISSUE_SKIN] = c->option[ISCHIA_SKIN_MU]};
    for (int t = 0; t < TISSUE_COUNT; t++) {
        const double mu = MPa_from_kPa(mu_kPa[t]);
        ret[t] = (struct element_material){.mu_MPa = mu,
                                           .kappa_MPa = mu * c->option[ISCHIA_BULK_RATIO],
                                           .corner_share = corner_share};
    }
}

static enum ischia_code level_init(struct solve *s, int l, struct ischia_solver *solver,
                                   struct ischia_error *err)
{
    const int r = (int)s->c->resolution;
    struct level *level = &s->level[l];
    TRY(mesh_local_init(&level->mesh, s->c, &level_divisions[l][r], err));
    if (!solver->has_assembly[r][l]) TRY(assembly_init(&solver->assembly[r][l], &level->mesh, err));
    solver->has_assembly[r][l] = true;
    level->assembly = &solver->assembly[r][l];
    level->state.u_mm = calloc((size_t)level->mesh.node_count, sizeof *level->state.u_mm);
    CHECK(level->state.u_mm != NULL, err, ISCHIA_E_MEMORY,
          "not enough memory for the displacements");
    return ISCHIA_OK;
}

/* Share of the work that is done when a level begins, and what a user may read meanwhile. */
static const struct {
    double start;
    const char *message;
} level_progress[LEVEL_COUNT + 1] = {
    [LEVEL_COMPANION] = {0, "pressing a coarse mesh on the seat"},
    [LEVEL_MAIN] = {0.25, "pressing the tissue on the seat"},
    [LEVEL_COUNT] = {0.99, NULL},
};

static bool report_iteration(void *context, int load_step, int newton_iteration, double force_N)
{
    struct solve *s = context;
    const double F_N = side_force_N(force_N);
    /* The force is what a user waits for; early steps carry little of it, hence the root. */
    const double share = sqrt(fmax(0, fmin(1, F_N / s->c->param[ISCHIA_F])));
    const bool alone = s->level[LEVEL_COMPANION].mesh.node_count == 0 && s->current == LEVEL_MAIN;
    const double start = alone ? 0 : level_progress[s->current].start;
    const double end = level_progress[s->current + 1].start;
    if (s->observer == NULL || s->observer->on_progress == NULL) return true;
    s->fraction = fmax(s->fraction, start + (end - start) * share);
    const struct ischia_progress progress = {.fraction = s->fraction,
                                             .load_step = load_step,
                                             .newton_iteration = newton_iteration,
                                             .F_N = F_N,
                                             .message = level_progress[s->current].message};
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
    struct level *level = &s->level[s->current];
    struct strain_field field;
    const struct axis_strain axis = axis_strain_of(&level->mesh, (const double(*)[3])state->u_mm);
    TRY(strain_field_init(&field, &level->mesh, &state->u_mm[0][0], err));
    const struct strain_measures most = strain_muscle_maxima(&level->mesh, &field);
    strain_field_finish(&field);
    const struct ischia_load_point load = {.F_N = side_force_N(state->force_N),
                                           .displacement_mm = state->d_mm,
                                           .eps_max = eps_max_of(&axis),
                                           .E_shear_max = most.green_lagrange_shear,
                                           .E_comp_max = most.green_lagrange_compression};
    load_curve_add(&level->curve, &load);
    return ISCHIA_OK;
}

/*
 * Takes the main level's load curve as the result's, eps_max extrapolated to ever finer meshes: its
 * error falls with the square of the mesh size (docs/VERIFICATION.md), so with r the ratio of the
 * two sizes, eps = eps_main + (eps_main - eps_companion) / (r^2 - 1) (Richardson). Returns the
 * correction at the end of the path; 0 where there is no companion.
 */
static double extrapolate(struct solve *s)
{
    const struct level *companion = &s->level[LEVEL_COMPANION], *main = &s->level[LEVEL_MAIN];
    const double ratio =
        (double)main->mesh.divisions.across / fmax(1, companion->mesh.divisions.across);
    double correction = 0;
    for (int i = 0; i < main->curve.count; i++) {
        struct ischia_load_point *p = &s->result.load_curve[i];
        *p = main->curve.point[i];
        if (companion->report.reason > 0)
            correction = (p->eps_max - load_curve_at(&companion->curve, p->F_N).eps_max) /
                         (ratio * ratio - 1);
        p->eps_max += correction;
    }
    s->result.load_curve_count = main->curve.count;
    return correction;
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

/*
 * How far eps_max may be off. The values read beside the axis and recovered on it converge to the
 * same from two sides, so that what is left between their extrapolations is error, and so is a part
 * of the extrapolation's own correction. Without a second level the whole bracket of the two stands
 * for the error of its middle.
 */
static double eps_max_error(const struct solve *s, const struct axis_strain *axis,
                            double correction)
{
    const struct level *companion = &s->level[LEVEL_COMPANION], *main = &s->level[LEVEL_MAIN];
    const double allowance = error_allowance * s->result.strain.eps_max;
    const double bracket = axis->recovered - axis->raw;
    if (!(companion->report.reason > 0)) return fabs(bracket) + allowance;
    const struct axis_strain coarser =
        axis_strain_of(&companion->mesh, (const double(*)[3])companion->state.u_mm);
    const double ratio = (double)main->mesh.divisions.across / companion->mesh.divisions.across;
    const double left =
        bracket + (bracket - (coarser.recovered - coarser.raw)) / (ratio * ratio - 1);
    return correction_doubt * fabs(correction) + fabs(left) + allowance;
}

static void measure_axis(struct solve *s)
{
    struct ischia_result *r = &s->result;
    const struct level *level = &s->level[LEVEL_MAIN];
    const struct axis_strain axis =
        axis_strain_of(&level->mesh, (const double(*)[3])level->state.u_mm);
    const double correction = extrapolate(s);
    r->strain.eps_max = eps_max_of(&axis) + correction;
    r->strain.eps_max_depth_mm = axis.depth_mm;
    r->numerics.eps_max_error = eps_max_error(s, &axis, correction);
}

static enum ischia_code measure(struct solve *s, struct ischia_error *err)
{
    struct ischia_result *r = &s->result;
    const struct level *level = &s->level[LEVEL_MAIN];
    const struct seat_state seat = {&level->state.u_mm[0][0], level->seat.normal_N};
    struct strain_field field;
    measure_axis(s);
    TRY(strain_field_init(&field, &level->mesh, &level->state.u_mm[0][0], err));
    const struct strain_measures most = strain_muscle_maxima(&level->mesh, &field);
    r->strain.E_shear_max = most.green_lagrange_shear;
    r->strain.E_comp_max = most.green_lagrange_compression;
    r->muscle_volume_mm3 = side_extent(strain_muscle_volume_mm3(&level->mesh, &field));
    r->threshold_force_shear_N =
        crossing_N(r, offsetof(struct ischia_load_point, E_shear_max), ISCHIA_E_SHEAR_THRESHOLD);
    r->threshold_force_compression_N =
        crossing_N(r, offsetof(struct ischia_load_point, E_comp_max), ISCHIA_E_COMP_THRESHOLD);
    enum ischia_code code = clusters_find_all(&level->mesh, &field, r->clusters, err);
    strain_field_finish(&field);
    TRY(code);
    r->seat.displacement_mm = level->state.d_mm;
    return seat_pressure(&level->mesh, &seat, &r->seat, err);
}

/* The checks that a converged load path must still pass. */
static void judge(struct solve *s)
{
    struct ischia_numerics *n = &s->result.numerics;
    const struct level *level = &s->level[LEVEL_MAIN];
    n->det_F_min = body_det_F_min(&level->body, (const double(*)[3])level->state.u_mm);
    if (n->reason < 0) return;
    if (!(n->det_F_min > 0) || !is_sound(&level->report)) {
        n->reason = ISCHIA_DIVERGED_CHECKS;
        (void)snprintf(n->detail, sizeof n->detail,
                       "det F is %.3g at the least (> 0 wanted), the energy balance is off by %.2g "
                       "(at most %g)",
                       n->det_F_min, n->energy_residual, energy_residual_max);
    }
}

static void take_reports(struct solve *s)
{
    struct ischia_numerics *n = &s->result.numerics;
    const struct level *level = &s->level[LEVEL_MAIN];
    const struct path_report *report = &level->report;
    n->reason = report->reason;
    n->elements = level->mesh.element_count;
    n->dof = level->assembly->n + 1;
    n->load_steps = report->load_steps;
    n->force_residual = report->force_residual;
    n->energy_residual = report->energy_residual;
    n->last_converged_F_N = side_force_N(report->last_force_N);
    for (int l = 0; l < LEVEL_COUNT; l++) {
        n->newton_iterations += s->level[l].report.newton_iterations;
        n->factorisations += s->level[l].report.factorisations;
    }
    (void)snprintf(n->detail, sizeof n->detail, "%s", report->tried);
    if (is_sound(report) && s->attempt > 0)
        (void)snprintf(n->detail, sizeof n->detail,
                       "solved with the corners of elements weighing %g, not %g",
                       attempts[s->attempt].corner_share, attempts[0].corner_share);
}

static enum ischia_code keep_field(const struct level *level, struct ischia_field *ret,
                                   struct ischia_error *err)
{
    const size_t numbers = 3 * (size_t)level->mesh.node_count;
    ret->displacement_mm = malloc(numbers * sizeof *ret->displacement_mm);
    CHECK(ret->displacement_mm != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the field");
    memcpy(ret->displacement_mm, level->state.u_mm, numbers * sizeof *ret->displacement_mm);
    ret->node_count = (size_t)level->mesh.node_count;
    return ISCHIA_OK;
}

/* At rest, with the materials of an attempt. */
static enum ischia_code level_rest(struct solve *s, struct level *level,
                                   const struct attempt *attempt, struct ischia_error *err)
{
    struct equilibrium *state = &level->state;
    struct element_material material[TISSUE_COUNT];
    memset(state->u_mm, 0, sizeof *state->u_mm * (size_t)level->mesh.node_count);
    *state = (struct equilibrium){.u_mm = state->u_mm};
    level->curve.count = 0;
    body_finish(&level->body);
    seat_finish(&level->seat);
    set_materials(s->c, attempt->corner_share, material);
    TRY(body_init(&level->body, &level->mesh, material, err));
    return seat_init(&level->seat, &level->mesh, s->c->option[ISCHIA_FRICTION], err);
}

/* The work of all paths counts; all else is the last one's. */
static void add_work(const struct path_report *before, struct path_report *report)
{
    report->newton_iterations += before->newton_iterations;
    report->factorisations += before->factorisations;
}

static enum ischia_code solve_level(struct solve *s, int l, struct ischia_solver *solver,
                                    struct ischia_error *err)
{
    const struct path_observer observer = {report_iteration, record_step, s};
    const struct attempt *attempt = &attempts[s->attempt];
    struct level *level = &s->level[l];
    const struct path_report before = level->report;
    if (level_divisions[l][s->c->resolution].across == 0) return ISCHIA_OK;
    s->current = l;
    if (s->attempt == 0) TRY(level_init(s, l, solver, err));
    TRY(level_rest(s, level, attempt, err));
    TRY(path_follow(&level->body, level->assembly, &level->seat,
                    quarter_force_N(s->c->param[ISCHIA_F]), &attempt->effort, &observer,
                    &level->state, &level->report, err));
    add_work(&before, &level->report);
    return ISCHIA_OK;
}

/* Both levels with the same rule, for they are extrapolated; the finer one decides. */
static enum ischia_code solve_levels(struct solve *s, struct ischia_solver *solver,
                                     struct ischia_error *err)
{
    struct path_report *report = &s->level[LEVEL_MAIN].report;
    for (s->attempt = 0; s->attempt < ATTEMPT_COUNT; s->attempt++) {
        for (int l = 0; l < LEVEL_COUNT; l++) TRY(solve_level(s, l, solver, err));
        if (is_sound(report)) return ISCHIA_OK;
    }
    report->tried = attempts_tried;
    return ISCHIA_OK;
}

static enum ischia_code solve_run(struct solve *s, struct ischia_solver *solver,
                                  struct ischia_field *ret_field, struct ischia_error *err)
{
    TRY(solve_levels(s, solver, err));
    take_reports(s);
    TRY(measure(s, err));
    judge(s);
    if (ret_field != NULL && ischia_result_converged(&s->result))
        return keep_field(&s->level[LEVEL_MAIN], ret_field, err);
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
