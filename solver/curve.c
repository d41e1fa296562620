/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/curve.h"

#include <stddef.h>

/* The quantities of a point beside the force. */
static const size_t quantities[] = {
    offsetof(struct ischia_load_point, displacement_mm),
    offsetof(struct ischia_load_point, eps_max),
    offsetof(struct ischia_load_point, E_shear_max),
    offsetof(struct ischia_load_point, E_comp_max),
};
enum { QUANTITY_COUNT = sizeof quantities / sizeof quantities[0] };

static double *quantity(struct ischia_load_point *p, int q)
{
    return (double *)(void *)((char *)p + quantities[q]);
}

static double value(const struct ischia_load_point *p, int q)
{
    return *(const double *)(const void *)((const char *)p + quantities[q]);
}

/* (1 - t) a + t b */
static struct ischia_load_point mix(const struct ischia_load_point *a,
                                    const struct ischia_load_point *b, double t)
{
    struct ischia_load_point ret = {.F_N = a->F_N + t * (b->F_N - a->F_N)};
    for (int q = 0; q < QUANTITY_COUNT; q++)
        *quantity(&ret, q) = value(a, q) + t * (value(b, q) - value(a, q));
    return ret;
}

void load_curve_add(struct load_curve *curve, const struct ischia_load_point *point)
{
    const double last_N = curve->count > 0 ? curve->point[curve->count - 1].F_N : 0;
    if (curve->count < ISCHIA_LOAD_POINTS_MAX && point->F_N > last_N)
        curve->point[curve->count++] = *point;
}

struct ischia_load_point load_curve_at(const struct load_curve *curve, double F_N)
{
    struct ischia_load_point before = {0};
    for (int i = 0; i < curve->count; before = curve->point[i++]) {
        const struct ischia_load_point *after = &curve->point[i];
        if (F_N <= after->F_N)
            return mix(&before, after, (F_N - before.F_N) / (after->F_N - before.F_N));
    }
    return before;
}
