/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Points are made as coordinates in [-1, 1] or as level numbers; a coordinate of -1 or +1 gives the
 * first or last level exactly, so that a file of results shows 0.1 as 0.1.
 *
 * Morris (Technometrics 33 (1991) 161): each path starts at a random grid point and moves one
 * factor after the other, in random order, by Delta = p / (2 (p - 1)) of the unit range, up or down
 * as fits; p is the number of grid levels.
 */
#include "solver/study/design.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "solver/study/sequence.h"

const char *const design_kind_names[DESIGN_KIND_COUNT] = {
    [DESIGN_FULL] = "full",     [DESIGN_CENTRAL_COMPOSITE] = "central_composite",
    [DESIGN_SOBOL] = "sobol",   [DESIGN_HALTON] = "halton",
    [DESIGN_MORRIS] = "morris",
};

const char *design_factor_name(const struct design_factor *factor, char buffer[DESIGN_NAME_BYTES])
{
    if (factor->is_option) {
        const struct ischia_option_info *info = &ischia_options[factor->index];
        (void)snprintf(buffer, DESIGN_NAME_BYTES, "%s.%s", info->group, info->key);
    } else {
        (void)snprintf(buffer, DESIGN_NAME_BYTES, "%s", ischia_params[factor->index].key);
    }
    return buffer;
}

bool design_factor_find(const char *name, struct design_factor *ret)
{
    for (int k = 0; k < DESIGN_FACTORS_MAX; k++) {
        const bool is_option = k >= ISCHIA_PARAM_COUNT;
        const struct design_factor candidate = {.is_option = is_option,
                                                .index = is_option ? k - ISCHIA_PARAM_COUNT : k};
        char buffer[DESIGN_NAME_BYTES];
        if (strcmp(name, design_factor_name(&candidate, buffer)) != 0) continue;
        ret->is_option = candidate.is_option;
        ret->index = candidate.index;
        return true;
    }
    return false;
}

static bool factor_is_valid(const struct design_factor *f)
{
    if (f->index < 0 || f->index >= (f->is_option ? ISCHIA_OPTION_COUNT : ISCHIA_PARAM_COUNT))
        return false;
    if (f->level_count < 2 || f->level_count > DESIGN_LEVELS_MAX) return false;
    if (f->log && !(f->level[0] > 0)) return false;
    for (int i = 0; i < f->level_count; i++)
        if (!isfinite(f->level[i]) || (i > 0 && !(f->level[i] > f->level[i - 1]))) return false;
    return true;
}

static bool same_factor(const struct design_factor *a, const struct design_factor *b)
{
    return a->is_option == b->is_option && a->index == b->index;
}

static bool factors_are_valid(const struct design *d)
{
    if (d->factor_count < 1 || d->factor_count > DESIGN_FACTORS_MAX) return false;
    for (int i = 0; i < d->factor_count; i++) {
        if (!factor_is_valid(&d->factor[i])) return false;
        for (int j = 0; j < i; j++)
            if (same_factor(&d->factor[i], &d->factor[j])) return false;
    }
    return true;
}

static bool rule_is_valid(const struct design *d)
{
    const bool fraction =
        d->generator_count >= 0 && d->generator_count <= DESIGN_GENERATORS_MAX &&
        (d->generator_count == 0 || (d->modulus >= 2 && d->modulus <= DESIGN_LEVELS_MAX));
    switch (d->kind) {
    case DESIGN_FULL:
        return fraction;
    case DESIGN_CENTRAL_COMPOSITE:
        return fraction && d->axial > 0 && d->axial <= 10;
    case DESIGN_SOBOL:
    case DESIGN_HALTON:
        return d->points >= 1 && d->points <= DESIGN_ROWS_MAX && d->skip <= DESIGN_ROWS_MAX;
    case DESIGN_MORRIS:
        return d->paths >= 1 && d->paths <= DESIGN_ROWS_MAX && d->path_levels >= 2 &&
               d->path_levels <= DESIGN_LEVELS_MAX && d->path_levels % 2 == 0;
    case DESIGN_KIND_COUNT:
        break;
    }
    return false;
}

