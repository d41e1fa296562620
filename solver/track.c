/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/track.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* While there is hardly any force or work yet, errors are compared with a tenth of the force that a
 * quarter of a side carries in sitting, and with a hundredth of that over the tissue's height; but
 * never with more than so many times what there is. */
static const double small_force_N = 7.5;
static const double small_work_N = 0.75;
static const double small_most = 20;

/* --- tangents --------------------------------------------------------------------------------- */

static bool tangent_allocate(struct newton_tangent *tangent, size_t nodes)
{
    tangent->direction = calloc(nodes, sizeof *tangent->direction);
    tangent->normal_rate_N_mm = calloc(nodes, sizeof *tangent->normal_rate_N_mm);
    return tangent->direction != NULL && tangent->normal_rate_N_mm != NULL;
}

static void tangent_free(struct newton_tangent *tangent)
{
    free(tangent->direction);
    free(tangent->normal_rate_N_mm);
}

static void tangent_copy(struct newton_tangent *to, const struct newton_tangent *from, size_t nodes)
{
    to->stiffness_N_mm = from->stiffness_N_mm;
    memcpy(to->direction, from->direction, sizeof *to->direction * nodes);
    memcpy(to->normal_rate_N_mm, from->normal_rate_N_mm, sizeof *to->normal_rate_N_mm * nodes);
}

/* --- steps ------------------------------------------------------------------------------------ */

enum ischia_code track_step_init(struct track_step *ret, int node_count, struct ischia_error *err)
{
    const size_t nodes = (size_t)node_count;
    struct track_step s = {.u_mm = calloc(nodes, sizeof *s.u_mm),
                           .normal_N = calloc(nodes, sizeof *s.normal_N),
                           .anchor_mm = calloc(nodes, sizeof *s.anchor_mm)};
    const bool tangents = tangent_allocate(&s.tangent, nodes) && tangent_allocate(&s.ahead, nodes);
    if (!s.u_mm || !s.normal_N || !s.anchor_mm || !tangents) {
        track_step_finish(&s);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for a load step");
    }
    *ret = s;
    return ISCHIA_OK;
}

void track_step_finish(struct track_step *s)
{
    free(s->u_mm);
    free(s->normal_N);
    free(s->anchor_mm);
    tangent_free(&s->tangent);
    tangent_free(&s->ahead);
    *s = (struct track_step){0};
}

static void step_copy(struct track_step *to, const struct track_step *from, size_t nodes)
{
    to->at = from->at;
    memcpy(to->u_mm, from->u_mm, sizeof *to->u_mm * nodes);
    memcpy(to->normal_N, from->normal_N, sizeof *to->normal_N * nodes);
    memcpy(to->anchor_mm, from->anchor_mm, sizeof *to->anchor_mm * nodes);
    tangent_copy(&to->tangent, &from->tangent, nodes);
    tangent_copy(&to->ahead, &from->ahead, nodes);
}

/* --- tracks ----------------------------------------------------------------------------------- */

static enum ischia_code init(struct track *t, struct ischia_error *err)
{
    TRY(track_step_init(&t->last, t->nodes, err));
    return newton_create(&t->newton, t->body, t->assembly, t->seat, err);
}

enum ischia_code track_init(struct track *ret, struct body *body, struct assembly *assembly,
                            struct seat *seat, struct equilibrium *state, struct ischia_error *err)
{
    struct track t = {.body = body,
                      .assembly = assembly,
                      .seat = seat,
                      .state = state,
                      .height_mm = body->mesh->tip_z_mm,
                      .nodes = body->mesh->node_count};
    const enum ischia_code code = init(&t, err);
    if (code == ISCHIA_OK)
        *ret = t;
    else
        track_finish(&t);
    return code;
}

void track_finish(struct track *t)
{
    newton_destroy(t->newton);
    track_step_finish(&t->last);
    *t = (struct track){0};
}

static void keep_contact(struct track *t)
{
    const size_t nodes = (size_t)t->nodes;
    memcpy(t->last.normal_N, t->seat->normal_N, sizeof *t->last.normal_N * nodes);
    memcpy(t->last.anchor_mm, t->seat->anchor_mm, sizeof *t->last.anchor_mm * nodes);
}

enum ischia_code track_start(struct track *t, struct ischia_error *err)
{
    keep_contact(t);
    newton_linearise(t->newton, t->state);
    TRY(newton_tangent(t->newton, t->state, &t->last.tangent, err));
    t->last.at.stiffness_N_mm = t->last.tangent.stiffness_N_mm;
    return ISCHIA_OK;
}

bool track_is_uninverted(const struct track *t)
{
    return body_det_F_min(t->body, (const double(*)[3])t->state->u_mm) > 0;
}

