/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Each step factors the tangent with all equations but those of the nodes that rest on the seat
 * eliminated; contact and friction are then solved on what is condensed there (contact.h), so that
 * a step never goes through the seat. There are two kinds.
 *
 * The descent step holds the friction limits mu N at their lagged values. The load step is then a
 * minimisation, and a line search on the potential makes the step safe from anywhere: where the
 * tangent is not positive definite it is made so (element.h, convexity).
 *
 * The exact step solves Coulomb's law for the linear model, and treats the contact forces as
 * unknowns of their own: like the pressures of the elements they are carried along by the model,
 * for the gradient of a state that is not yet in equilibrium says nothing about them.
 */
#include "solver/newton.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/contact.h"

/* Armijo's constant; the shortest and the longest step tried, over a Newton step; potential changes
 * below this share of the elastic energy are rounding and say nothing about descent. */
static const double armijo = 1e-4;
static const double step_min = 1e-6;
static const double reach_max = 256;
static const double energy_rounding = 1e-12;
/* The lagged limits are renewed once the rest of the residual is this share of the whole. */
static const double relag_share = 0.1;
/* Each exact step must reduce the best residual by this factor, or counts as idle; after some idle
 * steps they are damped, and after more the run of them is given up. */
static const double exact_reduction = 0.7;
static const int exact_damp_after = 2;
static const double exact_damping = 0.6;
/* A step along a tangent that had to be made convex and led nowhere counts as two. */
static const int exact_idle_max = 4;
static const int exact_rest = 2; /* more after each relapse */
/* A direction that moves a node further than this, over the tissue's height, comes from a tangent
 * that is nearly singular: descend instead. */
static const double exact_move_max = 0.1;
/* Below this residual a step with the factor of the step before is tried: a fifth of the work. It
 * must reduce the residual by the second to be followed by another. */
static const double stale_residual = 1e-3;
static const double stale_reduction = 0.3;
/* Convexities tried in turn until the tangent is positive definite. */
static const double convexity_ladder[] = {0, 0.3, 1};

struct newton {
    struct body *body;
    struct assembly *assembly;
    struct seat *seat;
    struct contact *contact;
    int n;
    double (*force)[3];  /* [node] gradient of the potential                                  */
    double (*bulk)[3];   /* [node] of it the body's, without friction                         */
    double (*trial)[3];  /* [node]                                                            */
    double (*saved)[3];  /* [node] displacements before an exact step                         */
    double *normal_N;    /* [node] contact forces by the gradient, or by the model            */
    double *saved_N;     /* [node] tracked contact forces before an exact step                */
    double *saved_MPa;   /* [element] tracked pressures before an exact step                  */
    double *border;      /* [n] d2E / du dd                                                   */
    double *reduced;     /* [2][n] the load, and minus the border, as linear_reduce leaves them */
    double *direction;   /* [n + 1] du, dd                                                    */
    unsigned char *keep; /* [n] 0: a node off the outer skin that touches the seat; held    */
    unsigned char *kept; /* [n] the same, of the last factor                                */
    double corner;       /* d2E / dd2                                                         */
    double elastic_Nmm;
    double reaction_N; /* of the bone                                                       */
    double residual;   /* with the contact forces of the present iterate                    */
    bool force_controlled;
    bool convexified; /* the factored tangent is not the exact one                          */
    bool has_model;   /* the factor is of a step of this minimisation                       */
};

static size_t pressures(const struct newton *w) { return (size_t)w->body->batch_count * BATCH; }

