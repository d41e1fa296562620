/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/assembly.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool rests_on_seat(const struct mesh *mesh, int n)
{
    return mesh->node_flags[n] & NODE_ON_SEAT && mesh->X_mm[n][2] <= 0;
}

static void number_nodes(struct assembly *a, const struct mesh *mesh, bool resting)
{
    for (int n = 0; n < mesh->node_count; n++) {
        const unsigned flags = mesh->node_flags[n];
        if (rests_on_seat(mesh, n) != resting) continue;
        const bool bone = flags & NODE_ON_BONE;
        a->equation[n][0] = bone || flags & NODE_ON_X0 ? EQUATION_FIXED : a->n++;
        a->equation[n][1] = bone || flags & NODE_ON_Y0 ? EQUATION_FIXED : a->n++;
        a->equation[n][2] = bone || flags & NODE_ON_PLATE ? EQUATION_BONE : a->n++;
    }
}

static void number_equations(struct assembly *a, const struct mesh *mesh)
{
    number_nodes(a, mesh, false);
    a->seat_first = a->n;
    number_nodes(a, mesh, true);
}

void assembly_element_equations(const struct assembly *a, const int *node, int nodes, int *ret)
{
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < nodes; k++) ret[c * nodes + k] = a->equation[node[k]][c];
}

const int *assembly_element_scatter(const struct assembly *a, int element)
{
    return a->scatter + (size_t)element * (size_t)a->entries;
}

/* The same by the element's index; returns how many there are. */
static int equations_of(const struct assembly *a, const struct connectivity *c, int e,
                        int ret[3 * ELEMENT_NODES_MAX])
{
    assembly_element_equations(a, c->node + (size_t)e * (size_t)c->nodes, c->nodes, ret);
    return 3 * c->nodes;
}

static int compare_ints(const void *a, const void *b)
{
    const int x = *(const int *)a, y = *(const int *)b;
    return (x > y) - (x < y);
}

struct pattern {
    int *start; /* [n + 1] */
    int *row;   /* [start[n]] */
};

static void pattern_finish(struct pattern *p)
{
    free(p->start);
    free(p->row);
    *p = (struct pattern){0};
}

/* Counts, or with rows != NULL writes, every (row >= column) entry, repeats included. */
static void visit_entries(const struct assembly *a, const struct connectivity *c, int *place,
                          int *rows)
{
    int eq[3 * ELEMENT_NODES_MAX];
    for (int e = 0; e < c->elements; e++) {
        const int count = equations_of(a, c, e, eq);
        for (int p = 0; p < count; p++)
            for (int q = 0; q < count; q++) {
                if (eq[q] < 0 || eq[p] < eq[q]) continue;
                if (rows != NULL) rows[place[eq[q]]] = eq[p];
                place[eq[q]]++;
            }
    }
}

/* Sorts each column and drops repeats; returns the number of entries kept. */
static int compress_columns(int n, const int *loose_start, int *row, int *ret_start)
{
    int kept = 0;
    for (int j = 0; j < n; j++) {
        int *column = row + loose_start[j];
        const int count = loose_start[j + 1] - loose_start[j];
        qsort(column, (size_t)count, sizeof *column, compare_ints);
        ret_start[j] = kept;
        for (int k = 0; k < count; k++)
            if (k == 0 || column[k] != column[k - 1]) row[kept++] = column[k];
    }
    ret_start[n] = kept;
    return kept;
}

static bool pattern_init(struct pattern *ret, const struct assembly *a,
                         const struct connectivity *c)
{
    const size_t n = (size_t)a->n;
    int *loose = calloc(n + 1, sizeof *loose), *place = calloc(n + 1, sizeof *place);
    bool done = false;
    *ret = (struct pattern){.start = calloc(n + 1, sizeof(int))};
    if (loose == NULL || place == NULL || ret->start == NULL) goto out;
    visit_entries(a, c, place, NULL);
    for (int j = 0; j < a->n; j++) loose[j + 1] = loose[j] + place[j];
    ret->row = malloc(sizeof(int) * ((size_t)loose[n] + 1)); /* never of no bytes */
    if (ret->row == NULL) goto out;
    memcpy(place, loose, sizeof *place * (n + 1));
    visit_entries(a, c, place, ret->row);
    (void)compress_columns(a->n, loose, ret->row, ret->start);
    done = true;
out:
    free(loose);
    free(place);
    if (!done) pattern_finish(ret);
    return done;
}

static int place_of(const struct pattern *p, int i, int j)
{
    const int row = i > j ? i : j, column = i > j ? j : i;
    if (column < 0) return -1;
    const int *found =
        bsearch(&row, p->row + p->start[column], (size_t)(p->start[column + 1] - p->start[column]),
                sizeof row, compare_ints);
    return found != NULL ? (int)(found - p->row) : -1;
}

