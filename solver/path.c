/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Steps are of displacement, a share of the tissue's height and of what is left of it, because
 * tissue stiffens without end: equal steps of force would begin with a leap. A step that does not
 * converge is undone and halved. The work of the seat is the integral of F dd by the corrected
 * trapezium (Hermite cubic) rule, which uses the stiffness at the steps and is of fourth order.
 *
 * A coarser mesh's path, where there is one, leads: its steps are longer, and predict better than
 * the tangent does. The work is then the coarser mesh's plus the integral of what the forces of the
 * two meshes differ by, which is small and smooth enough for the longer steps.
 */
#include "solver/path.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double step_of_height = 0.055;   /* of the unloaded height             */
static const double step_of_remaining = 0.12; /* of the height that is left         */
static const double first_step = 0.01;        /* of the unloaded height             */
static const double step_floor = 1e-4;        /* of the unloaded height: give up    */
/* A step this small that does not converge soon is not too long: the tissue snaps to another fold
 * there, and the way down needs many iterations. */
static const double snap_step = 0.005;
/* Steps on the way need not be exact: their residual passes into the history of friction and into
 * the work only, each a thousandth of it. */
static const double path_tolerance = 1e-3;
static const double final_tolerance = 1e-8;
/* How much more force a step may bring than its tangent says. */
static const double stiffening = 1.5;
enum {
    PATH_ITERATIONS_MAX = 30,
    SNAP_ITERATIONS_MAX = 300,
    FINAL_ITERATIONS_MAX = 60,
    GUIDED_RELAPSES_MAX = 1, /* a guided step that is hard is better made in smaller steps */
    LOAD_STEPS_MAX = 100,
    TRIES_MAX = 200
};

struct path {
    struct body *body;
    struct assembly *assembly;
    struct seat *seat;
    struct newton *newton;
    const struct path_observer *observer;
    struct equilibrium *state;
    struct path_report *report;
    struct path_point last;        /* the last converged step                     */
    double (*u_mm)[3];             /* [node] displacements there                  */
    struct newton_tangent tangent; /* there                                */
    double *normal_N;              /* [node] contact forces there                 */
    struct guide_cursor cursor;
    double height_mm;
    double target_N;
    double friction_Nmm;
    int nodes;
};

static void path_finish(struct path *p)
{
    newton_destroy(p->newton);
    guide_cursor_finish(&p->cursor);
    free(p->u_mm);
    free(p->tangent.direction);
    free(p->tangent.normal_rate_N_mm);
    free(p->normal_N);
}

static enum ischia_code path_init(struct path *p, const struct guide *guide,
                                  struct ischia_error *err)
{
    const size_t nodes = (size_t)p->nodes;
    p->u_mm = calloc(nodes, sizeof *p->u_mm);
    p->tangent.direction = calloc(nodes, sizeof *p->tangent.direction);
    p->tangent.normal_rate_N_mm = calloc(nodes, sizeof *p->tangent.normal_rate_N_mm);
    p->normal_N = calloc(nodes, sizeof *p->normal_N);
    CHECK(p->u_mm && p->tangent.direction && p->tangent.normal_rate_N_mm && p->normal_N, err,
          ISCHIA_E_MEMORY, "not enough memory for the load path");
    TRY(guide_cursor_init(&p->cursor, guide, p->nodes, err));
    return newton_create(&p->newton, p->body, p->assembly, p->seat, err);
}

static bool watch(void *context, const struct newton_report *report, double force_N)
{
    const struct path *p = context;
    const struct path_observer *o = p->observer;
    return o == NULL || o->on_iteration == NULL ||
           o->on_iteration(o->context, p->report->load_steps + 1, report->iterations, force_N);
}

static void stop_at_seat(struct path *p, int n)
{
    const struct mesh *mesh = p->body->mesh;
    double *z = &p->state->u_mm[n][2];
    if (mesh->node_flags[n] & NODE_ON_SEAT) *z = fmax(*z, -mesh->X_mm[n][2]);
}

static bool uninverted(const struct path *p)
{
    return body_det_F_min(p->body, (const double(*)[3])p->state->u_mm) > 0;
}

/* Moves to state = last + dd * direction, as far as det F stays positive. */
static void predict(struct path *p, double dd)
{
    for (double share = 1; share > 1e-3; share /= 2) {
        for (int n = 0; n < p->nodes; n++) {
            for (int c = 0; c < 3; c++)
                p->state->u_mm[n][c] = p->u_mm[n][c] + share * dd * p->tangent.direction[n][c];
            stop_at_seat(p, n);
        }
        p->state->d_mm = p->last.d_mm + share * dd;
        for (int n = 0; n < p->nodes; n++)
            p->seat->normal_N[n] =
                fmax(0, p->normal_N[n] + share * dd * p->tangent.normal_rate_N_mm[n]);
        if (uninverted(p)) break;
    }
    body_track_pressure(p->body, 1, (const double(*)[3])p->u_mm,
                        (const double(*)[3])p->state->u_mm);
}

