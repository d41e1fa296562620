/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/guide.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- recording -------------------------------------------------------------------------------- */

static void point_finish(struct guide_point *p)
{
    free(p->u_mm);
    free(p->pressure);
}

void guide_finish(struct guide *guide)
{
    for (int k = 0; k < guide->count; k++) point_finish(&guide->point[k]);
    free(guide->point);
    *guide = (struct guide){0};
}

static bool reserve(struct guide *guide)
{
    if (guide->count < guide->capacity) return true;
    const int capacity = guide->capacity * 2 + 16;
    struct guide_point *point = realloc(guide->point, (size_t)capacity * sizeof *point);
    if (point == NULL) return false;
    guide->point = point;
    guide->capacity = capacity;
    return true;
}

/* pressure[node][1] = mean over the elements that meet in the node. */
static void average_pressure(const struct body *body, double (*pressure)[3])
{
    const struct mesh *mesh = body->mesh;
    for (int e = 0; e < mesh->element_count; e++)
        for (int k = 0; k < HEX_NODES; k++) {
            pressure[mesh->hex[e][k]][1] += body->pressure_MPa[e];
            pressure[mesh->hex[e][k]][2] += 1;
        }
    for (int n = 0; n < mesh->node_count; n++) {
        pressure[n][1] /= pressure[n][2];
        pressure[n][2] = 0;
    }
}

enum ischia_code guide_record(struct guide *guide, const struct guide_point *numbers,
                              const struct body *body, const struct seat *seat,
                              const double (*u)[3], struct ischia_error *err)
{
    const size_t nodes = (size_t)body->mesh->node_count;
    struct guide_point p = *numbers;
    const bool reserved = reserve(guide);
    p.u_mm = malloc(nodes * sizeof *p.u_mm);
    p.pressure = calloc(nodes, sizeof *p.pressure);
    if (!reserved || p.u_mm == NULL || p.pressure == NULL) {
        point_finish(&p);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the path of the coarser mesh");
    }
    guide->divisions = body->mesh->divisions;
    memcpy(p.u_mm, u, nodes * sizeof *p.u_mm);
    for (size_t n = 0; n < nodes; n++)
        if (seat->stick_stiffness_N_mm[n] > 0)
            p.pressure[n][0] = seat->normal_N[n] / seat->stick_stiffness_N_mm[n];
    average_pressure(body, p.pressure);
    guide->point[guide->count++] = p;
    return ISCHIA_OK;
}

/* --- the load curve --------------------------------------------------------------------------- */

/* The cubic through both ends with their slopes: value, slope and integral from a at the share t of
 * the step; the integral is corrected by the share t of what the guide's own work has beside it. */
static struct guide_load between(const struct guide_point *a, const struct guide_point *b, double t)
{
    const double s = b->d_mm - a->d_mm, fa = a->force_N, fb = b->force_N;
    const double ka = s * a->stiffness_N_mm, kb = s * b->stiffness_N_mm;
    const double c2 = 3 * (fb - fa) - 2 * ka - kb, c3 = 2 * (fa - fb) + ka + kb;
    const double whole = s * (fa + ka / 2 + c2 / 3 + c3 / 4);
    return (struct guide_load){.force_N = fa + t * (ka + t * (c2 + t * c3)),
                               .stiffness_N_mm = (ka + t * (2 * c2 + t * 3 * c3)) / s,
                               .work_Nmm = a->work_Nmm +
                                           s * t * (fa + t * (ka / 2 + t * (c2 / 3 + t * c3 / 4))) +
                                           t * (b->work_Nmm - a->work_Nmm - whole)};
}

struct guide_load guide_load_at(const struct guide *guide, double d_mm)
{
    if (guide == NULL || guide->count == 0) return (struct guide_load){0};
    const struct guide_point rest = {.stiffness_N_mm =
                                         guide->point[0].force_N / guide->point[0].d_mm};
    const struct guide_point *a = &rest;
    for (int k = 0; k < guide->count; a = &guide->point[k++]) {
        const struct guide_point *b = &guide->point[k];
        if (d_mm <= b->d_mm) return between(a, b, (d_mm - a->d_mm) / (b->d_mm - a->d_mm));
    }
    const double beyond = d_mm - a->d_mm;
    return (struct guide_load){.force_N = a->force_N + beyond * a->stiffness_N_mm,
                               .stiffness_N_mm = a->stiffness_N_mm,
                               .work_Nmm = a->work_Nmm +
                                           beyond * (a->force_N + beyond / 2 * a->stiffness_N_mm)};
}

/* --- leading ---------------------------------------------------------------------------------- */

static bool place_init(struct guide_place *ret, size_t nodes)
{
    ret->u_mm = calloc(nodes, sizeof *ret->u_mm);
    ret->pressure = calloc(nodes, sizeof *ret->pressure);
    return ret->u_mm != NULL && ret->pressure != NULL;
}

static void place_finish(struct guide_place *place)
{
    free(place->u_mm);
    free(place->pressure);
}

void guide_cursor_finish(struct guide_cursor *cursor)
{
    place_finish(&cursor->here);
    place_finish(&cursor->ahead);
    *cursor = (struct guide_cursor){0};
}

enum ischia_code guide_cursor_init(struct guide_cursor *ret, const struct guide *guide,
                                   int node_count, struct ischia_error *err)
{
    struct guide_cursor cursor = {.guide = guide};
    const bool here = place_init(&cursor.here, (size_t)node_count);
    const bool ahead = place_init(&cursor.ahead, (size_t)node_count);
    if (!here || !ahead) {
        guide_cursor_finish(&cursor);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the path of the coarser mesh");
    }
    *ret = cursor;
    return ISCHIA_OK;
}

double guide_next_mm(const struct guide_cursor *cursor)
{
    if (cursor->guide == NULL || cursor->next >= cursor->guide->count) return HUGE_VAL;
    return cursor->guide->point[cursor->next].d_mm;
}

bool guide_is_last(const struct guide_cursor *cursor)
{
    return cursor->guide->complete && cursor->next == cursor->guide->count - 1;
}

void guide_look_ahead(struct guide_cursor *cursor, const struct mesh *mesh)
{
    const struct guide *guide = cursor->guide;
    const struct guide_point *p = &guide->point[cursor->next];
    mesh_local_prolong(&guide->divisions, (const double(*)[3])p->u_mm, &mesh->divisions,
                       cursor->ahead.u_mm);
    mesh_local_prolong(&guide->divisions, (const double(*)[3])p->pressure, &mesh->divisions,
                       cursor->ahead.pressure);
}

void guide_advance(struct guide_cursor *cursor)
{
    const struct guide_place reached = cursor->ahead;
    const int left = cursor->guide->count - 1 - cursor->next, stride = cursor->guide->stride;
    cursor->ahead = cursor->here;
    cursor->here = reached;
    cursor->next += left > 0 && left < stride ? left : stride;
}
