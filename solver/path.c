/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Steps are of displacement, a share of the tissue's height and of what is left of it, because
 * tissue stiffens without end: equal steps of force would begin with a leap. A step that does not
 * converge is undone and halved. The work of the seat is the integral of F dd by the corrected
 * trapezium (Hermite cubic) rule, which uses the stiffness at the steps and is of fourth order.
 */
#include "solver/path.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double step_of_height = 0.09;    /* of the unloaded height             */
static const double step_of_remaining = 0.19; /* of the height that is left         */
static const double first_step = 0.01;        /* of the unloaded height             */
static const double step_floor = 1e-4;        /* of the unloaded height: give up    */
/* A step this small that does not converge soon is not too long: the tissue snaps to another fold
 * there, and the way down needs many iterations. */
static const double snap_step = 0.005;
/* Steps on the way need not be exact: their residual passes into the history of friction and into
 * the work only, each a thousandth of it. */
static const double path_tolerance = 1e-3;
static const double final_tolerance = 1e-8;
/* While there is hardly any force or work yet, errors are compared with a tenth of the force that a
 * quarter of a side carries in sitting, and with a hundredth of that over the tissue's height; but
 * never with more than so many times what there is. */
static const double small_force_N = 7.5;
static const double small_work_N = 0.75;
static const double small_most = 20;
/* A step that loses a larger share of the work than this, though it converged, has left the branch
 * of equilibria that the path is on: it is undone and halved. */
static const double lost_share_max = 1e-3;
/* How much more force a step may bring than its tangent says. */
static const double stiffening = 1.5;
enum {
    PATH_ITERATIONS_MAX = 30,
    SNAP_ITERATIONS_MAX = 300,
    FINAL_ITERATIONS_MAX = 60,
    LOAD_STEPS_MAX = 150,
    TRIES_MAX = 300
};

/* A converged step. */
struct path_point {
    double d_mm;
    double force_N;        /* quarter model */
    double stiffness_N_mm; /* dF/dd         */
    double work_Nmm;       /* of the seat   */
    double stored_Nmm;     /* elastic energy, and that of the sticking springs */
    double friction_Nmm;   /* dissipated     */
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
    struct newton_tangent tangent; /* there                                       */
    double *normal_N;              /* [node] contact forces there                 */
    double (*anchor_mm)[2];        /* [node] of the friction springs there        */
    struct newton_tangent ahead;   /* the tangent of a step that is being weighed */
    double height_mm;
    double target_N; /* of the press that is under way   */
    struct path_effort effort;
    int nodes;
    double ceiling_mm;           /* of the next step                                       */
    int tries;                   /* steps tried, well or not                               */
    struct path_report on_way;   /* of the steps that every larger force needs too         */
    bool started, serves_larger; /* last, tangent, ceiling and on_way are such a step's    */
};

void path_destroy(struct path *p)
{
    if (p == NULL) return;
    newton_destroy(p->newton);
    free(p->u_mm);
    free(p->tangent.direction);
    free(p->tangent.normal_rate_N_mm);
    free(p->normal_N);
    free(p->anchor_mm);
    free(p->ahead.direction);
    free(p->ahead.normal_rate_N_mm);
    free(p);
}

static enum ischia_code path_init(struct path *p, struct ischia_error *err)
{
    const size_t nodes = (size_t)p->nodes;
    p->u_mm = calloc(nodes, sizeof *p->u_mm);
    p->tangent.direction = calloc(nodes, sizeof *p->tangent.direction);
    p->tangent.normal_rate_N_mm = calloc(nodes, sizeof *p->tangent.normal_rate_N_mm);
    p->normal_N = calloc(nodes, sizeof *p->normal_N);
    p->anchor_mm = calloc(nodes, sizeof *p->anchor_mm);
    p->ahead.direction = calloc(nodes, sizeof *p->ahead.direction);
    p->ahead.normal_rate_N_mm = calloc(nodes, sizeof *p->ahead.normal_rate_N_mm);
    CHECK(p->u_mm && p->tangent.direction && p->tangent.normal_rate_N_mm && p->normal_N &&
              p->anchor_mm && p->ahead.direction && p->ahead.normal_rate_N_mm,
          err, ISCHIA_E_MEMORY, "not enough memory for the load path");
    return newton_create(&p->newton, p->body, p->assembly, p->seat, err);
}