void track_predict(struct track *t, double dd)
{
    const struct track_step *last = &t->last;
    for (double share = 1; share > 1e-3; share /= 2) {
        for (int n = 0; n < t->nodes; n++) {
            for (int c = 0; c < 3; c++)
                t->state->u_mm[n][c] =
                    last->u_mm[n][c] + share * dd * last->tangent.direction[n][c];
            if (t->body->mesh->node_flags[n] & NODE_ON_SEAT)
                seat_stop(t->body->mesh, n, t->state->u_mm[n]);
        }
        t->state->d_mm = last->at.d_mm + share * dd;
        for (int n = 0; n < t->nodes; n++)
            t->seat->normal_N[n] =
                fmax(0, last->normal_N[n] + share * dd * last->tangent.normal_rate_N_mm[n]);
        if (track_is_uninverted(t)) break;
    }
    body_track_pressure(t->body, 1, (const double(*)[3])last->u_mm,
                        (const double(*)[3])t->state->u_mm);
}

void track_restore(struct track *t)
{
    const struct track_step *last = &t->last;
    const size_t nodes = (size_t)t->nodes;
    memcpy(t->state->u_mm, last->u_mm, sizeof *last->u_mm * nodes);
    memcpy(t->seat->normal_N, last->normal_N, sizeof *last->normal_N * nodes);
    memcpy(t->seat->anchor_mm, last->anchor_mm, sizeof *last->anchor_mm * nodes);
    t->state->d_mm = last->at.d_mm;
    t->state->force_N = last->at.force_N;
    newton_linearise(t->newton, t->state);
}

void track_remember(const struct track *t, struct track_step *ret)
{
    step_copy(ret, &t->last, (size_t)t->nodes);
}

void track_recall(struct track *t, const struct track_step *step)
{
    step_copy(&t->last, step, (size_t)t->nodes);
    track_restore(t);
}

/* --- scales ----------------------------------------------------------------------------------- */

static double error_scale(double now, double small)
{
    return fmax(now, fmin(small, small_most * now));
}

double track_force_scale_N(double now_N) { return error_scale(now_N, small_force_N); }

double track_work_scale_Nmm(const struct track *t, double now_Nmm)
{
    return error_scale(now_Nmm, small_work_N * t->height_mm);
}

/* --- energies --------------------------------------------------------------------------------- */

static double trapezium_Nmm(const struct track_point *last, const struct track_point *now)
{
    return (now->d_mm - last->d_mm) * (last->force_N + now->force_N) / 2;
}

static double correction_Nmm(const struct track_point *last, const struct track_point *now)
{
    const double step = now->d_mm - last->d_mm;
    return step * step / 12 * (last->stiffness_N_mm - now->stiffness_N_mm);
}

void track_weigh_slow(struct track *t, double drag_Nmm, struct track_point *ret)
{
    const double(*u)[3] = (const double(*)[3])t->state->u_mm;
    struct track_point now = {.d_mm = t->state->d_mm, .force_N = t->state->force_N};
    now.work_Nmm = t->last.at.work_Nmm + trapezium_Nmm(&t->last.at, &now);
    now.drag_Nmm = t->last.at.drag_Nmm + drag_Nmm;
    now.friction_Nmm = t->last.at.friction_Nmm + seat_advance(t->seat, u, t->last.normal_N);
    now.stored_Nmm = t->state->elastic_Nmm + seat_energy(t->seat, u);
    *ret = now;
}

enum ischia_code track_weigh(struct track *t, double drag_Nmm, struct track_point *ret,
                             struct ischia_error *err)
{
    TRY(newton_tangent(t->newton, t->state, &t->last.ahead, err));
    track_weigh_slow(t, drag_Nmm, ret);
    ret->stiffness_N_mm = t->last.ahead.stiffness_N_mm;
    ret->work_Nmm =
        t->last.at.work_Nmm + (trapezium_Nmm(&t->last.at, ret) + correction_Nmm(&t->last.at, ret));
    return ISCHIA_OK;
}

double track_lost_Nmm(const struct track_point *from, const struct track_point *to)
{
    return to->work_Nmm - from->work_Nmm - (to->stored_Nmm - from->stored_Nmm) -
           (to->friction_Nmm - from->friction_Nmm) - (to->drag_Nmm - from->drag_Nmm);
}

void track_book_slow(struct track *t, const struct track_point *now)
{
    t->last.at = *now;
    memcpy(t->last.u_mm, t->state->u_mm, sizeof *t->last.u_mm * (size_t)t->nodes);
    keep_contact(t);
}

void track_book(struct track *t, const struct track_point *now)
{
    const struct newton_tangent before = t->last.tangent;
    t->last.tangent = t->last.ahead;
    t->last.ahead = before;
    track_book_slow(t, now);
}
