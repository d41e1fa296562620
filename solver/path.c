/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Steps are of displacement, a share of the tissue's height and of what is left of it, because
 * tissue stiffens without end: equal steps of force would begin with a leap. A step that does not
 * converge is undone and halved. The work of the seat is the integral of F dd by the corrected
 * trapezium (Hermite cubic) rule, which uses the stiffness at the steps and is of fourth order.
 */
#include "solver/path.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double step_of_height = 0.08;    /* of the unloaded height             */
static const double step_of_remaining = 0.18; /* of the height that is left         */
static const double first_step = 0.01;        /* of the unloaded height             */
static const double step_floor = 1e-4;        /* of the unloaded height: give up    */
/* A step this small that does not converge soon is not too long: the tissue snaps to another fold
 * there, and the way down needs many iterations. */
static const double snap_step = 0.005;
static const double path_tolerance = 1e-5;
static const double final_tolerance = 1e-8;
/* How much more force a step may bring than its tangent says. */
static const double stiffening = 1.5;
static const double residual_scale_floor = 0.02; /* of the target force: scale near rest */
enum {
    PATH_ITERATIONS_MAX = 30,
    SNAP_ITERATIONS_MAX = 300,
    FINAL_ITERATIONS_MAX = 60,
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
    double height_mm;
    double target_N;
    double work_Nmm;
    double friction_Nmm;
    int nodes;
};

static void path_finish(struct path *p)
{
    newton_destroy(p->newton);
    free(p->u_mm);
    free(p->tangent.direction);
    free(p->tangent.normal_rate_N_mm);
    free(p->normal_N);
}

static enum ischia_code path_init(struct path *p, struct ischia_error *err)
{
    const size_t nodes = (size_t)p->nodes;
    p->u_mm = calloc(nodes, sizeof *p->u_mm);
    p->tangent.direction = calloc(nodes, sizeof *p->tangent.direction);
    p->tangent.normal_rate_N_mm = calloc(nodes, sizeof *p->tangent.normal_rate_N_mm);
    p->normal_N = calloc(nodes, sizeof *p->normal_N);
    CHECK(p->u_mm && p->tangent.direction && p->tangent.normal_rate_N_mm && p->normal_N, err,
          ISCHIA_E_MEMORY, "not enough memory for the load path");
    return newton_create(&p->newton, p->body, p->assembly, p->seat, err);
}

static bool watch(void *context, const struct newton_report *report, double force_N)
{
    const struct path *p = context;
    const struct path_observer *o = p->observer;
    return o == NULL || o->on_iteration == NULL ||
           o->on_iteration(o->context, p->report->load_steps + 1, report->iterations, force_N);
}

