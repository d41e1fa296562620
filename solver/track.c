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

static bool allocate(struct track *t)
{
    const size_t nodes = (size_t)t->nodes;
    t->u_mm = calloc(nodes, sizeof *t->u_mm);
    t->normal_N = calloc(nodes, sizeof *t->normal_N);
    t->anchor_mm = calloc(nodes, sizeof *t->anchor_mm);
    const bool tangents =
        tangent_allocate(&t->tangent, nodes) && tangent_allocate(&t->ahead, nodes);
    return t->u_mm && t->normal_N && t->anchor_mm && tangents;
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
    enum ischia_code code;
    if (allocate(&t))
        code = newton_create(&t.newton, body, assembly, seat, err);
    else
        code = FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the load path");
    if (code == ISCHIA_OK)
        *ret = t;
    else
        track_finish(&t);
    return code;
}

void track_finish(struct track *t)
{
    newton_destroy(t->newton);
    free(t->u_mm);
    free(t->normal_N);
    free(t->anchor_mm);
    tangent_free(&t->tangent);
    tangent_free(&t->ahead);
    *t = (struct track){0};
}

enum ischia_code track_start(struct track *t, struct ischia_error *err)
{
    memcpy(t->normal_N, t->seat->normal_N, sizeof *t->normal_N * (size_t)t->nodes);
    memcpy(t->anchor_mm, t->seat->anchor_mm, sizeof *t->anchor_mm * (size_t)t->nodes);
    newton_linearise(t->newton, t->state);
    TRY(newton_tangent(t->newton, t->state, &t->tangent, err));
    t->last.stiffness_N_mm = t->tangent.stiffness_N_mm;
    return ISCHIA_OK;
}

bool track_is_uninverted(const struct track *t)
{
    return body_det_F_min(t->body, (const double(*)[3])t->state->u_mm) > 0;
}

void track_predict(struct track *t, double dd)
{
    for (double share = 1; share > 1e-3; share /= 2) {
        for (int n = 0; n < t->nodes; n++) {
            for (int c = 0; c < 3; c++)
                t->state->u_mm[n][c] = t->u_mm[n][c] + share * dd * t->tangent.direction[n][c];
            if (t->body->mesh->node_flags[n] & NODE_ON_SEAT)
                seat_stop(t->body->mesh, n, t->state->u_mm[n]);
        }
        t->state->d_mm = t->last.d_mm + share * dd;
        for (int n = 0; n < t->nodes; n++)
            t->seat->normal_N[n] =
                fmax(0, t->normal_N[n] + share * dd * t->tangent.normal_rate_N_mm[n]);
        if (track_is_uninverted(t)) break;
    }
    body_track_pressure(t->body, 1, (const double(*)[3])t->u_mm,
                        (const double(*)[3])t->state->u_mm);
}

void track_restore(struct track *t)
{
    const size_t nodes = (size_t)t->nodes;
    memcpy(t->state->u_mm, t->u_mm, sizeof *t->u_mm * nodes);
    memcpy(t->seat->normal_N, t->normal_N, sizeof *t->normal_N * nodes);
    memcpy(t->seat->anchor_mm, t->anchor_mm, sizeof *t->anchor_mm * nodes);
    t->state->d_mm = t->last.d_mm;
    t->state->force_N = t->last.force_N;
    newton_linearise(t->newton, t->state);
}

/* --- memory ----------------------------------------------------------------------------------- */

enum ischia_code track_memory_init(struct track_memory *ret, const struct track *t,
                                   struct ischia_error *err)
{
    const size_t nodes = (size_t)t->nodes;
    struct track_memory m = {.u_mm = calloc(nodes, sizeof *m.u_mm),
                             .normal_N = calloc(nodes, sizeof *m.normal_N),
                             .anchor_mm = calloc(nodes, sizeof *m.anchor_mm)};
    const bool tangents = tangent_allocate(&m.tangent, nodes) && tangent_allocate(&m.ahead, nodes);
    if (!m.u_mm || !m.normal_N || !m.anchor_mm || !tangents) {
        track_memory_finish(&m);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for a load step");
    }
    *ret = m;
    return ISCHIA_OK;
}

void track_memory_finish(struct track_memory *m)
{
    free(m->u_mm);
    free(m->normal_N);
    free(m->anchor_mm);
    tangent_free(&m->tangent);
    tangent_free(&m->ahead);
    *m = (struct track_memory){0};
}

void track_remember(const struct track *t, struct track_memory *m)
{
    const size_t nodes = (size_t)t->nodes;
    m->last = t->last;
    memcpy(m->u_mm, t->u_mm, sizeof *t->u_mm * nodes);
    memcpy(m->normal_N, t->normal_N, sizeof *t->normal_N * nodes);
    memcpy(m->anchor_mm, t->anchor_mm, sizeof *t->anchor_mm * nodes);
    tangent_copy(&m->tangent, &t->tangent, nodes);
    tangent_copy(&m->ahead, &t->ahead, nodes);
}

void track_recall(struct track *t, const struct track_memory *m)
{
    const size_t nodes = (size_t)t->nodes;
    t->last = m->last;
    memcpy(t->u_mm, m->u_mm, sizeof *t->u_mm * nodes);
    memcpy(t->normal_N, m->normal_N, sizeof *t->normal_N * nodes);
    memcpy(t->anchor_mm, m->anchor_mm, sizeof *t->anchor_mm * nodes);
    tangent_copy(&t->tangent, &m->tangent, nodes);
    tangent_copy(&t->ahead, &m->ahead, nodes);
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
    now.work_Nmm = t->last.work_Nmm + trapezium_Nmm(&t->last, &now);
    now.drag_Nmm = t->last.drag_Nmm + drag_Nmm;
    now.friction_Nmm = t->last.friction_Nmm + seat_advance(t->seat, u, t->normal_N);
    now.stored_Nmm = t->state->elastic_Nmm + seat_energy(t->seat, u);
    *ret = now;
}

enum ischia_code track_weigh(struct track *t, double drag_Nmm, struct track_point *ret,
                             struct ischia_error *err)
{
    TRY(newton_tangent(t->newton, t->state, &t->ahead, err));
    track_weigh_slow(t, drag_Nmm, ret);
    ret->stiffness_N_mm = t->ahead.stiffness_N_mm;
    ret->work_Nmm =
        t->last.work_Nmm + (trapezium_Nmm(&t->last, ret) + correction_Nmm(&t->last, ret));
    return ISCHIA_OK;
}

double track_lost_Nmm(const struct track_point *from, const struct track_point *to)
{
    return to->work_Nmm - from->work_Nmm - (to->stored_Nmm - from->stored_Nmm) -
           (to->friction_Nmm - from->friction_Nmm) - (to->drag_Nmm - from->drag_Nmm);
}

void track_book_slow(struct track *t, const struct track_point *now)
{
    const size_t nodes = (size_t)t->nodes;
    t->last = *now;
    memcpy(t->u_mm, t->state->u_mm, sizeof *t->u_mm * nodes);
    memcpy(t->normal_N, t->seat->normal_N, sizeof *t->normal_N * nodes);
    memcpy(t->anchor_mm, t->seat->anchor_mm, sizeof *t->anchor_mm * nodes);
}

void track_book(struct track *t, const struct track_point *now)
{
    const struct newton_tangent before = t->tangent;
    t->tangent = t->ahead;
    t->ahead = before;
    track_book_slow(t, now);
}
