/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Steps are of displacement, a share of the tissue's height and of what is left of it, because
 * tissue stiffens without end: equal steps of force would begin with a leap. A step that does not
 * converge is undone and halved.
 */
#include "solver/path.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/snap.h"

static const double step_of_height = 0.09;    /* of the unloaded height             */
static const double step_of_remaining = 0.19; /* of the height that is left         */
static const double first_step = 0.01;        /* of the unloaded height             */
static const double step_floor = 1e-4;        /* of the unloaded height: give up    */
static const double after_snap = 1e-3;        /* of the unloaded height, at least   */
/* A step this small that does not converge soon is not too long: the tissue snaps to another fold
 * there, and the way down needs many iterations. */
static const double snap_step = 0.005;
/* Steps on the way need not be exact: their residual passes into the history of friction and into
 * the work only, each a thousandth of it. */
static const double path_tolerance = 1e-3;
static const double final_tolerance = 1e-8;
/* A step that loses a larger share of the work than this, though it converged, has left the branch
 * of equilibria that the path is on: it is undone and halved. */
static const double lost_share_max = 1e-3;
/* How much more force a step may bring than its tangent says. */
static const double stiffening = 1.5;
enum {
    PATH_ITERATIONS_MAX = 30,
    SNAP_ITERATIONS_MAX = 300,
    FINAL_ITERATIONS_MAX = 60,
    TRIES_MAX = 300,
    SNAP_FACTORISATIONS_MAX = 900
};

struct path {
    struct track track;
    struct snap *snap; /* NULL: snaps are not followed */
    const struct path_observer *observer;
    struct path_report *report;
    double target_N; /* of the press that is under way   */
    struct path_effort effort;
    double ceiling_mm; /* of the next step          */
    int tries;         /* steps tried, well or not  */
    bool started;
    bool left;  /* a step was tried that ends at the target */
    bool ended; /* before it left */
    struct {    /* the last step that every larger force needs too, and what goes with it */
        struct track_step step;
        struct path_report report;
        double ceiling_mm;
        int tries;
    } way;
};

void path_destroy(struct path *p)
{
    if (p == NULL) return;
    snap_destroy(p->snap);
    track_step_finish(&p->way.step);
    track_finish(&p->track);
    free(p);
}

static bool watch(void *context, const struct newton_report *report, double force_N)
{
    const struct path *p = context;
    const struct path_observer *o = p->observer;
    return o == NULL || o->on_iteration == NULL ||
           o->on_iteration(o->context, p->report->load_steps + 1, report->iterations, force_N);
}

static double step_mm(const struct path *p, const struct track_point *now)
{
    return now->d_mm - p->track.last.at.d_mm;
}

static bool is_short(const struct path *p, const struct track_point *now)
{
    return step_mm(p, now) <= snap_step * p->track.height_mm;
}

static bool keeps_energy(const struct path *p, const struct track_point *now)
{
    const double scale_Nmm = track_work_scale_Nmm(&p->track, now->work_Nmm);
    return fabs(track_lost_Nmm(&p->track.last.at, now)) <= lost_share_max * scale_Nmm;
}

/* The first step has no work to compare with yet, and a real snap loses energy at any length. */
static bool stays_on_branch(const struct path *p, const struct track_point *now)
{
    return p->report->load_steps == 0 || is_short(p, now) || keeps_energy(p, now);
}

/* Tells of a converged step. */
static enum ischia_code tell(struct path *p, const struct track_point *now,
                             struct ischia_error *err)
{
    p->report->load_steps++;
    p->report->last_force_N = fmax(p->report->last_force_N, now->force_N);
    if (p->observer == NULL || p->observer->on_step == NULL) return ISCHIA_OK;
    return p->observer->on_step(p->observer->context, p->track.state, err);
}

/* --- steps ------------------------------------------------------------------------------------ */

/* A step that is to be tried: the state is predicted already. */
struct step {
    double dd_mm;
    bool final;
};

static double step_ceiling_mm(const struct path *p)
{
    if (p->report->load_steps == 0) return first_step * p->track.height_mm;
    return p->effort.pace * fmin(step_of_height * p->track.height_mm,
                                 step_of_remaining * (p->track.height_mm - p->track.last.at.d_mm));
}

