/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/study_sides.h"

#include <stdlib.h>
#include <string.h>

struct row {
    struct ischia_case c;
    size_t number;
    size_t first; /* the first row of its side */
};

static int compare_sizes(size_t a, size_t b) { return (a > b) - (a < b); }
static int compare_numbers(double a, double b) { return (a > b) - (a < b); }

/* Any order that brings the rows of a side together, in the order of the design. */
static int by_case(const void *a, const void *b)
{
    const struct row *x = a, *y = b;
    int order = (int)x->c.resolution - (int)y->c.resolution;
    for (int o = 0; o < ISCHIA_OPTION_COUNT && order == 0; o++)
        order = compare_numbers(x->c.option[o], y->c.option[o]);
    for (int p = 0; p < ISCHIA_PARAM_COUNT && order == 0; p++)
        if (p != ISCHIA_F) order = compare_numbers(x->c.param[p], y->c.param[p]);
    return order != 0 ? order : compare_sizes(x->number, y->number);
}

static bool is_same_side(const struct row *a, const struct row *b)
{
    struct row other = *b;
    other.number = a->number;
    return by_case(a, &other) == 0;
}

static int by_side_and_force(const void *a, const void *b)
{
    const struct row *x = a, *y = b;
    if (x->first != y->first) return compare_sizes(x->first, y->first);
    const int order = compare_numbers(x->c.param[ISCHIA_F], y->c.param[ISCHIA_F]);
    return order != 0 ? order : compare_sizes(x->number, y->number);
}

static void sort_rows(struct row *row, size_t count)
{
    qsort(row, count, sizeof *row, by_case);
    for (size_t i = 0; i < count; i++)
        row[i].first =
            i > 0 && is_same_side(&row[i - 1], &row[i]) ? row[i - 1].first : row[i].number;
    qsort(row, count, sizeof *row, by_side_and_force);
}

enum ischia_code study_sides_init(struct study_sides *ret, const struct design *design,
                                  const struct design_points *points,
                                  bool (*wanted)(void *context, size_t row), void *context,
                                  struct ischia_error *err)
{
    struct study_sides s = {.row = calloc(points->count + 1, sizeof *s.row),
                            .side = calloc(points->count + 1, sizeof *s.side)};
    struct row *rows = calloc(points->count + 1, sizeof *rows);
    if (s.row == NULL || s.side == NULL || rows == NULL) {
        study_sides_finish(&s);
        free(rows);
        return FAIL(err, ISCHIA_E_MEMORY, "out of memory for %zu rows", points->count);
    }
    for (size_t row = 0; row < points->count; row++)
        if (wanted(context, row))
            rows[s.count++] = (struct row){.c = design_case(design, points, row), .number = row};
    sort_rows(rows, s.count);
    for (size_t i = 0; i < s.count; i++) {
        s.row[i] = rows[i].number;
        s.side[i] = i == 0 ? 0 : s.side[i - 1] + (rows[i].first != rows[i - 1].first);
    }
    free(rows);
    *ret = s;
    return ISCHIA_OK;
}

void study_sides_finish(struct study_sides *sides)
{
    free(sides->row);
    free(sides->side);
    *sides = (struct study_sides){0};
}

static bool every_row(void *context, size_t row)
{
    (void)context;
    (void)row;
    return true;
}

enum ischia_code study_sides_deal(const struct design *design, const struct design_points *points,
                                  size_t shard, size_t shards, bool *ret_mine,
                                  struct ischia_error *err)
{
    struct study_sides all;
    TRY(study_sides_init(&all, design, points, every_row, NULL, err));
    for (size_t i = 0; i < all.count; i++) ret_mine[all.row[i]] = all.side[i] % shards == shard;
    study_sides_finish(&all);
    return ISCHIA_OK;
}

size_t study_sides_end(const struct study_sides *sides, size_t from)
{
    size_t end = from;
    while (end < sides->count && sides->side[end] == sides->side[from]) end++;
    return end;
}
