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

/* What a result must pass to be called converged. */
static const double energy_residual_max = 5e-3;

/* eps_max is taken to be off by this share of the bracket of its two readings, and by this share of
 * itself for what the bracket does not see: how far the bone travels, which converges more slowly
 * (docs/VERIFICATION.md, docs/decisions/0019-one-graded-mesh.md). */
static const double error_of_bracket = 0.5;
static const double error_allowance = 0.0125;

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
    {0.4, {.pace = 1, .factorisations_max = 200}},
    {0.7, {.pace = 1, .factorisations_max = 400}},
    {1, {.pace = 1, .factorisations_max = 700}},
    {0.85, {.pace = 1, .factorisations_max = 700}},
    {0.7, {.pace = 0.6, .factorisations_max = 900}},
    {0.7, {.pace = 0.4, .factorisations_max = 2500, .slow_motion = true}},
    {0.85, {.pace = 0.4, .factorisations_max = 2500, .slow_motion = true}},
};
static const char *const attempts_tried =
    "the corners weighing 0.4, 0.7, 1 and 0.85, 0.7 in steps of 0.6 of the length, 0.7 and 0.85 in "
    "steps of 0.4 with snaps in slow motion";
enum { ATTEMPT_COUNT = sizeof attempts / sizeof attempts[0] };

struct ischia_solver {
    struct assembly assembly[ISCHIA_RESOLUTION_COUNT]; /* made when first needed */
    bool has_assembly[ISCHIA_RESOLUTION_COUNT];
    struct solve *last; /* NULL: none. The same side with a larger force goes on from it. */
};

enum ischia_code ischia_solver_create(struct ischia_solver **ret_solver, struct ischia_error *err)
{
    struct ischia_solver *solver = calloc(1, sizeof *solver);
    CHECK(solver != NULL, err, ISCHIA_E_MEMORY, "not enough memory for a solver");
    *ret_solver = solver;
    return ISCHIA_OK;
}

void ischia_field_finish(struct ischia_field *field)
{
    if (field == NULL) return;
    free(field->displacement_mm);
    *field = (struct ischia_field){0};
}

/* --- one solve -------------------------------------------------------------------------------- */

/* One attempt, and where a larger force goes on from. */
struct trial {
    struct body body;
    struct seat seat;
    struct equilibrium state;
    struct path *path; /* NULL: not begun */
    struct path_report report;
    struct ischia_load_point curve[ISCHIA_LOAD_POINTS_MAX];
    int points, points_on_way; /* of the curve; those that belong to every larger force */
};

struct solve {
    struct ischia_case c;
    const struct ischia_observer *observer; /* during ischia_solve */
    struct mesh mesh;
    struct assembly *assembly; /* the solver's */
    struct trial trial[ATTEMPT_COUNT];
    int attempt;
    struct ischia_result result;
    double fraction; /* of the progress last reported */
};

static bool is_sound(const struct path_report *report)
{
    return report->reason > 0 && fabs(report->energy_residual) <= energy_residual_max;
}

static void trial_finish(struct trial *t)
{
    path_destroy(t->path);
    seat_finish(&t->seat);
    body_finish(&t->body);
    free(t->state.u_mm);
}

static void solve_destroy(struct solve *s)
{
    if (s == NULL) return;
    for (int a = 0; a < ATTEMPT_COUNT; a++) trial_finish(&s->trial[a]);
    mesh_finish(&s->mesh);
    free(s);
}

void ischia_solver_forget(struct ischia_solver *solver)
{
    solve_destroy(solver->last);
    solver->last = NULL;
}