/* By the tangent; under force control when that would reach the target. */
static struct step next_step(struct path *p, double ceiling_mm)
{
    const double missing_N = p->target_N - p->track.last.at.force_N,
                 k = p->track.last.at.stiffness_N_mm;
    struct step step = {.dd_mm = fmin(ceiling_mm, step_ceiling_mm(p))};
    step.final = k > 0 && missing_N <= stiffening * k * step.dd_mm;
    if (step.final) step.dd_mm = fmin(step.dd_mm, missing_N / k);
    track_predict(&p->track, step.dd_mm);
    return step;
}

static enum ischia_code try_step(struct path *p, const struct step *step,
                                 struct newton_report *ret_report, struct ischia_error *err)
{
    const bool snapping = step->dd_mm < snap_step * p->track.height_mm;
    const double predicted_N =
        p->track.last.at.force_N + fmax(p->track.last.at.stiffness_N_mm, 0) * step->dd_mm;
    const struct newton_control on_the_way = {.force_N = track_force_scale_N(predicted_N),
                                              .tolerance = path_tolerance,
                                              .iterations_max = snapping ? SNAP_ITERATIONS_MAX
                                                                         : PATH_ITERATIONS_MAX};
    const struct newton_control final = {.force_controlled = true,
                                         .force_N = p->target_N,
                                         .tolerance = final_tolerance,
                                         .iterations_max = FINAL_ITERATIONS_MAX};
    TRY(newton_minimise(p->track.newton, p->track.state, step->final ? &final : &on_the_way, watch,
                        p, ret_report, err));
    p->report->newton_iterations += ret_report->iterations;
    p->report->factorisations += ret_report->factorisations;
    p->report->reason = ret_report->reason;
    p->report->force_residual = ret_report->residual;
    return ISCHIA_OK;
}

/* Tells that what was told belongs to every larger force too. */
static void tell_of_way(const struct path *p)
{
    if (p->observer != NULL && p->observer->on_leave != NULL)
        p->observer->on_leave(p->observer->context);
}

/* A step that leaves for the target leaves the way of larger forces; where it does not arrive,
 * steps are halved that a larger force would have taken whole. */
static void keep_way(struct path *p, const struct step *step)
{
    if (!step->final || p->left) return;
    p->left = true;
    track_remember(&p->track, &p->way.step);
    p->way.report = *p->report;
    p->way.ceiling_mm = p->ceiling_mm;
    p->way.tries = p->tries;
    tell_of_way(p);
}

/* To where the path was before it left. */
static void take_way(struct path *p)
{
    track_recall(&p->track, &p->way.step);
    *p->report = p->way.report;
    p->ceiling_mm = p->way.ceiling_mm;
    p->tries = p->way.tries;
}

static bool may_go_on(const struct path *p)
{
    return p->tries < TRIES_MAX && p->report->load_steps < PATH_STEPS_MAX &&
           p->report->factorisations < p->effort.factorisations_max &&
           p->ceiling_mm >= step_floor * p->track.height_mm;
}

/* A short step that loses energy although it converged: to be gone again in slow motion. */
static bool is_snap(const struct path *p, const struct step *step, const struct track_point *now)
{
    return p->snap != NULL && !step->final && p->report->load_steps > 0 && is_short(p, now) &&
           !keeps_energy(p, now);
}

/* Goes the step's way again in slow motion. *ret_stuck: without arriving. */
static enum ischia_code follow_snap(struct path *p, const struct step *step, bool *ret_stuck,
                                    struct ischia_error *err)
{
    struct track *t = &p->track;
    struct snap_report snap;
    const double from_mm = t->last.at.d_mm;
    track_restore(t);
    TRY(snap_follow(p->snap, t, step->dd_mm, SNAP_FACTORISATIONS_MAX, watch, p, &snap, err));
    p->report->newton_iterations += snap.newton_iterations;
    p->report->factorisations += snap.factorisations;
    p->ceiling_mm = fmax(2 * (t->last.at.d_mm - from_mm), after_snap * t->height_mm);
    *ret_stuck = !snap.arrived;
    if (!snap.arrived) p->report->reason = ISCHIA_DIVERGED_STEP;
    return snap.arrived ? tell(p, &t->last.at, err) : ISCHIA_OK;
}

enum outcome { STEP_FAILED, STEP_SNAPPED, STEP_STANDS };

