/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_DESIGN_H
#define ISCHIA_SOLVER_STUDY_DESIGN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "solver/case.h"
#include "solver/error.h"

/*
 * Which cases a study solves: factors (inputs or options), their levels, and the rule that chooses
 * the points. Values are in the units of ischia_params and ischia_options; everything not a factor
 * keeps its value in `base`.
 */

enum {
    DESIGN_FACTORS_MAX = ISCHIA_PARAM_COUNT + ISCHIA_OPTION_COUNT,
    DESIGN_LEVELS_MAX = 16,
    DESIGN_GENERATORS_MAX = 4,
    DESIGN_ROWS_MAX = 1000000
};

enum design_kind {
    DESIGN_FULL,              /* every combination of the levels, last factor fastest            */
    DESIGN_CENTRAL_COMPOSITE, /* corners, axial points, centre                                   */
    DESIGN_SOBOL,             /* low-discrepancy points between the first and the last level     */
    DESIGN_HALTON,
    DESIGN_MORRIS, /* one-at-a-time trajectories (Morris 1991) on a grid of even levels          */
    DESIGN_KIND_COUNT
};
extern const char *const design_kind_names[DESIGN_KIND_COUNT];

struct design_factor {
    bool is_option; /* index is an enum ischia_option, else an enum ischia_param */
    int index;
    bool log; /* between its levels it goes by ratio, not by difference; they are above 0 then */
    int level_count; /* 2 ... DESIGN_LEVELS_MAX, rising; the first and last are -1 and +1 */
    double level[DESIGN_LEVELS_MAX];
};

struct design {
    enum design_kind kind;
    struct ischia_case base;
    int factor_count;
    struct design_factor factor[DESIGN_FACTORS_MAX];

    /* full and central_composite: a regular fraction keeps the combinations whose level numbers
     * (0, 1, ...) give sum(generator[g][f] * number[f]) = 0 modulo `modulus` for every g. */
    int modulus; /* 2 ... DESIGN_LEVELS_MAX when there are generators */
    int generator_count;
    int generator[DESIGN_GENERATORS_MAX][DESIGN_FACTORS_MAX];

    double axial;    /* central_composite: distance of the axial points; 1: face-centred */
    uint32_t points; /* sobol, halton: how many                                          */
    uint32_t skip;   /* sobol, halton: points of the sequence left out at its start       */
    uint64_t seed;   /* sobol, halton: 0 is the plain sequence; morris: any               */
    uint32_t paths;  /* morris: trajectories, of factor_count + 1 points each             */
    int path_levels; /* morris: even, 2 ... DESIGN_LEVELS_MAX                             */
};

/* One point a row. */
struct design_points {
    size_t count;
    int factor_count;
    double *value; /* [count][factor_count] */
};

/* True when the members above are within their bounds and no factor is named twice. */
bool design_is_valid(const struct design *design);

/* design is valid (asserted). ISCHIA_E_LIMIT above rows_max rows (at most DESIGN_ROWS_MAX), or when
 * a fraction would have to be sought among very many more combinations; ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code design_points_init(struct design_points *ret,
                                                      const struct design *design, size_t rows_max,
                                                      struct ischia_error *err);
void design_points_finish(struct design_points *points); /* a zeroed one is allowed */

/* The case of one row; it may be invalid (R2 < R1 in a space-filling design): the caller checks. */
struct ischia_case design_case(const struct design *design, const struct design_points *points,
                               size_t row);

/* "muM" or "model.bulk_ratio", as CSV columns name it. */
enum { DESIGN_NAME_BYTES = 48 };
const char *design_factor_name(const struct design_factor *factor, char buffer[DESIGN_NAME_BYTES]);

/* Finds a factor by that name; false when there is none. Fills is_option and index only. */
bool design_factor_find(const char *name, struct design_factor *ret);

/* (value - middle) / half range between the first and the last level, in logarithms for `log`. */
double design_normalised(const struct design_factor *factor, double value);

#endif