/* Contact force at a node after the guide's change: none where the node is off the seat. */
static double guided_normal_N(const struct path *p, int n)
{
    const double change = p->cursor.ahead.pressure[n][0] - p->cursor.here.pressure[n][0];
    if (seat_gap_mm(p->body->mesh, (const double(*)[3])p->state->u_mm, n) > 0) return 0;
    return fmax(0, p->normal_N[n] + change * p->seat->stick_stiffness_N_mm[n]);
}

static void guide_pressures(struct path *p)
{
    const struct mesh *mesh = p->body->mesh;
    const double(*here)[3] = (const double(*)[3])p->cursor.here.pressure;
    const double(*ahead)[3] = (const double(*)[3])p->cursor.ahead.pressure;
    for (int e = 0; e < mesh->element_count; e++)
        for (int k = 0; k < HEX_NODES; k++) {
            const int n = mesh->hex[e][k];
            p->body->pressure_MPa[e] += (ahead[n][1] - here[n][1]) / HEX_NODES;
        }
}

/* Moves to state = last + the guide's change up to its point ahead; false when that inverts. */
static bool predict_guided(struct path *p)
{
    const struct guide_cursor *cursor = &p->cursor;
    guide_look_ahead(&p->cursor, p->body->mesh);
    for (int n = 0; n < p->nodes; n++) {
        for (int c = 0; c < 3; c++)
            p->state->u_mm[n][c] =
                p->u_mm[n][c] + cursor->ahead.u_mm[n][c] - cursor->here.u_mm[n][c];
        stop_at_seat(p, n);
        p->seat->normal_N[n] = guided_normal_N(p, n);
    }
    p->state->d_mm = guide_next_mm(cursor);
    guide_pressures(p);
    return uninverted(p);
}

/* Back to the last converged step, the tangent's volumes included. */
static void restore(struct path *p)
{
    const size_t nodes = (size_t)p->nodes;
    memcpy(p->state->u_mm, p->u_mm, sizeof *p->u_mm * nodes);
    memcpy(p->seat->normal_N, p->normal_N, sizeof *p->normal_N * nodes);
    p->state->d_mm = p->last.d_mm;
    p->state->force_N = p->last.force_N;
    newton_linearise(p->newton, p->state);
}

/* Work of the step from the last point to `now`: the guide's, and the Hermite rule for the rest. */
static double work_of_step(const struct path *p, const struct path_point *now)
{
    const struct guide_load before = guide_load_at(p->cursor.guide, p->last.d_mm);
    const struct guide_load after = guide_load_at(p->cursor.guide, now->d_mm);
    const double step = now->d_mm - p->last.d_mm;
    const double force_before = p->last.force_N - before.force_N;
    const double force_after = now->force_N - after.force_N;
    const double stiffness_before = p->last.stiffness_N_mm - before.stiffness_N_mm;
    const double stiffness_after = now->stiffness_N_mm - after.stiffness_N_mm;
    return after.work_Nmm - before.work_Nmm + step * (force_before + force_after) / 2 +
           step * step / 12 * (stiffness_before - stiffness_after);
}

/* Books a converged step: work, friction, and the tangent for the next. */
static enum ischia_code book(struct path *p, struct ischia_error *err)
{
    struct path_point now = {.d_mm = p->state->d_mm, .force_N = p->state->force_N};
    TRY(newton_tangent(p->newton, &p->tangent, err));
    now.stiffness_N_mm = p->tangent.stiffness_N_mm;
    now.work_Nmm = p->last.work_Nmm + work_of_step(p, &now);
    p->friction_Nmm += seat_advance(p->seat, (const double(*)[3])p->state->u_mm, p->normal_N);
    p->last = now;
    memcpy(p->u_mm, p->state->u_mm, sizeof *p->u_mm * (size_t)p->nodes);
    memcpy(p->normal_N, p->seat->normal_N, sizeof *p->normal_N * (size_t)p->nodes);
    p->report->load_steps++;
    p->report->last_force_N = fmax(p->report->last_force_N, fmin(now.force_N, p->target_N));
    if (p->observer == NULL || p->observer->on_step == NULL) return ISCHIA_OK;
    return p->observer->on_step(p->observer->context, p->state, &now, err);
}

/* The state of rest: no force, but a tangent. */
static enum ischia_code start(struct path *p, struct ischia_error *err)
{
    memcpy(p->normal_N, p->seat->normal_N, sizeof *p->normal_N * (size_t)p->nodes);
    newton_linearise(p->newton, p->state);
    TRY(newton_tangent(p->newton, &p->tangent, err));
    p->last.stiffness_N_mm = p->tangent.stiffness_N_mm;
    return ISCHIA_OK;
}

/* --- steps ------------------------------------------------------------------------------------ */

/* A step that is to be tried: the state is predicted already. */
struct step {
    double dd_mm;
    bool guided, final;
};

static double step_ceiling_mm(const struct path *p)
{
    if (p->report->load_steps == 0) return first_step * p->height_mm;
    return fmin(step_of_height * p->height_mm, step_of_remaining * (p->height_mm - p->last.d_mm));
}