static bool watch(void *context, const struct newton_report *report, double force_N)
{
    const struct path *p = context;
    const struct path_observer *o = p->observer;
    return o == NULL || o->on_iteration == NULL ||
           o->on_iteration(o->context, p->report->load_steps + 1, report->iterations, force_N);
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
            if (p->body->mesh->node_flags[n] & NODE_ON_SEAT)
                seat_stop(p->body->mesh, n, p->state->u_mm[n]);
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

/* Back to the last converged step, the tangent's volumes included. */
static void restore(struct path *p)
{
    const size_t nodes = (size_t)p->nodes;
    memcpy(p->state->u_mm, p->u_mm, sizeof *p->u_mm * nodes);
    memcpy(p->seat->normal_N, p->normal_N, sizeof *p->normal_N * nodes);
    memcpy(p->seat->anchor_mm, p->anchor_mm, sizeof *p->anchor_mm * nodes);
    p->state->d_mm = p->last.d_mm;
    p->state->force_N = p->last.force_N;
    newton_linearise(p->newton, p->state);
}

/* What an error is compared with where there is `now`, and `small` of the final. */
static double error_scale(double now, double small)
{
    return fmax(now, fmin(small, small_most * now));
}

/* Work of the step from the last point to `now`. */
static double work_of_step(const struct path_point *last, const struct path_point *now)
{
    const double step = now->d_mm - last->d_mm;
    return step * (last->force_N + now->force_N) / 2 +
           step * step / 12 * (last->stiffness_N_mm - now->stiffness_N_mm);
}

/* Ends a converged step on the seat, and finds its work and its tangent, which is for the next. */
static enum ischia_code weigh(struct path *p, struct path_point *ret, struct ischia_error *err)
{
    const double(*u)[3] = (const double(*)[3])p->state->u_mm;
    struct path_point now = {.d_mm = p->state->d_mm, .force_N = p->state->force_N};
    TRY(newton_tangent(p->newton, p->state, &p->ahead, err));
    now.stiffness_N_mm = p->ahead.stiffness_N_mm;
    now.work_Nmm = p->last.work_Nmm + work_of_step(&p->last, &now);
    now.friction_Nmm = p->last.friction_Nmm + seat_advance(p->seat, u, p->normal_N);
    now.stored_Nmm = p->state->elastic_Nmm + seat_energy(p->seat, u);
    *ret = now;
    return ISCHIA_OK;
}

/* Work of a step that is neither stored nor dissipated by friction. */
static double lost_Nmm(const struct path_point *last, const struct path_point *now)
{
    return now->work_Nmm - last->work_Nmm - (now->stored_Nmm - last->stored_Nmm) -
           (now->friction_Nmm - last->friction_Nmm);
}

/* The first step has no work to compare with yet, and a real snap loses energy at any length. */
static bool stays_on_branch(const struct path *p, const struct path_point *now)
{
    const double scale_Nmm = error_scale(now->work_Nmm, small_work_N * p->height_mm);
    return p->report->load_steps == 0 || now->d_mm - p->last.d_mm <= snap_step * p->height_mm ||
           fabs(lost_Nmm(&p->last, now)) <= lost_share_max * scale_Nmm;
}

/* Tells of a converged step. */
static enum ischia_code tell(struct path *p, const struct path_point *now, struct ischia_error *err)
{
    p->report->load_steps++;
    p->report->last_force_N = fmax(p->report->last_force_N, fmin(now->force_N, p->target_N));
    if (p->observer == NULL || p->observer->on_step == NULL) return ISCHIA_OK;
    return p->observer->on_step(p->observer->context, p->state, err);
}

/* Goes on from a converged step. */
static void book(struct path *p, const struct path_point *now)
{
    const size_t nodes = (size_t)p->nodes;
    const struct newton_tangent before = p->tangent;
    p->last = *now;
    p->tangent = p->ahead;
    p->ahead = before;
    memcpy(p->u_mm, p->state->u_mm, sizeof *p->u_mm * nodes);
    memcpy(p->normal_N, p->seat->normal_N, sizeof *p->normal_N * nodes);
    memcpy(p->anchor_mm, p->seat->anchor_mm, sizeof *p->anchor_mm * nodes);
}

/* The state of rest: no force, but a tangent. */
static enum ischia_code start(struct path *p, struct ischia_error *err)
{
    memcpy(p->normal_N, p->seat->normal_N, sizeof *p->normal_N * (size_t)p->nodes);
    memcpy(p->anchor_mm, p->seat->anchor_mm, sizeof *p->anchor_mm * (size_t)p->nodes);
    newton_linearise(p->newton, p->state);
    TRY(newton_tangent(p->newton, p->state, &p->tangent, err));
    p->last.stiffness_N_mm = p->tangent.stiffness_N_mm;
    p->started = true;
    return ISCHIA_OK;
}

/* --- steps ------------------------------------------------------------------------------------ */

/* A step that is to be tried: the state is predicted already. */
struct step {
    double dd_mm;
    bool final;
};

static double step_ceiling_mm(const struct path *p)
{
    if (p->report->load_steps == 0) return first_step * p->height_mm;
    return p->effort.pace *
           fmin(step_of_height * p->height_mm, step_of_remaining * (p->height_mm - p->last.d_mm));
}

/* By the tangent; under force control when that would reach the target. */
static struct step next_step(struct path *p, double ceiling_mm)
{
    const double missing_N = p->target_N - p->last.force_N, k = p->last.stiffness_N_mm;
    struct step step = {.dd_mm = fmin(ceiling_mm, step_ceiling_mm(p))};
    step.final = k > 0 && missing_N <= stiffening * k * step.dd_mm;
    if (step.final) step.dd_mm = fmin(step.dd_mm, missing_N / k);
    predict(p, step.dd_mm);
    return step;
}

static enum ischia_code try_step(struct path *p, const struct step *step,
                                 struct newton_report *ret_report, struct ischia_error *err)
{
    const bool snapping = step->dd_mm < snap_step * p->height_mm;
    const double predicted_N = p->last.force_N + fmax(p->last.stiffness_N_mm, 0) * step->dd_mm;
    const struct newton_control on_the_way = {.force_N = error_scale(predicted_N, small_force_N),
                                              .tolerance = path_tolerance,
                                              .iterations_max = snapping ? SNAP_ITERATIONS_MAX
                                                                         : PATH_ITERATIONS_MAX};
    const struct newton_control final = {.force_controlled = true,
                                         .force_N = p->target_N,
                                         .tolerance = final_tolerance,
                                         .iterations_max = FINAL_ITERATIONS_MAX};
    TRY(newton_minimise(p->newton, p->state, step->final ? &final : &on_the_way, watch, p,
                        ret_report, err));
    p->report->newton_iterations += ret_report->iterations;
    p->report->factorisations += ret_report->factorisations;
    p->report->reason = ret_report->reason;
    p->report->force_residual = ret_report->residual;
    return ISCHIA_OK;
}

/* A step that leaves for the target leaves the way of larger forces; where it does not arrive,
 * steps are halved that a larger force would have taken whole. */
static void keep_way(struct path *p, const struct step *step, bool first)
{
    if (!step->final) return;
    p->serves_larger = first;
    if (first) p->on_way = *p->report;
}

static bool may_go_on(const struct path *p)
{
    return p->tries < TRIES_MAX && p->report->load_steps < LOAD_STEPS_MAX &&
           p->report->factorisations < p->effort.factorisations_max &&
           p->ceiling_mm >= step_floor * p->height_mm;
}

/* To the target, or as far as it goes: report->reason. *ret is the last converged step. */
static enum ischia_code follow(struct path *p, struct path_point *ret, struct ischia_error *err)
{
    bool left = false; /* a step has left for the target before */
    while (may_go_on(p)) {
        struct newton_report newton;
        const struct step step = next_step(p, p->ceiling_mm);
        keep_way(p, &step, !left);
        left = left || step.final;
        if (!step.final) p->tries++;
        TRY(try_step(p, &step, &newton, err));
        if (newton.reason > 0) TRY(weigh(p, ret, err));
        if (newton.reason > 0 && stays_on_branch(p, ret)) {
            TRY(tell(p, ret, err));
            if (step.final) return ISCHIA_OK;
            book(p, ret);
            p->ceiling_mm *= 2;
            continue;
        }
        p->ceiling_mm = fmin(step.dd_mm, p->state->d_mm - p->last.d_mm) / 2;
        restore(p);
    }
    p->report->reason = p->report->reason < 0 ? p->report->reason : ISCHIA_DIVERGED_STEP;
    p->report->tried = "the load step was halved down to its floor";
    p->serves_larger = false;
    *ret = p->last;
    return ISCHIA_OK;
}

enum ischia_code path_create(struct path **ret, struct body *body, struct assembly *assembly,
                             struct seat *seat, const struct path_effort *effort,
                             struct equilibrium *state, struct ischia_error *err)
{
    struct path *p = calloc(1, sizeof *p);
    CHECK(p != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the load path");
    *p = (struct path){.body = body,
                       .assembly = assembly,
                       .seat = seat,
                       .state = state,
                       .height_mm = body->mesh->tip_z_mm,
                       .effort = *effort,
                       .nodes = body->mesh->node_count,
                       .ceiling_mm = HUGE_VAL,
                       .on_way = {.reason = ISCHIA_NOT_STARTED, .tried = ""}};
    const enum ischia_code code = path_init(p, err);
    if (code == ISCHIA_OK)
        *ret = p;
    else
        path_destroy(p);
    return code;
}

bool path_serves(const struct path *p, double force_N)
{
    return !p->started || (p->serves_larger && force_N >= p->target_N);
}

enum ischia_code path_press(struct path *p, double force_N, const struct path_observer *observer,
                            struct path_report *ret_report, struct ischia_error *err)
{
    struct path_report report = p->on_way;
    const struct path_point rest = {0};
    struct path_point end = {0};
    assert(path_serves(p, force_N));
    p->observer = observer;
    p->report = &report;
    p->target_N = force_N;
    if (p->started)
        restore(p);
    else
        TRY(start(p, err));
    TRY(follow(p, &end, err));
    report.energy_residual = lost_Nmm(&rest, &end) / end.work_Nmm;
    *ret_report = report;
    return ISCHIA_OK;
}

enum ischia_code path_follow(struct body *body, struct assembly *assembly, struct seat *seat,
                             double force_N, const struct path_effort *effort,
                             const struct path_observer *observer, struct equilibrium *state,
                             struct path_report *ret_report, struct ischia_error *err)
{
    struct path *p = NULL;
    TRY(path_create(&p, body, assembly, seat, effort, state, err));
    const enum ischia_code code = path_press(p, force_N, observer, ret_report, err);
    path_destroy(p);
    return code;
}