void ischia_solver_destroy(struct ischia_solver *solver)
{
    if (solver == NULL) return;
    ischia_solver_forget(solver);
    for (int r = 0; r < ISCHIA_RESOLUTION_COUNT; r++)
        if (solver->has_assembly[r]) assembly_finish(&solver->assembly[r]);
    free(solver);
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

static enum ischia_code solve_init(struct solve *s, struct ischia_solver *solver,
                                   struct ischia_error *err)
{
    const int r = (int)s->c.resolution;
    TRY(mesh_local_init(&s->mesh, &s->c, &mesh_divisions[r], err));
    if (!solver->has_assembly[r]) TRY(assembly_init(&solver->assembly[r], &s->mesh, err));
    solver->has_assembly[r] = true;
    s->assembly = &solver->assembly[r];
    return ISCHIA_OK;
}

static bool report_iteration(void *context, int load_step, int newton_iteration, double force_N)
{
    struct solve *s = context;
    const double F_N = side_force_N(force_N);
    /* The force is what a user waits for; early steps carry little of it, hence the root. What
     * comes after the path is the last hundredth. */
    const double share = sqrt(fmax(0, fmin(1, F_N / s->c.param[ISCHIA_F])));
    if (s->observer == NULL || s->observer->on_progress == NULL) return true;
    s->fraction = fmax(s->fraction, 0.99 * share);
    const struct ischia_progress progress = {.fraction = s->fraction,
                                             .load_step = load_step,
                                             .newton_iteration = newton_iteration,
                                             .F_N = F_N,
                                             .message = "pressing the tissue on the seat"};
    return s->observer->on_progress(s->observer->context, &progress);
}

_Static_assert((int)PATH_STEPS_MAX <= (int)ISCHIA_LOAD_POINTS_MAX,
               "the last step, at the whole force, has its place on the load curve");

/* Forces rise along a load curve; a point that does not rise is left out. */
static void add_load_point(struct trial *t, const struct ischia_load_point *point)
{
    const double last_N = t->points > 0 ? t->curve[t->points - 1].F_N : 0;
    assert(t->points < ISCHIA_LOAD_POINTS_MAX);
    if (point->F_N > last_N) t->curve[t->points++] = *point;
}

/* One point of the load curve. */
static enum ischia_code record_step(void *context, const struct equilibrium *state,
                                    struct ischia_error *err)
{
    (void)err; /* nothing here can fail */
    struct solve *s = context;
    const struct axis_strain axis = axis_strain_of(&s->mesh, (const double(*)[3])state->u_mm);
    const struct strain_maxima most = strain_muscle_maxima(&s->mesh, &state->u_mm[0][0]);
    const struct ischia_load_point load = {.F_N = side_force_N(state->force_N),
                                           .displacement_mm = state->d_mm,
                                           .eps_max = axis.eps_max,
                                           .E_shear_max = most.green_lagrange_shear,
                                           .E_comp_max = most.green_lagrange_compression};
    add_load_point(&s->trial[s->attempt], &load);
    return ISCHIA_OK;
}

static void record_leave(void *context)
{
    struct solve *s = context;
    s->trial[s->attempt].points_on_way = s->trial[s->attempt].points;
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

static void measure_axis(struct solve *s, const struct equilibrium *state)
{
    struct ischia_result *r = &s->result;
    const struct axis_strain axis = axis_strain_of(&s->mesh, (const double(*)[3])state->u_mm);
    r->strain.eps_max = axis.eps_max;
    r->strain.eps_max_depth_mm = axis.depth_mm;
    r->numerics.eps_max_error =
        error_of_bracket * fabs(axis.recovered - axis.raw) + error_allowance * axis.eps_max;
}

static enum ischia_code measure(struct solve *s, struct ischia_error *err)
{
    struct ischia_result *r = &s->result;
    const struct trial *t = &s->trial[s->attempt];
    const struct seat_state seat = {&t->state.u_mm[0][0], t->seat.normal_N};
    struct strain_field field;
    measure_axis(s, &t->state);
    TRY(strain_field_init(&field, &s->mesh, seat.displacement_mm, err));
    const struct strain_maxima most = strain_muscle_maxima(&s->mesh, seat.displacement_mm);
    r->strain.E_shear_max = most.green_lagrange_shear;
    r->strain.E_comp_max = most.green_lagrange_compression;
    r->muscle_volume_mm3 = side_extent(strain_muscle_volume_mm3(&s->mesh, &field));
    r->threshold_force_shear_N =
        crossing_N(r, offsetof(struct ischia_load_point, E_shear_max), ISCHIA_E_SHEAR_THRESHOLD);
    r->threshold_force_compression_N =
        crossing_N(r, offsetof(struct ischia_load_point, E_comp_max), ISCHIA_E_COMP_THRESHOLD);
    enum ischia_code code = clusters_find_all(&s->mesh, &field, r->clusters, err);
    strain_field_finish(&field);
    TRY(code);
    r->seat.displacement_mm = t->state.d_mm;
    return seat_pressure(&s->mesh, &seat, &r->seat, err);
}

/* The checks that a converged load path must still pass. */
static void judge(struct solve *s)
{
    struct ischia_numerics *n = &s->result.numerics;
    const struct trial *t = &s->trial[s->attempt];
    n->det_F_min = body_det_F_min(&t->body, (const double(*)[3])t->state.u_mm);
    if (n->reason < 0) return;
    if (!(n->det_F_min > 0) || !is_sound(&t->report)) {
        n->reason = ISCHIA_DIVERGED_CHECKS;
        (void)snprintf(n->detail, sizeof n->detail,
                       "det F is %.3g at the least (> 0 wanted), the energy balance is off by %.2g "
                       "(at most %g)",
                       n->det_F_min, n->energy_residual, energy_residual_max);
    }
}

/* What a result says of an attempt that was not the first. */
static void tell_attempt(const struct solve *s, char *ret_text, size_t size)
{
    const double released = s->trial[s->attempt].report.released;
    char snaps[80] = "";
    if (released > 0)
        (void)snprintf(snaps, sizeof snaps, "; snaps in slow motion released %.2g %% of the work",
                       100 * released);
    (void)snprintf(ret_text, size, "solved with the corners of elements weighing %g, not %g%s",
                   attempts[s->attempt].corner_share, attempts[0].corner_share, snaps);
}

static void take_reports(struct solve *s)
{
    struct ischia_numerics *n = &s->result.numerics;
    const struct trial *t = &s->trial[s->attempt];
    const struct path_report *report = &t->report;
    s->result.load_curve_count = t->points;
    memcpy(s->result.load_curve, t->curve, sizeof t->curve);
    n->reason = report->reason;
    n->elements = s->mesh.element_count;
    n->dof = s->assembly->n + 1;
    n->load_steps = report->load_steps;
    n->force_residual = report->force_residual;
    n->energy_residual = report->energy_residual;
    n->last_converged_F_N = side_force_N(report->last_force_N);
    for (int a = 0; a <= s->attempt; a++) {
        n->newton_iterations += s->trial[a].report.newton_iterations;
        n->factorisations += s->trial[a].report.factorisations;
    }
    (void)snprintf(n->detail, sizeof n->detail, "%s", report->tried);
    if (is_sound(report) && s->attempt > 0) tell_attempt(s, n->detail, sizeof n->detail);
}

static enum ischia_code keep_field(const struct solve *s, struct ischia_field *ret,
                                   struct ischia_error *err)
{
    const double *u_mm = &s->trial[s->attempt].state.u_mm[0][0];
    const size_t numbers = 3 * (size_t)s->mesh.node_count;
    ret->displacement_mm = malloc(numbers * sizeof *ret->displacement_mm);
    CHECK(ret->displacement_mm != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the field");
    memcpy(ret->displacement_mm, u_mm, numbers * sizeof *ret->displacement_mm);
    ret->node_count = (size_t)s->mesh.node_count;
    return ISCHIA_OK;
}

/* At rest, with the materials of an attempt. */
static enum ischia_code trial_begin(struct trial *t, const struct solve *s,
                                    const struct attempt *attempt, struct ischia_error *err)
{
    struct element_material material[TISSUE_COUNT];
    set_materials(&s->c, attempt->corner_share, material);
    t->state.u_mm = calloc((size_t)s->mesh.node_count, sizeof *t->state.u_mm);
    CHECK(t->state.u_mm != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the displacements");
    TRY(body_init(&t->body, &s->mesh, material, err));
    TRY(seat_init(&t->seat, &s->mesh, s->c.option[ISCHIA_FRICTION], err));
    return path_create(&t->path, &t->body, s->assembly, &t->seat, &attempt->effort, &t->state, err);
}

/* From rest, or from where the attempt left for a smaller force. */
static enum ischia_code press(struct solve *s, struct trial *t, struct ischia_error *err)
{
    const struct path_observer observer = {report_iteration, record_step, record_leave, s};
    if (t->path == NULL) TRY(trial_begin(t, s, &attempts[s->attempt], err));
    t->points = t->points_on_way;
    return path_press(t->path, quarter_force_N(s->c.param[ISCHIA_F]), &observer, &t->report, err);
}

static enum ischia_code solve_attempts(struct solve *s, struct ischia_error *err)
{
    for (s->attempt = 0; s->attempt < ATTEMPT_COUNT; s->attempt++) {
        struct trial *t = &s->trial[s->attempt];
        TRY(press(s, t, err));
        if (is_sound(&t->report)) return ISCHIA_OK;
    }
    s->attempt--;
    s->trial[s->attempt].report.tried = attempts_tried;
    return ISCHIA_OK;
}

static enum ischia_code solve_run(struct solve *s, struct ischia_field *ret_field,
                                  struct ischia_error *err)
{
    TRY(solve_attempts(s, err));
    take_reports(s);
    TRY(measure(s, err));
    judge(s);
    if (ret_field != NULL && ischia_result_converged(&s->result))
        return keep_field(s, ret_field, err);
    return ISCHIA_OK;
}

static bool are_equal(const double *a, const double *b, int count)
{
    int n = 0;
    while (n < count && a[n] == b[n]) n++;
    return n == count;
}

/* The same side and options, but for the force. */
static bool is_same_side(const struct ischia_case *a, const struct ischia_case *b)
{
    struct ischia_case as_b = *a;
    as_b.param[ISCHIA_F] = b->param[ISCHIA_F];
    return as_b.resolution == b->resolution &&
           are_equal(as_b.param, b->param, ISCHIA_PARAM_COUNT) &&
           are_equal(as_b.option, b->option, ISCHIA_OPTION_COUNT);
}

/* Takes up the last solve for the same side with no smaller force: the same bits, less work. */
static bool takes_up(struct solve *last, const struct ischia_case *c)
{
    if (last == NULL || !is_same_side(&last->c, c) || c->param[ISCHIA_F] < last->c.param[ISCHIA_F])
        return false;
    last->c = *c;
    last->fraction = 0;
    last->result = (struct ischia_result){0};
    return true;
}

/* The solver's solve, ready for a case. */
static enum ischia_code solve_begin(struct ischia_solver *solver, const struct ischia_case *c,
                                    struct ischia_error *err)
{
    if (takes_up(solver->last, c)) return ISCHIA_OK;
    struct solve *s = calloc(1, sizeof *s);
    CHECK(s != NULL, err, ISCHIA_E_MEMORY, "not enough memory for a solve");
    s->c = *c;
    ischia_solver_forget(solver);
    solver->last = s;
    return solve_init(s, solver, err);
}

enum ischia_code ischia_solve(struct ischia_solver *solver, const struct ischia_case *c,
                              const struct ischia_observer *observer,
                              struct ischia_result *ret_result, struct ischia_field *ret_field,
                              struct ischia_error *err)
{
    struct ischia_field field = {0};
    assert(ischia_case_is_valid(c));
    enum ischia_code code = solve_begin(solver, c, err);
    if (code == ISCHIA_OK) {
        solver->last->observer = observer;
        code = solve_run(solver->last, ret_field != NULL ? &field : NULL, err);
    }
    if (code == ISCHIA_OK) {
        *ret_result = solver->last->result;
        if (ret_field != NULL) *ret_field = field;
    } else {
        ischia_solver_forget(solver); /* a path that broke off is of no more use */
    }
    return code;
}