/* By the tangent, and no further than the guide's point ahead; under force control when that would
 * reach the target. */
static struct step own_step(struct path *p, double ceiling_mm)
{
    const double missing_N = p->target_N - p->last.force_N, k = p->last.stiffness_N_mm;
    struct step step = {.dd_mm = fmin(ceiling_mm, step_ceiling_mm(p))};
    step.dd_mm = fmin(step.dd_mm, guide_next_mm(&p->cursor) - p->last.d_mm);
    step.final = k > 0 && missing_N <= stiffening * k * step.dd_mm;
    if (step.final) step.dd_mm = fmin(step.dd_mm, missing_N / k);
    predict(p, step.dd_mm);
    return step;
}

/* By the guide while the path is on it (at its last point or at rest); else by the tangent. */
static struct step next_step(struct path *p, bool on_guide, double ceiling_mm)
{
    if (on_guide && predict_guided(p))
        return (struct step){.dd_mm = p->state->d_mm - p->last.d_mm,
                             .guided = true,
                             .final = guide_is_last(&p->cursor)};
    if (on_guide) restore(p);
    return own_step(p, ceiling_mm);
}

static enum ischia_code try_step(struct path *p, const struct step *step,
                                 struct newton_report *ret_report, struct ischia_error *err)
{
    const bool snapping = step->dd_mm < snap_step * p->height_mm;
    const int relapses_max = step->guided ? GUIDED_RELAPSES_MAX : 0;
    const struct newton_control on_the_way = {
        .force_N = p->last.force_N + fmax(p->last.stiffness_N_mm, 0) * step->dd_mm,
        .tolerance = path_tolerance,
        .iterations_max = snapping ? SNAP_ITERATIONS_MAX : PATH_ITERATIONS_MAX,
        .relapses_max = relapses_max};
    const struct newton_control final = {.force_controlled = true,
                                         .force_N = p->target_N,
                                         .tolerance = final_tolerance,
                                         .iterations_max = FINAL_ITERATIONS_MAX,
                                         .relapses_max = relapses_max};
    TRY(newton_minimise(p->newton, p->state, step->final ? &final : &on_the_way, watch, p,
                        ret_report, err));
    p->report->newton_iterations += ret_report->iterations;
    p->report->factorisations += ret_report->factorisations;
    p->report->reason = ret_report->reason;
    p->report->force_residual = ret_report->residual;
    return ISCHIA_OK;
}

/* A tangent step that comes this close to the guide's point has reached it. */
static bool reached_guide(const struct path *p)
{
    return fabs(guide_next_mm(&p->cursor) - p->last.d_mm) <= 1e-9 * p->height_mm;
}

static enum ischia_code follow(struct path *p, struct ischia_error *err)
{
    double ceiling_mm = HUGE_VAL;
    bool on_guide = guide_next_mm(&p->cursor) < HUGE_VAL;
    TRY(start(p, err));
    for (int tries = 0; tries < TRIES_MAX && p->report->load_steps < LOAD_STEPS_MAX; tries++) {
        struct newton_report newton;
        const struct step step = next_step(p, on_guide, ceiling_mm);
        TRY(try_step(p, &step, &newton, err));
        if (newton.reason > 0) {
            TRY(book(p, err));
            if (step.final) return ISCHIA_OK;
            on_guide = reached_guide(p);
            if (on_guide) guide_advance(&p->cursor);
            on_guide = on_guide && guide_next_mm(&p->cursor) < HUGE_VAL;
            ceiling_mm *= 2;
            continue;
        }
        on_guide = false;
        if (!step.guided) ceiling_mm = fmin(step.dd_mm, p->state->d_mm - p->last.d_mm) / 2;
        if (!(ceiling_mm >= step_floor * p->height_mm)) break;
        restore(p);
    }
    p->report->reason = p->report->reason < 0 ? p->report->reason : ISCHIA_DIVERGED_STEP;
    p->report->tried = "the load step was halved down to its floor";
    restore(p);
    return ISCHIA_OK;
}

enum ischia_code path_follow(struct body *body, struct assembly *assembly, struct seat *seat,
                             double force_N, const struct guide *guide,
                             const struct path_observer *observer, struct equilibrium *state,
                             struct path_report *ret_report, struct ischia_error *err)
{
    struct path_report report = {.reason = ISCHIA_NOT_STARTED, .tried = ""};
    struct path p = {.body = body,
                     .assembly = assembly,
                     .seat = seat,
                     .observer = observer,
                     .state = state,
                     .report = &report,
                     .height_mm = body->mesh->tip_z_mm,
                     .target_N = force_N,
                     .nodes = body->mesh->node_count};
    enum ischia_code code = path_init(&p, guide, err);
    if (code == ISCHIA_OK) code = follow(&p, err);
    if (code == ISCHIA_OK) {
        const double stored =
            state->elastic_Nmm + seat_energy(seat, (const double(*)[3])state->u_mm);
        report.energy_residual = (p.last.work_Nmm - stored - p.friction_Nmm) / p.last.work_Nmm;
        *ret_report = report;
    }
    path_finish(&p);
    return code;
}