/* Tries a step; *ret_now is where it went, when it stands. */
static enum ischia_code weigh_step(struct path *p, const struct step *step,
                                   enum outcome *ret_outcome, struct track_point *ret_now,
                                   struct ischia_error *err)
{
    struct newton_report newton;
    TRY(try_step(p, step, &newton, err));
    *ret_outcome = STEP_FAILED;
    if (newton.reason < 0) return ISCHIA_OK;
    TRY(track_weigh(&p->track, 0, ret_now, err));
    if (is_snap(p, step, ret_now))
        *ret_outcome = STEP_SNAPPED;
    else if (stays_on_branch(p, ret_now))
        *ret_outcome = STEP_STANDS;
    return ISCHIA_OK;
}

static void halve(struct path *p, const struct step *step)
{
    struct track *t = &p->track;
    p->ceiling_mm = fmin(step->dd_mm, t->state->d_mm - t->last.at.d_mm) / 2;
    track_restore(t);
}

/* To the target, or as far as it goes: report->reason. *ret is the last converged step. */
static enum ischia_code follow(struct path *p, struct track_point *ret, struct ischia_error *err)
{
    bool stuck = false; /* in a snap */
    while (!stuck && may_go_on(p)) {
        const struct step step = next_step(p, p->ceiling_mm);
        enum outcome outcome;
        keep_way(p, &step);
        if (!step.final) p->tries++;
        TRY(weigh_step(p, &step, &outcome, ret, err));
        if (outcome == STEP_FAILED) halve(p, &step);
        if (outcome == STEP_SNAPPED) TRY(follow_snap(p, &step, &stuck, err));
        if (outcome != STEP_STANDS) continue;
        TRY(tell(p, ret, err));
        if (step.final) return ISCHIA_OK;
        track_book(&p->track, ret);
        p->ceiling_mm *= 2;
    }
    p->report->reason = p->report->reason < 0 ? p->report->reason : ISCHIA_DIVERGED_STEP;
    p->report->tried = "the load step was halved down to its floor";
    *ret = p->track.last.at;
    return ISCHIA_OK;
}

static enum ischia_code path_init(struct path *p, struct body *body, struct assembly *assembly,
                                  struct seat *seat, const struct path_effort *effort,
                                  struct equilibrium *state, struct ischia_error *err)
{
    *p = (struct path){.effort = *effort, .ceiling_mm = HUGE_VAL};
    TRY(track_init(&p->track, body, assembly, seat, state, err));
    TRY(track_step_init(&p->way.step, p->track.nodes, err));
    return effort->slow_motion ? snap_create(&p->snap, &p->track, err) : ISCHIA_OK;
}

enum ischia_code path_create(struct path **ret, struct body *body, struct assembly *assembly,
                             struct seat *seat, const struct path_effort *effort,
                             struct equilibrium *state, struct ischia_error *err)
{
    struct path *p = calloc(1, sizeof *p);
    CHECK(p != NULL, err, ISCHIA_E_MEMORY, "not enough memory for the load path");
    const enum ischia_code code = path_init(p, body, assembly, seat, effort, state, err);
    if (code == ISCHIA_OK)
        *ret = p;
    else
        path_destroy(p);
    return code;
}

bool path_serves(const struct path *p, double force_N)
{
    return !p->started || force_N >= p->target_N;
}

/* At rest, or where every larger force goes on. */
static enum ischia_code begin(struct path *p, struct ischia_error *err)
{
    p->left = false;
    if (p->started) {
        take_way(p);
        return ISCHIA_OK;
    }
    p->started = true;
    *p->report = (struct path_report){.reason = ISCHIA_NOT_STARTED, .tried = ""};
    return track_start(&p->track, err);
}

/* Every larger force ends here too. */
static void end_on_way(struct path *p)
{
    p->ended = true;
    p->way.report = *p->report;
    tell_of_way(p);
}

static enum ischia_code go(struct path *p, struct ischia_error *err)
{
    const struct track_point rest = {0};
    struct track_point end = {0};
    TRY(begin(p, err));
    TRY(follow(p, &end, err));
    p->report->energy_residual = track_lost_Nmm(&rest, &end) / end.work_Nmm;
    p->report->released = end.drag_Nmm / end.work_Nmm;
    if (!p->left) end_on_way(p);
    return ISCHIA_OK;
}

enum ischia_code path_press(struct path *p, double force_N, const struct path_observer *observer,
                            struct path_report *ret_report, struct ischia_error *err)
{
    struct path_report report = p->way.report;
    assert(path_serves(p, force_N));
    p->observer = observer;
    p->report = &report;
    p->target_N = force_N;
    if (!p->ended) TRY(go(p, err));
    report.last_force_N = fmin(report.last_force_N, force_N);
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
