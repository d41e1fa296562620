/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Two kinds of step.
 *
 * The descent step holds the friction limits mu N at their lagged values. The load step is then a
 * minimisation, its tangent K is symmetric, and a line search on the potential makes the step safe
 * from anywhere: where K is not positive definite it is made so (element.h, convexity).
 *
 * The exact step treats the contact forces as unknowns of their own: like the pressures of the
 * elements they are carried along by the linear model, for the gradient of a state that is not yet
 * in equilibrium says nothing about them. They decide which nodes press on the seat (a primal-dual
 * active set; Hintermueller, Ito and Kunisch 2003) and which slip, and their change enters the
 * tangent, mu t dN: the derivative of Coulomb's law, not symmetric, of low rank. GMRES solves with
 * it, preconditioned by the factor of K.
 *
 * d enters as a border: [K b; b' c] [du; dd] = -[g; g_d] by one more solve with K's factor.
 */
#include "solver/newton.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/gmres.h"

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
static const int exact_idle_max = 6;
static const int exact_rest = 2; /* more after each relapse */
static const double gmres_tolerance = 1e-4;
/* A direction that moves a node further than this, over the tissue's height, comes from a tangent
 * that is nearly singular: descend instead. */
static const double exact_move_max = 0.1;
/* How often a direction is found anew because it changes which nodes press on the seat. */
enum { CONTACT_ROUNDS_MAX = 4 };
/* What GMRES must reach with a factor of other nodes on the seat; else these are factored. */
static const double stale_factor_max = 1e-2;

/* Convexities tried in turn until the tangent is positive definite. */
static const double convexity_ladder[] = {0, 0.3, 1};

struct newton {
    struct body *body;
    struct assembly *assembly;
    struct seat *seat;
    int n;
    double (*force)[3];  /* [node] gradient of the potential                                  */
    double (*trial)[3];  /* [node]                                                            */
    double (*saved)[3];  /* [node] displacements before an exact step                         */
    double *normal_N;    /* [node] scratch: contact forces by the gradient, or by the model */
    double *saved_N;     /* [node] tracked contact forces before an exact step              */
    double *border;      /* [n] d2E / du dd                                                   */
    double *landing;     /* [n] z step that ends on the seat, of nodes about to touch it      */
    double *from_border; /* [n] K^-1 of the masked border, of the present factor              */
    double *direction;   /* [n + 1] du, dd                                                    */
    double *scratch;     /* [n + 1]                                                           */
    double *krylov;
    unsigned char *keep;     /* [n] 0: on the seat, out of the system                             */
    unsigned char *factored; /* [n] keep, when it was factored                           */
    double *good;            /* [n + 1] the last direction within bounds                          */
    double *good_N;          /* [node] its contact forces                                         */
    double corner;           /* d2E / dd2                                                         */
    double schur;            /* corner - border . from_border                                     */
    double elastic_Nmm;
    double reaction_N; /* of the bone                                                       */
    double residual;   /* with the contact forces of the present iterate                    */
    double lagged_residual;
    bool force_controlled;
    bool convexified; /* the factored tangent is not the exact one */
};

enum ischia_code newton_create(struct newton **ret, struct body *body, struct assembly *assembly,
                               struct seat *seat, struct ischia_error *err)
{
    const size_t nodes = (size_t)body->mesh->node_count, n = (size_t)assembly->n;
    struct newton *w = calloc(1, sizeof *w);
    CHECK(w != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the Newton iteration");
    *w = (struct newton){.body = body, .assembly = assembly, .seat = seat, .n = assembly->n};
    w->force = calloc(nodes, sizeof *w->force);
    w->trial = calloc(nodes, sizeof *w->trial);
    w->saved = calloc(nodes, sizeof *w->saved);
    w->normal_N = calloc(nodes, sizeof *w->normal_N);
    w->saved_N = calloc(nodes, sizeof *w->saved_N);
    w->border = calloc(n, sizeof *w->border);
    w->landing = calloc(n, sizeof *w->landing);
    w->from_border = calloc(n, sizeof *w->from_border);
    w->direction = calloc(n + 1, sizeof *w->direction);
    w->scratch = calloc(n + 1, sizeof *w->scratch);
    w->krylov = malloc(gmres_work_size(assembly->n + 1) * sizeof *w->krylov);
    w->keep = calloc(n, sizeof *w->keep);
    w->factored = calloc(n, sizeof *w->factored);
    w->good = calloc(n + 1, sizeof *w->good);
    w->good_N = calloc(nodes, sizeof *w->good_N);
    if (!w->force || !w->trial || !w->saved || !w->normal_N || !w->saved_N || !w->border ||
        !w->landing || !w->from_border || !w->direction || !w->scratch || !w->krylov || !w->keep ||
        !w->factored || !w->good || !w->good_N) {
        newton_destroy(w);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the Newton iteration");
    }
    *ret = w;
    return ISCHIA_OK;
}

void newton_destroy(struct newton *w)
{
    if (w == NULL) return;
    free(w->force);
    free(w->trial);
    free(w->saved);
    free(w->normal_N);
    free(w->saved_N);
    free(w->border);
    free(w->landing);
    free(w->from_border);
    free(w->direction);
    free(w->scratch);
    free(w->krylov);
    free(w->keep);
    free(w->factored);
    free(w->good);
    free(w->good_N);
    free(w);
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

/* Nodes with a contact force leave the system. */
static void keep_without(struct newton *w, const double *normal_N)
{
    memset(w->keep, 1, (size_t)w->n);
    memset(w->landing, 0, sizeof *w->landing * (size_t)w->n);
    for (int n = 0; n < w->body->mesh->node_count; n++)
        if (normal_N[n] > 0) w->keep[w->assembly->equation[n][2]] = 0;
}

/* Energy, elastic gradient and Hessian at u, and friction for the tracked contact forces. */
static void linearise(struct newton *w, const double (*u)[3], double convexity,
                      const struct newton_control *control)
{
    struct body_derivatives d = {.force = w->force, .border = w->border};
    w->elastic_Nmm = body_linearise(w->body, w->assembly, u, convexity, &d);
    w->corner = d.corner;
    w->reaction_N = bone_reaction_N(w);
    find_gradient_normals(w, u);
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

/* x = K^-1 x, bordered under force control; x[n] belongs to d. */
static enum ischia_code bordered_solve(struct newton *w, double *x, struct ischia_error *err)
{
    TRY(linear_solve(w->assembly->linear, 1, x, err));
    if (!w->force_controlled) {
        x[w->n] = 0;
        return ISCHIA_OK;
    }
    x[w->n] = (x[w->n] - dot(w->n, w->border, x)) / w->schur;
    for (int i = 0; i < w->n; i++) x[i] -= x[w->n] * w->from_border[i];
    return ISCHIA_OK;
}

/* The same with a factor that may be of an earlier set of nodes on the seat: equations that joined
 * since are scaled by their diagonal, those that left are zero. */
static enum ischia_code precondition(void *context, double *x, struct ischia_error *err)
{
    struct newton *w = context;
    for (int i = 0; i < w->n; i++)
        if (w->keep[i] && !w->factored[i]) x[i] /= linear_diagonal(w->assembly->linear, i);
    TRY(bordered_solve(w, x, err));
    for (int i = 0; i < w->n; i++)
        if (!w->keep[i]) x[i] = 0;
    return ISCHIA_OK;
}

/* y = the exact tangent times x: K's rows, and mu t dN for the slipping nodes. */
static void apply_exact(void *context, const double *x, double *ret_y)
{
    struct newton *w = context;
    const double dd = w->force_controlled ? x[w->n] : 0;
    linear_multiply(w->assembly->linear, x, ret_y);
    for (int i = 0; i < w->n; i++) ret_y[i] += dd * w->border[i];
    seat_add_normal_change(w->seat, w->assembly, (const double(*)[3])w->trial, ret_y);
    for (int i = 0; i < w->n; i++)
        if (!w->keep[i]) ret_y[i] = 0;
    ret_y[w->n] = w->force_controlled ? dot(w->n, w->border, x) + w->corner * dd : 0;
}

/* ret[n + 1] = right-hand side of the step: minus the gradient, less what landing nodes bring. */
static void load_right_hand_side(struct newton *w, const struct newton_control *control,
                                 double *ret)
{
    linear_multiply(w->assembly->linear, w->landing, w->scratch);
    for (int n = 0; n < w->body->mesh->node_count; n++)
        for (int c = 0; c < 3; c++) {
            const int eq = w->assembly->equation[n][c];
            if (eq >= 0) ret[eq] = w->keep[eq] ? -w->force[n][c] - w->scratch[eq] : 0;
        }
    ret[w->n] = control->force_controlled
                    ? control->force_N - w->reaction_N - dot(w->n, w->border, w->landing)
                    : 0;
}

static double largest_move_mm(const struct newton *w)
{
    double largest = 0;
    for (int i = 0; i < w->n; i++) largest = fmax(largest, fabs(w->direction[i]));
    return largest;
}

/* The same for the exact step: slipping nodes feel the gradient's contact force, which the tangent
 * completes to the model's, instead of the tracked one. */
static void load_exact_right_hand_side(struct newton *w, const struct newton_control *control,
                                       double *ret)
{
    load_right_hand_side(w, control, ret);
    for (int n = 0; n < w->body->mesh->node_count; n++) {
        const int *eq = w->assembly->equation[n];
        double slip[2];
        if (eq[2] < 0 || !seat_slip_direction(w->seat, (const double(*)[3])w->trial, n, slip))
            continue;
        const double change =
            w->seat->friction * (w->force[n][2] + w->scratch[eq[2]] - w->seat->normal_N[n]);
        for (int c = 0; c < 2; c++)
            if (eq[c] >= 0) ret[eq[c]] -= change * slip[c];
    }
}

static void add_landing(struct newton *w)
{
    for (int i = 0; i < w->n; i++) w->direction[i] += w->landing[i];
}

/* Contact forces that the linear model gives after the direction: gradient + K du + border dd. */
static void find_model_normals(struct newton *w)
{
    const double dd = w->force_controlled ? w->direction[w->n] : 0;
    linear_multiply(w->assembly->linear, w->direction, w->scratch);
    for (int n = 0; n < w->body->mesh->node_count; n++) {
        const int eq = w->assembly->equation[n][2];
        w->normal_N[n] = 0;
        if (eq >= 0 && !w->keep[eq])
            w->normal_N[n] = w->force[n][2] + w->scratch[eq] + dd * w->border[eq];
    }
}

/* Lets go of nodes that the seat would have to pull, and lands those that the direction would push
 * through it. Returns how many changed. */
static int change_contact(struct newton *w, const struct equilibrium *state)
{
    const struct mesh *mesh = w->body->mesh;
    int count = 0;
    for (int n = 0; n < mesh->node_count; n++) {
        const int eq = w->assembly->equation[n][2];
        if (!(mesh->node_flags[n] & NODE_ON_SEAT) || eq < 0) continue;
        const double gap = seat_gap_mm(mesh, (const double(*)[3])state->u_mm, n);
        const bool lets_go = !w->keep[eq] && w->normal_N[n] < 0;
        const bool lands = w->keep[eq] && gap + w->direction[eq] < 0;
        if (!lets_go && !lands) continue;
        w->keep[eq] = lets_go;
        w->landing[eq] = lands ? -gap : 0;
        count++;
    }
    return count;
}

/* Factors the tangent and solves for the border; *ret_definite tells whether both gave descent. */
static enum ischia_code factor(struct newton *w, struct newton_report *report, bool *ret_definite,
                               struct ischia_error *err)
{
    enum linear_outcome outcome;
    TRY(linear_factor(w->assembly->linear, w->keep, &outcome, err));
    report->factorisations++;
    memcpy(w->factored, w->keep, (size_t)w->n);
    *ret_definite = outcome == LINEAR_FACTORED;
    if (!*ret_definite) return ISCHIA_OK;
    for (int i = 0; i < w->n; i++) w->from_border[i] = w->keep[i] ? w->border[i] : 0;
    TRY(linear_solve(w->assembly->linear, 1, w->from_border, err));
    w->schur = w->corner - dot(w->n, w->border, w->from_border);
    if (w->force_controlled) *ret_definite = w->schur > 0;
    return ISCHIA_OK;
}

/* Factors at the given rung of the convexity ladder, and raises it until the tangent is positive
 * definite. */
static enum ischia_code factor_definite(struct newton *w, const struct equilibrium *state,
                                        const struct newton_control *control, size_t *rung,
                                        struct newton_report *report, bool *ret_definite,
                                        struct ischia_error *err)
{
    const size_t rungs = sizeof convexity_ladder / sizeof convexity_ladder[0];
    TRY(factor(w, report, ret_definite, err));
    while (!*ret_definite && *rung + 1 < rungs) {
        linearise(w, (const double(*)[3])state->u_mm, convexity_ladder[++*rung], control);
        TRY(factor(w, report, ret_definite, err));
    }
    w->convexified = *rung > 0;
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
        if (mesh->node_flags[n] & NODE_ON_SEAT)
            w->trial[n][2] = fmax(w->trial[n][2], -mesh->X_mm[n][2]);
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
    return elastic_Nmm + seat_energy(w->seat, u) -
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
    const double(*u)[3] = (const double(*)[3])state->u_mm;
    double sum = 0;
    for (int n = 0; n < w->body->mesh->node_count; n++)
        for (int c = 0; c < 3; c++) {
            const int eq = w->assembly->equation[n][c];
            if (eq >= 0 && w->keep[eq]) sum += pow(w->force[n][c], 2);
        }
    if (sqrt(sum) / control->force_N >= relag_share * w->residual) return;
    memcpy(w->seat->normal_N, w->normal_N, node_bytes(w));
    linearise(w, u, 0, control);
    keep_without(w, w->normal_N);
}

static enum ischia_code descent_step(struct newton *w, struct equilibrium *state,
                                     const struct newton_control *control,
                                     struct newton_report *report, struct ischia_error *err)
{
    bool definite;
    size_t rung = 0;
    keep_without(w, w->normal_N);
    relag(w, state, control);
    TRY(factor_definite(w, state, control, &rung, report, &definite, err));
    if (definite) {
        load_right_hand_side(w, control, w->direction);
        TRY(bordered_solve(w, w->direction, err));
    }
    if (!definite)
        report->reason = ISCHIA_DIVERGED_LINEAR;
    else if (!line_search(w, state, control))
        report->reason = ISCHIA_DIVERGED_STEP;
    return ISCHIA_OK;
}

/* A direction of the exact step being found: for the nodes that w->keep leaves on the seat. */
struct direction {
    size_t rung;    /* of the convexity ladder                                          */
    double reached; /* GMRES' residual over the right-hand side                         */
    bool found;     /* definite, solved, and within bounds                              */
    bool fresh;     /* by a factor of the very nodes on the seat, not of an earlier set */
};

/* A tangent that had to be made convex still leads: carried along by it, the pressures and contact
 * forces come right within a few steps, and with them the tangent. */
static enum ischia_code find_direction(struct newton *w, const struct equilibrium *state,
                                       const struct newton_control *control,
                                       struct newton_report *report, struct direction *d,
                                       struct ischia_error *err)
{
    const struct gmres_operator op = {apply_exact, precondition, w};
    d->found = true;
    if (d->fresh) TRY(factor_definite(w, state, control, &d->rung, report, &d->found, err));
    if (!d->found) return ISCHIA_OK;
    load_exact_right_hand_side(w, control, w->direction);
    TRY(gmres(&op, w->n + 1, gmres_tolerance, w->direction, w->krylov, &d->reached, err));
    add_landing(w);
    d->found = d->reached < (d->fresh ? exact_reduction : stale_factor_max) &&
               largest_move_mm(w) < exact_move_max * w->body->mesh->tip_z_mm;
    return ISCHIA_OK;
}

static void keep_good(struct newton *w)
{
    memcpy(w->good, w->direction, sizeof *w->good * (size_t)(w->n + 1));
    memcpy(w->good_N, w->normal_N, node_bytes(w));
}

static void take_good(struct newton *w)
{
    memcpy(w->direction, w->good, sizeof *w->good * (size_t)(w->n + 1));
    memcpy(w->normal_N, w->good_N, node_bytes(w));
}

/*
 * Finds the direction, and finds it anew while it changes which nodes press on the seat: at first
 * with the factor of the nodes before, which GMRES makes good; with a new factor where that fails.
 * The last direction within bounds is taken; *ret_found is false when there is none.
 */
static enum ischia_code exact_direction(struct newton *w, const struct equilibrium *state,
                                        const struct newton_control *control,
                                        struct newton_report *report, bool *ret_found,
                                        struct ischia_error *err)
{
    struct direction d = {.fresh = true};
    *ret_found = false;
    keep_without(w, w->seat->normal_N);
    memcpy(w->trial, state->u_mm, 3 * node_bytes(w));
    for (int round = 0; round < CONTACT_ROUNDS_MAX; round++) {
        TRY(find_direction(w, state, control, report, &d, err));
        if (!d.found && d.fresh) break;
        if (d.found) {
            find_model_normals(w);
            keep_good(w);
            *ret_found = true;
            if (change_contact(w, state) == 0) break;
        }
        d.fresh = !d.found;
    }
    if (*ret_found) take_good(w);
    return ISCHIA_OK;
}

static enum ischia_code exact_step(struct newton *w, struct equilibrium *state, double alpha_max,
                                   const struct newton_control *control,
                                   struct newton_report *report, bool *ret_made,
                                   struct ischia_error *err)
{
    double alpha = 0;
    TRY(exact_direction(w, state, control, report, ret_made, err));
    if (!*ret_made) return ISCHIA_OK;
    *ret_made = move_uninverted(w, state, alpha_max, control, &alpha);
    for (int n = 0; *ret_made && n < w->body->mesh->node_count; n++) {
        double *tracked = &w->seat->normal_N[n];
        *tracked = fmax(0, *tracked + alpha * (w->normal_N[n] - *tracked));
    }
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
    double d_mm;     /* at the best; displacements and contact forces are in saved and saved_N */
};

static void run_save(struct newton *w, const struct equilibrium *state, struct exact_run *run)
{
    memcpy(w->saved, state->u_mm, 3 * node_bytes(w));
    memcpy(w->saved_N, w->seat->normal_N, node_bytes(w));
    run->residual = w->residual;
    run->d_mm = state->d_mm;
    run->idle = 0;
}

static void run_undo(struct newton *w, struct equilibrium *state, struct exact_run *run,
                     const struct newton_control *control)
{
    memcpy(state->u_mm, w->saved, 3 * node_bytes(w));
    memcpy(w->seat->normal_N, w->saved_N, node_bytes(w));
    state->d_mm = run->d_mm;
    const int relapses = run->relapses + 1;
    *run = (struct exact_run){.rest = exact_rest * relapses, .relapses = relapses};
    body_reset_pressure(w->body, (const double(*)[3])state->u_mm);
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
    } else if (++run->idle > exact_idle_max) {
        run_undo(w, state, run, control);
    }
}

static enum ischia_code one_step(struct newton *w, struct equilibrium *state,
                                 const struct newton_control *control, struct exact_run *run,
                                 struct newton_report *report, struct ischia_error *err)
{
    if (run->active) {
        const double alpha_max = run->idle >= exact_damp_after ? exact_damping : 1;
        bool made;
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
        else if (report.iterations++ >= control->iterations_max ||
                 (control->relapses_max > 0 && run.relapses > control->relapses_max))
            report.reason = ISCHIA_DIVERGED_ITERATIONS;
        else
            TRY(one_step(w, state, control, &run, &report, err));
    }
    keep_without(w, w->seat->normal_N);
    *ret_report = report;
    return ISCHIA_OK;
}

void newton_linearise(struct newton *w, const struct equilibrium *state)
{
    const struct newton_control any_scale = {.force_N = 1};
    const double(*u)[3] = (const double(*)[3])state->u_mm;
    w->force_controlled = false;
    body_reset_pressure(w->body, u);
    linearise(w, u, 0, &any_scale);
    keep_without(w, w->seat->normal_N);
}

enum ischia_code newton_tangent(struct newton *w, struct newton_tangent *ret,
                                struct ischia_error *err)
{
    bool definite;
    struct newton_report report = {0};
    TRY(factor(w, &report, &definite, err));
    ret->stiffness_N_mm = definite ? w->schur : 0;
    for (int i = 0; i < w->n; i++) w->direction[i] = w->keep[i] ? -w->from_border[i] : 0;
    linear_multiply(w->assembly->linear, w->direction, w->scratch);
    for (int n = 0; n < w->body->mesh->node_count; n++) {
        const int *eq = w->assembly->equation[n];
        for (int c = 0; c < 3; c++)
            ret->direction[n][c] = eq[c] >= 0               ? w->direction[eq[c]]
                                   : eq[c] == EQUATION_BONE ? -1
                                                            : 0;
        ret->normal_rate_N_mm[n] =
            eq[2] >= 0 && !w->keep[eq[2]] ? w->scratch[eq[2]] + w->border[eq[2]] : 0;
    }
    return ISCHIA_OK;
}
