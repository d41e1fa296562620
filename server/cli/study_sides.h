/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_STUDY_SIDES_H
#define ISCHIA_SERVER_CLI_STUDY_SIDES_H

#include <stdbool.h>
#include <stddef.h>

#include "solver/error.h"
#include "solver/study/design.h"

/*
 * The order in which rows are solved. A solver that has pressed a side goes on to a larger force
 * for little (solver.h), so rows that differ in F alone stay together, the smallest force first,
 * and one process solves them all. Sides come in the order of their first rows.
 */
struct study_sides {
    size_t count;
    size_t *row;  /* [count] rows of the design                          */
    size_t *side; /* [count] number of the row's side, 0 ..., rising     */
};

/* Of the rows that `wanted` is true for. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code
study_sides_init(struct study_sides *ret, const struct design *design,
                 const struct design_points *points, bool (*wanted)(void *context, size_t row),
                 void *context, struct ischia_error *err);
void study_sides_finish(struct study_sides *sides); /* a zeroed one is allowed */

/*
 * ret_mine[points->count]: true for the rows of every `shards`-th side from side `shard` (0 ...
 * shards - 1) on. Each row is in one shard, and no side is in two. ISCHIA_E_MEMORY.
 */
ISCHIA_MUST_CHECK enum ischia_code
study_sides_deal(const struct design *design, const struct design_points *points, size_t shard,
                 size_t shards, bool *ret_mine, struct ischia_error *err);

/* Where the side that `from` (0 ... count) is in ends: count, or the first of another. */
size_t study_sides_end(const struct study_sides *sides, size_t from);

#endif