/* Moves to state = last + dd * direction, as far as det F stays positive. */
static void predict(struct path *p, double dd)
{
    const struct mesh *mesh = p->body->mesh;
    for (double share = 1; share > 1e-3; share /= 2) {
        for (int n = 0; n < p->nodes; n++) {
            for (int c = 0; c < 3; c++)
                p->state->u_mm[n][c] = p->u_mm[n][c] + share * dd * p->tangent.direction[n][c];
            if (mesh->node_flags[n] & NODE_ON_SEAT)
                p->state->u_mm[n][2] = fmax(p->state->u_mm[n][2], -mesh->X_mm[n][2]);
        }
        p->state->d_mm = p->last.d_mm + share * dd;
        for (int n = 0; n < p->nodes; n++)
            p->seat->normal_N[n] =
                fmax(0, p->normal_N[n] + share * dd * p->tangent.normal_rate_N_mm[n]);
        if (body_det_F_min(p->body, (const double(*)[3])p->state->u_mm) > 0) break;
    }
    body_track_pressure(p->body, 1, (const double(*)[3])p->u_mm,
                        (const double(*)[3])p->state->u_mm);
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

/* Books a converged step: work, friction, and the tangent for the next. */
static enum ischia_code book(struct path *p, struct ischia_error *err)
{
    struct path_point now = {p->state->d_mm, p->state->force_N, 0};
    const double step = now.d_mm - p->last.d_mm;
    TRY(newton_tangent(p->newton, &p->tangent, err));
    now.stiffness_N_mm = p->tangent.stiffness_N_mm;
    p->work_Nmm += step * (p->last.force_N + now.force_N) / 2 +
                   step * step / 12 * (p->last.stiffness_N_mm - now.stiffness_N_mm);
    p->friction_Nmm += seat_advance(p->seat, (const double(*)[3])p->state->u_mm, p->normal_N);
    p->last = now;
    memcpy(p->u_mm, p->state->u_mm, sizeof *p->u_mm * (size_t)p->nodes);
    memcpy(p->normal_N, p->seat->normal_N, sizeof *p->normal_N * (size_t)p->nodes);
    p->report->load_steps++;
    p->report->last_force_N = fmax(p->report->last_force_N, fmin(now.force_N, p->target_N));
    if (p->observer == NULL || p->observer->on_step == NULL) return ISCHIA_OK;
    return p->observer->on_step(p->observer->context, p->state, err);
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

/* One step of at most dd, under force control when that would reach the target. */
static enum ischia_code try_step(struct path *p, double dd, bool *ret_final,
                                 struct newton_report *ret_report, struct ischia_error *err)
{
    const double missing_N = p->target_N - p->last.force_N;
    const double k = p->last.stiffness_N_mm;
    struct newton_control control = {
        .force_N = fmax(p->last.force_N, residual_scale_floor * p->target_N),
        .tolerance = path_tolerance,
        .iterations_max =
            dd < snap_step * p->height_mm ? SNAP_ITERATIONS_MAX : PATH_ITERATIONS_MAX};
    *ret_final = k > 0 && missing_N <= stiffening * k * dd;
    if (*ret_final) {
        control = (struct newton_control){.force_controlled = true,
                                          .force_N = p->target_N,
                                          .tolerance = final_tolerance,
                                          .iterations_max = FINAL_ITERATIONS_MAX};
        dd = fmin(dd, missing_N / k);
    }
    predict(p, dd);
    TRY(newton_minimise(p->newton, p->state, &control, watch, p, ret_report, err));
    p->report->newton_iterations += ret_report->iterations;
    p->report->factorisations += ret_report->factorisations;
    return ISCHIA_OK;
}

static double step_ceiling_mm(const struct path *p)
{
    if (p->report->load_steps == 0) return first_step * p->height_mm;
    return fmin(step_of_height * p->height_mm, step_of_remaining * (p->height_mm - p->last.d_mm));
}

static enum ischia_code follow(struct path *p, struct ischia_error *err)
{
    double ceiling = HUGE_VAL;
    bool final = false;
    TRY(start(p, err));
    for (int tries = 0; tries < TRIES_MAX && p->report->load_steps < LOAD_STEPS_MAX; tries++) {
        struct newton_report newton;
        const double dd = fmin(ceiling, step_ceiling_mm(p));
        TRY(try_step(p, dd, &final, &newton, err));
        p->report->reason = newton.reason;
        p->report->force_residual = newton.residual;
        if (newton.reason > 0) {
            TRY(book(p, err));
            if (final) return ISCHIA_OK;
            ceiling *= 2;
            continue;
        }
        ceiling = fmin(dd, p->state->d_mm - p->last.d_mm) / 2;
        if (!(ceiling >= step_floor * p->height_mm)) break;
        restore(p);
    }
    p->report->reason = p->report->reason < 0 ? p->report->reason : ISCHIA_DIVERGED_STEP;
    p->report->tried = "the load step was halved down to its floor";
    restore(p);
    return ISCHIA_OK;
}

enum ischia_code path_follow(struct body *body, struct assembly *assembly, struct seat *seat,
                             double force_N, const struct path_observer *observer,
                             struct equilibrium *state, struct path_report *ret_report,
                             struct ischia_error *err)
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
    enum ischia_code code = path_init(&p, err);
    if (code == ISCHIA_OK) code = follow(&p, err);
    if (code == ISCHIA_OK) {
        const double stored =
            state->elastic_Nmm + seat_energy(seat, (const double(*)[3])state->u_mm);
        report.energy_residual = (p.work_Nmm - stored - p.friction_Nmm) / p.work_Nmm;
        *ret_report = report;
    }
    path_finish(&p);
    return code;
}