enum ischia_code newton_create(struct newton **ret, struct body *body, struct assembly *assembly,
                               struct seat *seat, struct ischia_error *err)
{
    const size_t nodes = (size_t)body->mesh->node_count, n = (size_t)assembly->n;
    struct newton *w = calloc(1, sizeof *w);
    CHECK(w != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the Newton iteration");
    *w = (struct newton){.body = body, .assembly = assembly, .seat = seat, .n = assembly->n};
    w->force = calloc(nodes, sizeof *w->force);
    w->bulk = calloc(nodes, sizeof *w->bulk);
    w->trial = calloc(nodes, sizeof *w->trial);
    w->saved = calloc(nodes, sizeof *w->saved);
    w->normal_N = calloc(nodes, sizeof *w->normal_N);
    w->saved_N = calloc(nodes, sizeof *w->saved_N);
    w->saved_MPa = calloc(pressures(w), sizeof *w->saved_MPa);
    w->border = calloc(n, sizeof *w->border);
    w->reduced = calloc(2 * n, sizeof *w->reduced);
    w->direction = calloc(n + 1, sizeof *w->direction);
    w->keep = calloc(n, sizeof *w->keep);
    w->kept = calloc(n, sizeof *w->kept);
    if (!w->force || !w->bulk || !w->trial || !w->saved || !w->normal_N || !w->saved_N ||
        !w->saved_MPa || !w->border || !w->reduced || !w->direction || !w->keep || !w->kept) {
        newton_destroy(w);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the Newton iteration");
    }
    const enum ischia_code code = contact_create(&w->contact, body->mesh, assembly, err);
    if (code == ISCHIA_OK)
        *ret = w;
    else
        newton_destroy(w);
    return code;
}

void newton_destroy(struct newton *newton)
{
    if (newton == NULL) return;
    contact_destroy(newton->contact);
    free(newton->force);
    free(newton->bulk);
    free(newton->trial);
    free(newton->saved);
    free(newton->normal_N);
    free(newton->saved_N);
    free(newton->saved_MPa);
    free(newton->border);
    free(newton->reduced);
    free(newton->direction);
    free(newton->keep);
    free(newton->kept);
    free(newton);
}

/* --- the state: gradient, Hessian, contact ---------------------------------------------------- */

static double bone_reaction_N(const struct newton *w)
{
    double sum = 0;
    for (int n = 0; n < w->body->mesh->node_count; n++)
        if (w->assembly->equation[n][2] == EQUATION_BONE) sum -= w->force[n][2];
    return sum;
}

/* Norm of the out-of-balance forces with friction for the tracked contact forces, over the force. A
 * node that presses on the seat is in balance in z when the tracked force is the gradient. */
static double residual_norm(const struct newton *w, const struct newton_control *control)
{
    const double *tracked_N = w->seat->normal_N;
    double sum = 0;
    for (int n = 0; n < w->body->mesh->node_count; n++)
        for (int c = 0; c < 3; c++) {
            const double resting = c == 2 ? tracked_N[n] : 0;
            if (w->assembly->equation[n][c] >= 0) sum += pow(w->force[n][c] - resting, 2);
        }
    if (control->force_controlled) sum += pow(w->reaction_N - control->force_N, 2);
    return sqrt(sum) / control->force_N;
}

static size_t node_bytes(const struct newton *w)
{
    return sizeof(double) * (size_t)w->body->mesh->node_count;
}

/* Contact forces by the gradient: of the nodes on the seat that it presses down. */
static void find_gradient_normals(struct newton *w, const double (*u)[3])
{
    for (int n = 0; n < w->body->mesh->node_count; n++)
        w->normal_N[n] =
            seat_binds(w->body->mesh, u, (const double(*)[3])w->force, n) ? w->force[n][2] : 0;
}

/* The equations of the nodes that rest on the seat come last, and are the contact's. */
static bool is_condensed(const struct newton *w, int equation)
{
    return equation >= w->assembly->seat_first;
}

/* Other nodes that press on the seat are held there by the linear system. */
static void hold_other_nodes(struct newton *w)
{
    memset(w->keep, 1, (size_t)w->n);
    for (int n = 0; n < w->body->mesh->node_count; n++) {
        const int eq = w->assembly->equation[n][2];
        if (w->normal_N[n] > 0 && !is_condensed(w, eq)) w->keep[eq] = 0;
    }
}

static double drag_energy(const struct newton *w, const double (*u)[3],
                          const struct newton_drag *drag)
{
    double sum = 0;
    if (drag == NULL) return 0;
    for (int n = 0; n < w->body->mesh->node_count; n++)
        for (int c = 0; c < 3; c++)
            if (w->assembly->equation[n][c] >= 0)
                sum += drag->spring_N_mm[n] / 2 * pow(u[n][c] - drag->from_mm[n][c], 2);
    return sum;
}

static void add_drag(struct newton *w, const double (*u)[3], const struct newton_drag *drag)
{
    double *values = linear_values(w->assembly->linear);
    if (drag == NULL) return;
    for (int n = 0; n < w->body->mesh->node_count; n++)
        for (int c = 0; c < 3; c++) {
            if (w->assembly->equation[n][c] < 0) continue;
            w->force[n][c] += drag->spring_N_mm[n] * (u[n][c] - drag->from_mm[n][c]);
            values[w->assembly->diagonal[n][c]] += drag->spring_N_mm[n];
        }
}

/* Energy, its gradient and Hessian at u, those of drag and friction too, the latter for the tracked
 * contact forces. */
static void linearise(struct newton *w, const double (*u)[3], double convexity,
                      const struct newton_control *control)
{
    struct body_derivatives d = {.force = w->force, .border = w->border};
    w->elastic_Nmm = body_linearise(w->body, w->assembly, u, convexity, &d);
    w->corner = d.corner;
    add_drag(w, u, control->drag);
    w->reaction_N = bone_reaction_N(w);
    find_gradient_normals(w, u);
    hold_other_nodes(w);
    memcpy(w->bulk, w->force, sizeof *w->bulk * (size_t)w->body->mesh->node_count);
    seat_add_force(w->seat, w->seat->normal_N, u, w->force);
    seat_add_stiffness(w->seat, w->assembly, u);
    w->residual = residual_norm(w, control);
}

/* --- the linear system ------------------------------------------------------------------------ */

static double dot(int n, const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* The right-hand sides, of all that is not contact: minus the gradient, and minus the border. */
static void set_load(struct newton *w)
{
    for (int n = 0; n < w->body->mesh->node_count; n++)
        for (int c = 0; c < 3; c++) {
            const int eq = w->assembly->equation[n][c];
            if (eq < 0) continue;
            w->reduced[eq] = is_condensed(w, eq) ? -w->bulk[n][c] : -w->force[n][c];
            if (!w->keep[eq]) w->reduced[eq] = 0;
        }
}

static void set_border(struct newton *w)
{
    for (int i = 0; i < w->n; i++) w->reduced[w->n + i] = w->keep[i] ? -w->border[i] : 0;
}

/* What the load makes of the condensed model. */
static void load_model(struct newton *w, const struct newton_control *control)
{
    struct contact_model *model = contact_model_of(w->contact);
    const int first = w->assembly->seat_first;
    const double *load = w->reduced, *border = w->reduced + w->n;
    memcpy(model->load, load + first, sizeof *model->load * (size_t)(w->n - first));
    model->d_load = control->force_N - w->reaction_N + dot(first, border, load);
    model->force_controlled = w->force_controlled;
}

/* Factors the tangent and condenses the model to the nodes on the seat; *ret_factored tells
 * whether what is eliminated is positive definite. */
static enum ischia_code condense(struct newton *w, const struct newton_control *control,
                                 struct newton_report *report, bool *ret_factored,
                                 struct ischia_error *err)
{
    struct contact_model *model = contact_model_of(w->contact);
    const int first = w->assembly->seat_first;
    const double *border = w->reduced + w->n;
    enum linear_outcome outcome;
    w->has_model = false;
    TRY(linear_factor(w->assembly->linear, w->keep, &outcome, err));
    report->factorisations++;
    *ret_factored = outcome == LINEAR_FACTORED;
    if (!*ret_factored) return ISCHIA_OK;
    set_load(w);
    set_border(w);
    TRY(linear_reduce(w->assembly->linear, 2, w->reduced, err));
    linear_condensed(w->assembly->linear, model->stiffness);
    for (int i = first; i < w->n; i++) model->border[i - first] = -border[i];
    model->corner = w->corner - dot(first, border, border);
    load_model(w, control);
    memcpy(w->kept, w->keep, (size_t)w->n);
    w->has_model = true;
    return ISCHIA_OK;
}

/* True when the last factor is of an exact tangent with the same equations held. */
static bool model_fits(const struct newton *w)
{
    return w->has_model && !w->convexified && memcmp(w->keep, w->kept, (size_t)w->n) == 0;
}

/* The direction from its part at the seat, w->direction[first ... n], which contact gave. */
static enum ischia_code expand(struct newton *w, double load_share, double dd,
                               struct ischia_error *err)
{
    for (int i = 0; i < w->assembly->seat_first; i++)
        w->direction[i] = load_share * w->reduced[i] + dd * w->reduced[w->n + i];
    w->direction[w->n] = dd;
    return linear_expand(w->assembly->linear, w->direction, err);
}

static double largest_move_mm(const struct newton *w)
{
    double largest = 0;
    for (int i = 0; i < w->n; i++) largest = fmax(largest, fabs(w->direction[i]));
    return largest;
}

/* The direction of the present model, into w->direction and w->normal_N. *ret_found: what is
 * eliminated is definite, contact has a solution, and the model is stable with it. */
static enum ischia_code solve_model(struct newton *w, const struct equilibrium *state,
                                    const struct newton_control *control,
                                    enum contact_friction friction, struct newton_report *report,
                                    bool *ret_found, struct ischia_error *err)
{
    const double(*u)[3] = (const double(*)[3])state->u_mm;
    double dd;
    TRY(condense(w, control, report, ret_found, err));
    if (!*ret_found) return ISCHIA_OK;
    *ret_found = contact_solve(w->contact, w->seat, u, friction,
                               w->direction + w->assembly->seat_first, &dd, w->normal_N) &&
                 contact_is_stable(w->contact, w->seat);
    return *ret_found ? expand(w, 1, dd, err) : ISCHIA_OK;
}

/* The same; raises the convexity of the tangent until there is a direction. */
static enum ischia_code find_direction(struct newton *w, const struct equilibrium *state,
                                       const struct newton_control *control,
                                       enum contact_friction friction, struct newton_report *report,
                                       bool *ret_found, struct ischia_error *err)
{
    const size_t rungs = sizeof convexity_ladder / sizeof convexity_ladder[0];
    size_t rung = 0;
    TRY(solve_model(w, state, control, friction, report, ret_found, err));
    while (!*ret_found && ++rung < rungs) {
        linearise(w, (const double(*)[3])state->u_mm, convexity_ladder[rung], control);
        TRY(solve_model(w, state, control, friction, report, ret_found, err));
    }
    w->convexified = rung > 0;
    return ISCHIA_OK;
}

/* --- moving ----------------------------------------------------------------------------------- */

/* trial = state moved by alpha along the direction, stopped at the seat. Returns the gradient times
 * the move that was really made. */
static double move(struct newton *w, const struct equilibrium *state, double alpha,
                   const struct newton_control *control)
{
    const struct mesh *mesh = w->body->mesh;
    const double dd = w->direction[w->n];
    double slope = alpha * dd * (control->force_controlled ? w->reaction_N - control->force_N : 0);
    for (int n = 0; n < mesh->node_count; n++) {
        for (int c = 0; c < 3; c++) {
            const int eq = w->assembly->equation[n][c];
            w->trial[n][c] = state->u_mm[n][c];
            if (eq >= 0) w->trial[n][c] += alpha * w->direction[eq];
            if (eq == EQUATION_BONE) w->trial[n][c] = -(state->d_mm + alpha * dd);
        }
        if (mesh->node_flags[n] & NODE_ON_SEAT) seat_stop(mesh, n, w->trial[n]);
        for (int c = 0; c < 3; c++)
            if (w->assembly->equation[n][c] >= 0)
                slope += w->force[n][c] * (w->trial[n][c] - state->u_mm[n][c]);
    }
    return slope;
}

static void accept(struct newton *w, struct equilibrium *state, double alpha)
{
    body_track_pressure(w->body, alpha, (const double(*)[3])state->u_mm,
                        (const double(*)[3])w->trial);
    memcpy(state->u_mm, w->trial, sizeof *w->trial * (size_t)w->body->mesh->node_count);
    state->d_mm += alpha * w->direction[w->n];
}

static double potential(const struct newton *w, const double (*u)[3], double d_mm,
                        const struct newton_control *control, double elastic_Nmm)
{
    if (elastic_Nmm == HUGE_VAL) return HUGE_VAL;
    return elastic_Nmm + seat_energy(w->seat, u) + drag_energy(w, u, control->drag) -
           (control->force_controlled ? control->force_N * d_mm : 0);
}

static double potential_at(struct newton *w, const struct equilibrium *state, double alpha,
                           const struct newton_control *control, double *ret_slope)
{
    const double(*trial)[3] = (const double(*)[3])w->trial;
    *ret_slope = move(w, state, alpha, control);
    return potential(w, trial, state->d_mm + alpha * w->direction[w->n], control,
                     body_energy(w->body, trial));
}

/* Doubles a full step for as long as the potential goes on falling. A tangent that had to be made
 * convex knows nothing of the way down from an unstable state: its steps are far too short. */
static double reach_out(struct newton *w, const struct equilibrium *state,
                        const struct newton_control *control, double after)
{
    double alpha = 1, slope;
    while (alpha < reach_max) {
        const double further = potential_at(w, state, 2 * alpha, control, &slope);
        if (!(further < after)) break;
        after = further;
        alpha *= 2;
    }
    (void)move(w, state, alpha, control);
    return alpha;
}

/* Backtracks until the potential falls enough; false when it never does. */
static bool line_search(struct newton *w, struct equilibrium *state,
                        const struct newton_control *control)
{
    const double before =
        potential(w, (const double(*)[3])state->u_mm, state->d_mm, control, w->elastic_Nmm);
    const double noise = energy_rounding * fabs(w->elastic_Nmm);
    for (double alpha = 1; alpha >= step_min; alpha /= 2) {
        double slope;
        const double after = potential_at(w, state, alpha, control, &slope);
        if (after > before + armijo * slope + noise) continue;
        if (alpha >= 1 && w->convexified) alpha = reach_out(w, state, control, after);
        accept(w, state, alpha);
        return true;
    }
    return false;
}

/* Shortens the step until det F > 0; false when it never is. */
static bool move_uninverted(struct newton *w, struct equilibrium *state, double alpha_max,
                            const struct newton_control *control, double *ret_alpha)
{
    for (double alpha = alpha_max; alpha >= step_min; alpha /= 2) {
        (void)move(w, state, alpha, control);
        if (!(body_det_F_min(w->body, (const double(*)[3])w->trial) > 0)) continue;
        *ret_alpha = alpha;
        accept(w, state, alpha);
        return true;
    }
    return false;
}

/* --- the two kinds of step -------------------------------------------------------------------- */

/* Renews the lagged contact forces when they are what holds the residual up. */
static void relag(struct newton *w, const struct equilibrium *state,
                  const struct newton_control *control)
{
    double sum = 0;
    for (int n = 0; n < w->body->mesh->node_count; n++)
        for (int c = 0; c < 3; c++)
            if (w->assembly->equation[n][c] >= 0 && !(c == 2 && w->normal_N[n] > 0))
                sum += pow(w->force[n][c], 2);
    if (sqrt(sum) / control->force_N >= relag_share * w->residual) return;
    memcpy(w->seat->normal_N, w->normal_N, node_bytes(w));
    linearise(w, (const double(*)[3])state->u_mm, 0, control);
}

static enum ischia_code descent_step(struct newton *w, struct equilibrium *state,
                                     const struct newton_control *control,
                                     struct newton_report *report, struct ischia_error *err)
{
    bool found;
    relag(w, state, control);
    TRY(find_direction(w, state, control, CONTACT_LAGGED, report, &found, err));
    if (!found)
        report->reason = ISCHIA_DIVERGED_LINEAR;
    else if (!line_search(w, state, control))
        report->reason = ISCHIA_DIVERGED_STEP;
    return ISCHIA_OK;
}

/* Moves along w->direction, and carries the contact forces along. False when it leads nowhere. */
static bool follow_direction(struct newton *w, struct equilibrium *state, double alpha_max,
                             const struct newton_control *control)
{
    double alpha = 0;
    if (!(largest_move_mm(w) < exact_move_max * w->body->mesh->tip_z_mm) ||
        !move_uninverted(w, state, alpha_max, control, &alpha))
        return false;
    for (int n = 0; n < w->body->mesh->node_count; n++) {
        double *tracked = &w->seat->normal_N[n];
        *tracked = fmax(0, *tracked + alpha * (w->normal_N[n] - *tracked));
    }
    return true;
}

/* A tangent that had to be made convex still leads: carried along by it, the pressures and contact
 * forces come right within a few steps, and with them the tangent. */
static enum ischia_code exact_step(struct newton *w, struct equilibrium *state, double alpha_max,
                                   const struct newton_control *control,
                                   struct newton_report *report, bool *ret_made,
                                   struct ischia_error *err)
{
    TRY(find_direction(w, state, control, CONTACT_COULOMB, report, ret_made, err));
    *ret_made = *ret_made && follow_direction(w, state, alpha_max, control);
    return ISCHIA_OK;
}

/* The same with the factor of the step before. */
static enum ischia_code stale_step(struct newton *w, struct equilibrium *state,
                                   const struct newton_control *control, bool *ret_made,
                                   struct ischia_error *err)
{
    const double(*u)[3] = (const double(*)[3])state->u_mm;
    double dd;
    set_load(w);
    TRY(linear_reduce(w->assembly->linear, 1, w->reduced, err));
    load_model(w, control);
    *ret_made = contact_solve(w->contact, w->seat, u, CONTACT_COULOMB,
                              w->direction + w->assembly->seat_first, &dd, w->normal_N);
    if (!*ret_made) return ISCHIA_OK;
    TRY(expand(w, 1, dd, err));
    *ret_made = follow_direction(w, state, 1, control);
    return ISCHIA_OK;
}

/*
 * A run of exact steps. Nodes that change between stick and slip make the residual rise for a step
 * or two before it falls, so a run may go on for a few steps without a new best; then it is undone
 * to the best state and steps of descent take over (a watchdog; Chamberlain and others 1982).
 */
struct exact_run {
    bool active;
    int idle;        /* steps since the best residual                                          */
    int rest;        /* steps of descent before the next run                                   */
    double residual; /* the best                                                               */
    int relapses;    /* runs undone                                                            */
    double d_mm;     /* at the best; what else belongs to it is in saved, saved_N, saved_MPa    */
    bool stale;      /* the last step was made with the factor of one before                   */
    double previous; /* the residual before the last step                                      */
};

static void run_save(struct newton *w, const struct equilibrium *state, struct exact_run *run)
{
    memcpy(w->saved, state->u_mm, 3 * node_bytes(w));
    memcpy(w->saved_N, w->seat->normal_N, node_bytes(w));
    memcpy(w->saved_MPa, w->body->pressure_MPa, sizeof *w->saved_MPa * pressures(w));
    run->residual = w->residual;
    run->d_mm = state->d_mm;
    run->idle = 0;
}

static void run_restore(struct newton *w, struct equilibrium *state, const struct exact_run *run)
{
    memcpy(state->u_mm, w->saved, 3 * node_bytes(w));
    memcpy(w->seat->normal_N, w->saved_N, node_bytes(w));
    state->d_mm = run->d_mm;
}

static void run_undo(struct newton *w, struct equilibrium *state, struct exact_run *run,
                     const struct newton_control *control)
{
    run_restore(w, state, run);
    const int relapses = run->relapses + 1;
    *run = (struct exact_run){.rest = exact_rest * relapses, .relapses = relapses};
    body_reset_pressure(w->body, (const double(*)[3])state->u_mm);
    linearise(w, (const double(*)[3])state->u_mm, 0, control);
}

/* Back to the best state, from which a stale step has led nowhere; the run goes on. */
static void run_take_back(struct newton *w, struct equilibrium *state, const struct exact_run *run,
                          const struct newton_control *control)
{
    run_restore(w, state, run);
    memcpy(w->body->pressure_MPa, w->saved_MPa, sizeof *w->saved_MPa * pressures(w));
    linearise(w, (const double(*)[3])state->u_mm, 0, control);
}

/* Decides whether the run starts, goes on, or is undone, from the residual just found. */
static void run_update(struct newton *w, struct equilibrium *state, struct exact_run *run,
                       const struct newton_control *control)
{
    if (!run->active) {
        run->active = run->rest-- <= 0;
        if (run->active) run_save(w, state, run);
    } else if (w->residual < exact_reduction * run->residual) {
        run_save(w, state, run);
    } else if (run->stale) {
        run_take_back(w, state, run, control);
    } else if ((run->idle += 1 + w->convexified) > exact_idle_max) {
        run_undo(w, state, run, control);
    }
}

/* A stale step may follow a fresh one close to the end, and another one for as long as they pay. */
static bool stale_pays(const struct newton *w, const struct exact_run *run)
{
    const double most = run->stale ? stale_reduction * run->previous : stale_residual;
    return run->active && run->idle == 0 && w->residual < most && model_fits(w);
}

static enum ischia_code one_step(struct newton *w, struct equilibrium *state,
                                 const struct newton_control *control, struct exact_run *run,
                                 struct newton_report *report, struct ischia_error *err)
{
    bool made = false;
    run->stale = stale_pays(w, run);
    run->previous = w->residual;
    if (run->stale) TRY(stale_step(w, state, control, &made, err));
    if (made) return ISCHIA_OK;
    run->stale = false;
    if (run->active) {
        const double alpha_max = run->idle >= exact_damp_after ? exact_damping : 1;
        TRY(exact_step(w, state, alpha_max, control, report, &made, err));
        if (made) return ISCHIA_OK;
        run_undo(w, state, run, control);
    }
    return descent_step(w, state, control, report, err);
}

enum ischia_code newton_minimise(struct newton *w, struct equilibrium *state,
                                 const struct newton_control *control, newton_observe *observe,
                                 void *context, struct newton_report *ret_report,
                                 struct ischia_error *err)
{
    struct newton_report report = {.reason = ISCHIA_NOT_STARTED};
    struct exact_run run = {0};
    w->force_controlled = control->force_controlled;
    w->has_model = false;
    while (report.reason == ISCHIA_NOT_STARTED) {
        linearise(w, (const double(*)[3])state->u_mm, 0, control);
        run_update(w, state, &run, control);
        report.residual = w->residual;
        state->force_N = w->reaction_N;
        state->elastic_Nmm = w->elastic_Nmm;
        if (observe != NULL && !observe(context, &report, w->reaction_N))
            return FAIL(err, ISCHIA_E_CANCELLED, "cancelled");
        if (w->residual <= control->tolerance)
            report.reason = ISCHIA_CONVERGED;
        else if (report.iterations++ >= control->iterations_max)
            report.reason = ISCHIA_DIVERGED_ITERATIONS;
        else
            TRY(one_step(w, state, control, &run, &report, err));
    }
    *ret_report = report;
    return ISCHIA_OK;
}

void newton_linearise(struct newton *newton, const struct equilibrium *state)
{
    const struct newton_control any_scale = {.force_N = 1};
    const double(*u)[3] = (const double(*)[3])state->u_mm;
    body_reset_pressure(newton->body, u);
    linearise(newton, u, 0, &any_scale);
    newton->has_model = false;
}

/* The rate of the condensed model with d: its load is what the border brings. The model of the
 * last step will do, when it was exact: its state is a converged step's last correction away. */
static enum ischia_code condense_rate(struct newton *w, bool *ret_factored,
                                      struct ischia_error *err)
{
    const struct newton_control any = {.force_N = 1};
    struct newton_report report = {0};
    struct contact_model *model = contact_model_of(w->contact);
    *ret_factored = model_fits(w);
    w->force_controlled = model->force_controlled = false;
    if (!*ret_factored) {
        w->convexified = false;
        TRY(condense(w, &any, &report, ret_factored, err));
    }
    for (int i = 0; *ret_factored && i < w->n - w->assembly->seat_first; i++)
        model->load[i] = -model->border[i];
    return ISCHIA_OK;
}

enum ischia_code newton_tangent(struct newton *w, const struct equilibrium *state,
                                struct newton_tangent *ret, struct ischia_error *err)
{
    struct contact_model *model = contact_model_of(w->contact);
    const int first = w->assembly->seat_first;
    bool found;
    TRY(condense_rate(w, &found, err));
    found = found &&
            contact_rate(w->contact, w->seat, (const double(*)[3])state->u_mm, w->direction + first,
                         ret->normal_rate_N_mm) &&
            contact_is_stable(w->contact, w->seat);
    ret->stiffness_N_mm =
        found ? model->corner + dot(w->n - first, model->border, w->direction + first) : 0;
    if (!found) return ISCHIA_OK;
    TRY(expand(w, 0, 1, err));
    for (int n = 0; n < w->body->mesh->node_count; n++) {
        const int *eq = w->assembly->equation[n];
        for (int c = 0; c < 3; c++)
            ret->direction[n][c] = eq[c] >= 0               ? w->direction[eq[c]]
                                   : eq[c] == EQUATION_BONE ? -1
                                                            : 0;
    }
    return ISCHIA_OK;
}
