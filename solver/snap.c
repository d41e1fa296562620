/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/snap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Stiffness of the springs over c: of the first step in time, and below which it is left out. */
static const double stiffness_first = 51200;
static const double stiffness_last = 4;
static const double stiffness_most = 1e9;
/* By how much it grows after a step that failed, and falls after one that did well, or fairly. */
static const double stiffen = 4;
static const double soften_well = 4, soften_fairly = 2;
enum { ITERATIONS_WELL = 4, ITERATIONS_FAIRLY = 7, ITERATIONS_MAX = 10, STEPS_MAX = 300 };
/* While moves grow from step to step the tissue is falling: steps must not be longer then, and are
 * shortened when moves grow by more than this. */
static const double growth_max = 3;
/* Springs stay stiffer than twice those that failed for so many steps. */
static const double floor_over_failed = 1.9;
enum { FLOOR_STEPS = 6 };
/* Work that a step does against drag, below which the equilibrium is near: try without. */
static const double faint_drag = 3e-6;
enum { FREE_REST = 6 };
/* A step may lose no larger share of the work than this besides. */
static const double lost_share_max = 2e-4;
/* Residuals, over the force: of a step in time, and of the equilibrium as on any load step. */
static const double slow_tolerance = 1e-4;
static const double free_tolerance = 1e-3;
/* A first move that fails is halved down to this, over the tissue's height. */
static const double move_floor = 1e-5;

struct snap {
    int nodes;
    double *c_N_mm;      /* [node] see snap.h, with the height's square in it   */
    double *spring_N_mm; /* [node] of the present step                          */
    double (*rate)[3];   /* [node] move times stiffness, of the last step       */
    double (*now)[3];    /* [node] of the step that is being weighed            */
};

/* One snap. */
struct slow {
    struct snap *snap;
    struct track *track;
    double stiffness; /* over c */
    double dd_mm;
    bool moved;    /* the bone has been */
    bool has_rate; /* and a step in time was made since */
    double growth; /* of the rate in the last step */
    double drag;   /* work of the last step, over all work */
    double floor;  /* of the stiffness, for so many steps */
    int floor_steps;
    int free_rest; /* steps before the next one without drag */
    bool cautious; /* the step before failed */
};

void snap_destroy(struct snap *s)
{
    if (s == NULL) return;
    free(s->c_N_mm);
    free(s->spring_N_mm);
    free(s->rate);
    free(s->now);
    free(s);
}

enum ischia_code snap_create(struct snap **ret, const struct track *t, struct ischia_error *err)
{
    const size_t nodes = (size_t)t->nodes;
    struct snap *s = calloc(1, sizeof *s);
    CHECK(s != NULL, err, ISCHIA_E_MEMORY, "not enough memory for slow motion");
    s->nodes = t->nodes;
    s->c_N_mm = calloc(nodes, sizeof *s->c_N_mm);
    s->spring_N_mm = calloc(nodes, sizeof *s->spring_N_mm);
    s->rate = calloc(nodes, sizeof *s->rate);
    s->now = calloc(nodes, sizeof *s->now);
    if (!s->c_N_mm || !s->spring_N_mm || !s->rate || !s->now) {
        snap_destroy(s);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for slow motion");
    }
    body_shear_of_nodes(t->body, s->c_N_mm);
    for (int n = 0; n < s->nodes; n++) s->c_N_mm[n] /= t->height_mm * t->height_mm;
    *ret = s;
    return ISCHIA_OK;
}

/* --- one step in time ------------------------------------------------------------------------- */

static bool is_free(const struct track *t, int n, int c)
{
    return t->assembly->equation[n][c] >= 0;
}

/* From the last step by a share of the rate. */
static void move_by_rate(const struct slow *w, double share)
{
    struct track *t = w->track;
    for (int n = 0; n < t->nodes; n++) {
        for (int c = 0; c < 3; c++)
            t->state->u_mm[n][c] = t->last.u_mm[n][c] + share * w->snap->rate[n][c] / w->stiffness;
        if (t->body->mesh->node_flags[n] & NODE_ON_SEAT)
            seat_stop(t->body->mesh, n, t->state->u_mm[n]);
    }
}

/* Goes on as the last step went, as far as det F stays positive. */
static void predict(const struct slow *w)
{
    struct track *t = w->track;
    double share = fmin(1, w->growth);
    for (; share > 0.01; share /= 2) {
        move_by_rate(w, share);
        if (track_is_uninverted(t)) break;
    }
    if (share <= 0.01)
        memcpy(t->state->u_mm, t->last.u_mm, sizeof *t->last.u_mm * (size_t)t->nodes);
    body_track_pressure(t->body, 1, (const double(*)[3])t->last.u_mm,
                        (const double(*)[3])t->state->u_mm);
}

static bool may_be_free(const struct slow *w)
{
    const bool faint = w->has_rate && w->growth < 1 && w->drag < faint_drag && w->free_rest <= 0;
    return w->moved && (w->stiffness < stiffness_last || faint);
}

static enum ischia_code minimise(struct slow *w, bool free, newton_observe *observe, void *context,
                                 struct newton_report *ret, struct ischia_error *err)
{
    struct track *t = w->track;
    const struct newton_drag drag = {w->snap->spring_N_mm, (const double(*)[3])t->last.u_mm};
    const struct newton_control control = {.force_N = track_force_scale_N(t->last.at.force_N),
                                           .tolerance = free ? free_tolerance : slow_tolerance,
                                           .iterations_max = ITERATIONS_MAX,
                                           .drag = free ? NULL : &drag};
    for (int n = 0; n < t->nodes; n++) w->snap->spring_N_mm[n] = w->stiffness * w->snap->c_N_mm[n];
    if (!w->moved)
        track_predict(t, w->dd_mm);
    else if (!free && w->has_rate)
        predict(w);
    return newton_minimise(t->newton, t->state, &control, observe, context, ret, err);
}