static void map_elements(struct assembly *a, const struct connectivity *c, const struct pattern *p)
{
    int eq[3 * ELEMENT_NODES_MAX], *place = a->scatter;
    for (int e = 0; e < c->elements; e++) {
        const int count = equations_of(a, c, e, eq);
        for (int i = 0; i < count; i++)
            for (int j = 0; j <= i; j++) *place++ = place_of(p, eq[i], eq[j]);
    }
}

static void map_nodes(struct assembly *a, const struct mesh *mesh, const struct pattern *p)
{
    for (int n = 0; n < mesh->node_count; n++) {
        for (int c = 0; c < 3; c++)
            a->diagonal[n][c] = place_of(p, a->equation[n][c], a->equation[n][c]);
        a->tangential[n] = place_of(p, a->equation[n][0], a->equation[n][1]);
    }
}

static bool allocate(struct assembly *a, const struct mesh *mesh, const struct connectivity *c)
{
    const size_t nodes = (size_t)mesh->node_count, elements = (size_t)c->elements;
    a->entries = 3 * c->nodes * (3 * c->nodes + 1) / 2;
    a->equation = calloc(nodes, sizeof *a->equation);
    a->scatter = malloc(elements * (size_t)a->entries * sizeof *a->scatter);
    a->diagonal = malloc(nodes * sizeof *a->diagonal);
    a->tangential = malloc(nodes * sizeof *a->tangential);
    return a->equation && a->scatter && a->diagonal && a->tangential;
}

/* Puts the equations into the order in which their factor is cheap. */
static enum ischia_code reorder(struct assembly *a, const struct mesh *mesh,
                                const struct pattern *pattern, struct ischia_error *err)
{
    assert(a->n > 0);
    int *order = malloc(sizeof *order * (size_t)a->n), *rank = malloc(sizeof *rank * (size_t)a->n);
    enum ischia_code code;
    if (order != NULL && rank != NULL)
        code = linear_order(a->n, a->n - a->seat_first, pattern->start, pattern->row, order, err);
    else
        code = FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the equations");
    for (int k = 0; code == ISCHIA_OK && k < a->n; k++) rank[order[k]] = k;
    for (int n = 0; code == ISCHIA_OK && n < mesh->node_count; n++)
        for (int c = 0; c < 3; c++)
            if (a->equation[n][c] >= 0) a->equation[n][c] = rank[a->equation[n][c]];
    free(order);
    free(rank);
    return code;
}

/* What is half made when it fails is the caller's to finish. */
static enum ischia_code build(struct assembly *a, const struct mesh *mesh,
                              const struct connectivity *c, struct pattern *pattern,
                              struct ischia_error *err)
{
    static const char no_memory[] = "not enough memory for the equations";
    CHECK(allocate(a, mesh, c), err, ISCHIA_E_MEMORY, "%s", no_memory);
    number_equations(a, mesh);
    CHECK(pattern_init(pattern, a, c), err, ISCHIA_E_MEMORY, "%s", no_memory);
    TRY(reorder(a, mesh, pattern, err));
    pattern_finish(pattern);
    CHECK(pattern_init(pattern, a, c), err, ISCHIA_E_MEMORY, "%s", no_memory);
    map_elements(a, c, pattern);
    map_nodes(a, mesh, pattern);
    return linear_create(&a->linear, a->n, a->n - a->seat_first, pattern->start, pattern->row, err);
}

enum ischia_code assembly_init(struct assembly *ret, const struct mesh *mesh,
                               struct ischia_error *err)
{
    const struct connectivity hexahedra = {mesh->element_count, HEX_NODES, &mesh->hex[0][0]};
    return assembly_init_elements(ret, mesh, &hexahedra, err);
}

enum ischia_code assembly_init_elements(struct assembly *ret, const struct mesh *mesh,
                                        const struct connectivity *elements,
                                        struct ischia_error *err)
{
    struct assembly a = {0};
    struct pattern pattern = {0};
    assert(elements->nodes <= ELEMENT_NODES_MAX);
    const enum ischia_code code = build(&a, mesh, elements, &pattern, err);
    pattern_finish(&pattern);
    if (code == ISCHIA_OK)
        *ret = a;
    else
        assembly_finish(&a);
    return code;
}

void assembly_finish(struct assembly *a)
{
    free(a->equation);
    free(a->scatter);
    free(a->diagonal);
    free(a->tangential);
    linear_destroy(a->linear);
    *a = (struct assembly){0};
}