bool design_is_valid(const struct design *design)
{
    return design != NULL && factors_are_valid(design) && rule_is_valid(design);
}

static double on_scale(const struct design_factor *factor, double value)
{
    return factor->log ? log(value) : value;
}

double design_normalised(const struct design_factor *factor, double value)
{
    const double low = on_scale(factor, factor->level[0]);
    const double high = on_scale(factor, factor->level[factor->level_count - 1]);
    return (on_scale(factor, value) - (low + high) / 2) / ((high - low) / 2);
}

/* The value at x in [-1, 1] (or beyond, for far axial points). */
static double value_at(const struct design_factor *factor, double x)
{
    const double low = factor->level[0], high = factor->level[factor->level_count - 1];
    if (x == -1) return low;
    if (x == 1) return high;
    if (factor->log) return sqrt(low * high) * pow(high / low, x / 2);
    return (low + high) / 2 + x * ((high - low) / 2);
}

/* Where rows go as a rule makes them: value is NULL while they are only counted. */
struct sink {
    const struct design *design;
    size_t rows_max; /* one row more than these is enough */
    size_t count;
    double *value;
};

static double *next_row(struct sink *sink)
{
    const size_t row = sink->count++;
    return sink->value == NULL ? NULL : &sink->value[row * (size_t)sink->design->factor_count];
}

static void put_coordinates(struct sink *sink, const double *x)
{
    double *row = next_row(sink);
    for (int f = 0; row != NULL && f < sink->design->factor_count; f++)
        row[f] = value_at(&sink->design->factor[f], x[f]);
}

static bool in_fraction(const struct design *d, const int *number)
{
    for (int g = 0; g < d->generator_count; g++) {
        long sum = 0;
        for (int f = 0; f < d->factor_count; f++) sum += (long)d->generator[g][f] * number[f];
        if (sum % d->modulus != 0) return false;
    }
    return true;
}

/* Counts like an odometer, last factor fastest; false after the last combination. */
static bool next_combination(const int *radix, int count, int *number)
{
    for (int f = count - 1; f >= 0; f--) {
        if (++number[f] < radix[f]) return true;
        number[f] = 0;
    }
    return false;
}

static void put_full(struct sink *sink)
{
    const struct design *d = sink->design;
    int number[DESIGN_FACTORS_MAX] = {0}, radix[DESIGN_FACTORS_MAX] = {0};
    for (int f = 0; f < d->factor_count; f++) radix[f] = d->factor[f].level_count;
    do {
        if (!in_fraction(d, number)) continue;
        double *row = next_row(sink);
        for (int f = 0; row != NULL && f < d->factor_count; f++)
            row[f] = d->factor[f].level[number[f]];
    } while (sink->count <= sink->rows_max && next_combination(radix, d->factor_count, number));
}

static void put_corners(struct sink *sink)
{
    const struct design *d = sink->design;
    int number[DESIGN_FACTORS_MAX] = {0}, radix[DESIGN_FACTORS_MAX] = {0};
    double x[DESIGN_FACTORS_MAX] = {0};
    for (int f = 0; f < d->factor_count; f++) radix[f] = 2;
    do {
        for (int f = 0; f < d->factor_count; f++) x[f] = 2 * number[f] - 1;
        if (in_fraction(d, number)) put_coordinates(sink, x);
    } while (next_combination(radix, d->factor_count, number));
}

static void put_central_composite(struct sink *sink)
{
    double x[DESIGN_FACTORS_MAX] = {0};
    put_corners(sink);
    for (int f = 0; f < sink->design->factor_count; f++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            x[f] = sign * sink->design->axial;
            put_coordinates(sink, x);
        }
        x[f] = 0;
    }
    put_coordinates(sink, x);
}

static void put_sequence(struct sink *sink, double (*point)(uint32_t, int, uint64_t))
{
    const struct design *d = sink->design;
    double x[DESIGN_FACTORS_MAX];
    for (uint32_t i = 0; i < d->points && sink->count <= sink->rows_max; i++) {
        for (int f = 0; f < d->factor_count; f++) x[f] = 2 * point(d->skip + i, f, d->seed) - 1;
        put_coordinates(sink, x);
    }
}