/* The rate of the step that has converged, and its work against drag, by the trapezium rule. */
static double find_rate(struct slow *w, bool free)
{
    struct snap *s = w->snap;
    const struct track *t = w->track;
    double work = 0;
    for (int n = 0; n < s->nodes; n++)
        for (int c = 0; c < 3; c++) {
            const double move = t->state->u_mm[n][c] - t->last.u_mm[n][c];
            if (!is_free(t, n, c)) continue;
            s->now[n][c] = free ? 0 : w->stiffness * move;
            work += s->c_N_mm[n] * (s->rate[n][c] + s->now[n][c]) / 2 * move;
        }
    return work;
}

static enum ischia_code weigh(struct slow *w, bool free, struct track_point *ret,
                              struct ischia_error *err)
{
    const double drag_Nmm = find_rate(w, free);
    if (free) return track_weigh(w->track, drag_Nmm, ret, err);
    track_weigh_slow(w->track, drag_Nmm, ret);
    return ISCHIA_OK;
}

static double share_of_work(const struct slow *w, double energy_Nmm)
{
    return fabs(energy_Nmm) / track_work_scale_Nmm(w->track, w->track->last.at.work_Nmm);
}

static double rate_norm(const struct snap *s, const double (*rate)[3])
{
    double sum = 0;
    for (int n = 0; n < s->nodes; n++)
        for (int c = 0; c < 3; c++) sum += s->c_N_mm[n] * rate[n][c] * rate[n][c];
    return sqrt(sum);
}

/* The length of the next step in time, by how this one went. */
static void adapt(struct slow *w, int iterations)
{
    if (w->growth >= growth_max)
        w->stiffness *= 2;
    else if (w->growth < 1 && iterations <= ITERATIONS_WELL && !w->cautious)
        w->stiffness /= soften_well;
    else if (w->growth < 1 && iterations <= ITERATIONS_FAIRLY)
        w->stiffness /= soften_fairly;
    if (w->floor_steps-- > 0) w->stiffness = fmax(w->stiffness, w->floor);
    w->cautious = false;
    w->free_rest--;
}

/* Books a step with drag. The rate of the first has the bone's move in it: nothing to go on by. */
static void go_on(struct slow *w, const struct track_point *now, int iterations)
{
    struct snap *s = w->snap;
    double(*const before)[3] = s->rate;
    const double norm = rate_norm(s, (const double(*)[3])before);
    w->drag = share_of_work(w, now->drag_Nmm - w->track->last.at.drag_Nmm);
    w->growth = w->has_rate ? rate_norm(s, (const double(*)[3])s->now) / norm : 0;
    track_book_slow(w->track, now);
    s->rate = s->now;
    s->now = before;
    w->has_rate = w->moved;
    w->moved = true;
    adapt(w, iterations);
}

/* Back from a step that failed; false when there is nothing left to try. */
static bool go_back(struct slow *w, bool free)
{
    track_restore(w->track);
    if (free && w->stiffness >= stiffness_last) {
        w->free_rest = FREE_REST;
        return true;
    }
    w->floor = floor_over_failed * w->stiffness;
    w->floor_steps = FLOOR_STEPS;
    w->stiffness *= stiffen;
    w->cautious = true;
    if (!w->moved) w->dd_mm /= 2;
    return w->stiffness < stiffness_most && w->dd_mm >= move_floor * w->track->height_mm;
}

/* *ret_over: arrived, or nothing left to try. */
static enum ischia_code one_step(struct slow *w, newton_observe *observe, void *context,
                                 struct snap_report *report, bool *ret_over,
                                 struct ischia_error *err)
{
    const bool free = may_be_free(w);
    struct newton_report newton;
    struct track_point now = {0};
    bool stands = false;
    TRY(minimise(w, free, observe, context, &newton, err));
    report->newton_iterations += newton.iterations;
    report->factorisations += newton.factorisations;
    if (newton.reason > 0) {
        TRY(weigh(w, free, &now, err));
        stands = share_of_work(w, track_lost_Nmm(&w->track->last.at, &now)) <= lost_share_max;
    }
    if (!stands) {
        *ret_over = !go_back(w, free);
        return ISCHIA_OK;
    }
    *ret_over = report->arrived = free;
    if (free)
        track_book(w->track, &now);
    else
        go_on(w, &now, newton.iterations);
    return ISCHIA_OK;
}

enum ischia_code snap_follow(struct snap *s, struct track *t, double dd_mm, int factorisations_max,
                             newton_observe *observe, void *context, struct snap_report *ret,
                             struct ischia_error *err)
{
    struct slow w = {.snap = s, .track = t, .stiffness = stiffness_first, .dd_mm = dd_mm};
    struct snap_report report = {0};
    bool over = false;
    memset(s->rate, 0, sizeof *s->rate * (size_t)s->nodes);
    memset(s->now, 0, sizeof *s->now * (size_t)s->nodes);
    for (int k = 0; !over && k < STEPS_MAX && report.factorisations < factorisations_max; k++)
        TRY(one_step(&w, observe, context, &report, &over, err));
    *ret = report;
    return ISCHIA_OK;
}