static void put_sobol(struct sink *sink) { put_sequence(sink, sequence_sobol); }
static void put_halton(struct sink *sink) { put_sequence(sink, sequence_halton); }

static void put_path(struct sink *sink, struct sequence_random *random)
{
    const struct design *d = sink->design;
    const int levels = d->path_levels, jump = levels / 2;
    int order[DESIGN_FACTORS_MAX], number[DESIGN_FACTORS_MAX];
    double x[DESIGN_FACTORS_MAX];
    for (int f = 0; f < d->factor_count; f++) {
        const int other = (int)sequence_random_below(random, (uint32_t)f + 1);
        order[f] = order[other];
        order[other] = f;
        number[f] = (int)sequence_random_below(random, (uint32_t)levels);
        x[f] = 2.0 * number[f] / (levels - 1) - 1;
    }
    put_coordinates(sink, x);
    for (int step = 0; step < d->factor_count; step++) {
        const int f = order[step];
        number[f] += number[f] < jump ? jump : -jump;
        x[f] = 2.0 * number[f] / (levels - 1) - 1;
        put_coordinates(sink, x);
    }
}

static void put_morris(struct sink *sink)
{
    struct sequence_random random = {sink->design->seed};
    for (uint32_t i = 0; i < sink->design->paths && sink->count <= sink->rows_max; i++)
        put_path(sink, &random);
}

static void (*const put_rows[DESIGN_KIND_COUNT])(struct sink *sink) = {
    [DESIGN_FULL] = put_full,     [DESIGN_CENTRAL_COMPOSITE] = put_central_composite,
    [DESIGN_SOBOL] = put_sobol,   [DESIGN_HALTON] = put_halton,
    [DESIGN_MORRIS] = put_morris,
};

/* True when a full design's fraction can be sought in good time: a fraction keeps one combination
 * in modulus to the power of its generators, and more than this many would be thrown away. */
static bool combinations_are_few(const struct design *d, size_t rows_max)
{
    enum { THROWN_AWAY_MAX = 64 };
    double combinations = 1;
    for (int f = 0; f < d->factor_count; f++) combinations *= d->factor[f].level_count;
    return d->kind != DESIGN_FULL || d->generator_count == 0 ||
           combinations <= THROWN_AWAY_MAX * (double)rows_max;
}

enum ischia_code design_points_init(struct design_points *ret, const struct design *design,
                                    size_t rows_max, struct ischia_error *err)
{
    assert(design_is_valid(design) && rows_max <= DESIGN_ROWS_MAX);
    struct sink sink = {.design = design, .rows_max = rows_max};
    CHECK(combinations_are_few(design, rows_max), err, ISCHIA_E_LIMIT,
          "the fraction is of too many combinations");
    put_rows[design->kind](&sink);
    CHECK(sink.count <= rows_max, err, ISCHIA_E_LIMIT, "the design has more than %zu rows",
          rows_max);
    const size_t rows = sink.count, room = rows > 0 ? rows : 1;
    sink = (struct sink){.design = design,
                         .rows_max = rows_max,
                         .value = calloc(room * (size_t)design->factor_count, sizeof(double))};
    CHECK(sink.value != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu rows", rows);
    put_rows[design->kind](&sink);
    *ret = (struct design_points){rows, design->factor_count, sink.value};
    return ISCHIA_OK;
}

void design_points_finish(struct design_points *points)
{
    free(points->value);
    *points = (struct design_points){0};
}

struct ischia_case design_case(const struct design *design, const struct design_points *points,
                               size_t row)
{
    struct ischia_case c = design->base;
    assert(row < points->count);
    for (int f = 0; f < design->factor_count; f++) {
        const struct design_factor *factor = &design->factor[f];
        double *target = factor->is_option ? &c.option[factor->index] : &c.param[factor->index];
        *target = points->value[row * (size_t)points->factor_count + (size_t)f];
    }
    return c;
}
