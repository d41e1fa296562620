/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A block is known by the node in its middle. Where the divisions are even, the corner nodes of the
 * mesh, which belong to one hexahedron each, are corners of blocks; from a block the ones beside it
 * are found across its faces: four hexahedra meet in the middle of a face, and the other node that
 * they have in common is the next middle.
 */
#include "tests/bench/blocks.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static const int sign[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                               {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};

enum { AROUND_MAX = 8 };

/* Hexahedra around each node. */
struct around {
    int (*hex)[AROUND_MAX];
    int *count;
};

struct search {
    const struct mesh *mesh;
    struct around around;
    bool *taken; /* [element] */
    int *middle; /* [count] of the blocks found */
    int count;
    struct block *block;
    bool fits; /* so far */
};

/* Index of a node among the corners of a hexahedron, -1: not one of them. */
static int corner_of(const int hex[8], int node)
{
    for (int k = 0; k < 8; k++)
        if (hex[k] == node) return k;
    return -1;
}

/* The corner of a hexahedron at the other end of an edge. */
static int along_edge(int corner, int axis)
{
    for (int k = 0; k < 8; k++) {
        int differing = 0;
        for (int d = 0; d < 3; d++) differing += sign[k][d] != sign[corner][d];
        if (differing == 1 && sign[k][axis] != sign[corner][axis]) return k;
    }
    return -1;
}

static bool around_init(struct around *ret, const struct mesh *mesh)
{
    const size_t nodes = (size_t)mesh->node_count;
    ret->hex = calloc(nodes, sizeof *ret->hex);
    ret->count = calloc(nodes, sizeof *ret->count);
    if (ret->hex == NULL || ret->count == NULL) return false;
    for (int e = 0; e < mesh->element_count; e++)
        for (int k = 0; k < 8; k++) {
            const int n = mesh->hex[e][k];
            if (ret->count[n] < AROUND_MAX) ret->hex[n][ret->count[n]++] = e;
        }
    return true;
}

/* Place of a node in a block: -1, 0, 1 along each axis, the middle being 0, 0, 0. */
struct place {
    int node;
    int at[3];
};

struct places {
    struct place of[BLOCK_NODES];
    int count;
};

static const struct place *find(const struct places *p, int node)
{
    for (int i = 0; i < p->count; i++)
        if (p->of[i].node == node) return &p->of[i];
    return NULL;
}

static void put(struct places *p, int node, const int at[3])
{
    if (find(p, node) != NULL || p->count == BLOCK_NODES) return;
    p->of[p->count].node = node;
    memcpy(p->of[p->count++].at, at, sizeof p->of->at);
}

/* Which way an edge of a hexahedron leads from the middle; false: its other end is not placed. */
static bool direction_of(const struct places *p, const int hex[8], int corner, int axis, int ret[3])
{
    const struct place *end = find(p, hex[along_edge(corner, axis)]);
    if (end == NULL) return false;
    memcpy(ret, end->at, 3 * sizeof *ret);
    return true;
}

static bool is_taken(const struct places *p, const int at[3])
{
    for (int i = 0; i < p->count; i++)
        if (memcmp(p->of[i].at, at, sizeof p->of[i].at) == 0) return true;
    return false;
}

/* The third direction from the middle, two being known: along the axis that is neither's, to the
 * side where no node is yet. */
static void third_direction(const struct places *p, int edge[3][3], int unknown)
{
    int axis = 0;
    const int *a = edge[(unknown + 1) % 3], *b = edge[(unknown + 2) % 3];
    while (a[axis] != 0 || b[axis] != 0) axis++;
    memset(edge[unknown], 0, sizeof edge[unknown]);
    edge[unknown][axis] = 1;
    if (is_taken(p, edge[unknown])) edge[unknown][axis] = -1;
}

/* Puts the nodes of one hexahedron, if at least two of its three edges at the middle are placed. */
static void put_hex(struct places *p, const int hex[8], int middle)
{
    const int corner = corner_of(hex, middle);
    int edge[3][3], unknown = -1, unknowns = 0;
    for (int axis = 0; axis < 3; axis++)
        if (!direction_of(p, hex, corner, axis, edge[axis])) {
            unknown = axis;
            unknowns++;
        }
    if (unknowns > 1) return;
    if (unknowns == 1) third_direction(p, edge, unknown);
    for (int k = 0; k < 8; k++) {
        int at[3] = {0};
        for (int axis = 0; axis < 3; axis++)
            for (int d = 0; sign[k][axis] != sign[corner][axis] && d < 3; d++)
                at[d] += edge[axis][d];
        put(p, hex[k], at);
    }
}

/* The first hexahedron sets the axes, which makes the block's volume as positive as its own. */
static void put_first(struct places *p, const int hex[8], int middle)
{
    const int corner = corner_of(hex, middle);
    for (int k = 0; k < 8; k++) {
        int at[3];
        for (int d = 0; d < 3; d++) at[d] = sign[k][d] - sign[corner][d];
        put(p, hex[k], at);
    }
}

static void add_block(struct search *s, int middle)
{
    const struct mesh *mesh = s->mesh;
    const int *around = s->around.hex[middle];
    struct places p = {.count = 0};
    if (s->around.count[middle] != BLOCK_HEXES) {
        s->fits = false;
        return;
    }
    for (int i = 0; i < BLOCK_HEXES; i++) {
        s->fits =
            s->fits && !s->taken[around[i]] && mesh->tissue[around[i]] == mesh->tissue[around[0]];
        s->taken[around[i]] = true;
    }
    put_first(&p, mesh->hex[around[0]], middle);
    for (int round = 0; round < BLOCK_HEXES && p.count < BLOCK_NODES; round++)
        for (int i = 1; i < BLOCK_HEXES; i++) put_hex(&p, mesh->hex[around[i]], middle);
    s->fits = s->fits && p.count == BLOCK_NODES;
    struct block *block = &s->block[s->count];
    block->tissue = (enum tissue)mesh->tissue[around[0]];
    for (int i = 0; i < p.count; i++) {
        const int *at = p.of[i].at;
        block->node[(at[0] + 1) + 3 * (at[1] + 1) + 9 * (at[2] + 1)] = p.of[i].node;
    }
    s->middle[s->count++] = middle;
}

/* The node that the hexahedra around `face`, but for those of a block, have in common beside it. */
static int middle_across(const struct search *s, int face, const struct block *from)
{
    int outside[AROUND_MAX], count = 0;
    for (int i = 0; i < s->around.count[face]; i++) {
        const int e = s->around.hex[face][i];
        if (corner_of(s->mesh->hex[e], from->node[BLOCK_NODES / 2]) < 0) outside[count++] = e;
    }
    for (int k = 0; count == 4 && k < 8; k++) {
        const int n = s->mesh->hex[outside[0]][k];
        bool common = n != face;
        for (int i = 1; i < count; i++)
            common = common && corner_of(s->mesh->hex[outside[i]], n) >= 0;
        if (common) return n;
    }
    return -1;
}

static void add_neighbours(struct search *s, int b)
{
    static const int face[6] = {4, 10, 12, 14, 16, 22};
    for (int i = 0; i < 6 && s->fits; i++) {
        const struct block *block = &s->block[b];
        const int middle = middle_across(s, block->node[face[i]], block);
        bool known = middle < 0;
        for (int k = 0; k < s->count && !known; k++) known = s->middle[k] == middle;
        if (!known) add_block(s, middle);
    }
}

/* The node opposite the first corner of the mesh: that corner belongs to one hexahedron. */
static int first_middle(const struct search *s)
{
    for (int n = 0; n < s->mesh->node_count; n++) {
        if (s->around.count[n] != 1) continue;
        const int *hex = s->mesh->hex[s->around.hex[n][0]];
        const int corner = corner_of(hex, n);
        for (int k = 0; k < 8; k++)
            if (sign[k][0] != sign[corner][0] && sign[k][1] != sign[corner][1] &&
                sign[k][2] != sign[corner][2])
                return hex[k];
    }
    return -1;
}

struct block *blocks_of(const struct mesh *mesh, int *ret_count)
{
    const size_t elements = (size_t)mesh->element_count;
    struct search s = {.mesh = mesh, .fits = mesh->element_count % BLOCK_HEXES == 0};
    s.taken = calloc(elements, sizeof *s.taken);
    s.middle = calloc(elements, sizeof *s.middle);
    s.block = calloc(elements, sizeof *s.block);
    s.fits = around_init(&s.around, mesh) && s.taken && s.middle && s.block && s.fits;
    const int first = s.fits ? first_middle(&s) : -1;
    if (first >= 0) add_block(&s, first);
    for (int b = 0; b < s.count && s.fits; b++) add_neighbours(&s, b);
    s.fits = s.fits && s.count * BLOCK_HEXES == mesh->element_count;
    free(s.around.hex);
    free(s.around.count);
    free(s.taken);
    free(s.middle);
    if (!s.fits) {
        free(s.block);
        return NULL;
    }
    *ret_count = s.count;
    return s.block;
}

/* The mean of the corners that a node lies between: those that agree with it where it is at an
 * end. */
static void move_to_middle(struct mesh *mesh, const struct block *block, int node)
{
    const int at[3] = {node % 3, node / 3 % 3, node / 9};
    double sum[3] = {0};
    int corners = 0;
    for (int k = 0; k < BLOCK_NODES; k++) {
        const int corner[3] = {k % 3, k / 3 % 3, k / 9};
        bool between = true;
        for (int d = 0; d < 3; d++)
            between = between && corner[d] != 1 && (at[d] == 1 || at[d] == corner[d]);
        for (int i = 0; i < 3 && between; i++) sum[i] += mesh->X_mm[block->node[k]][i];
        corners += between;
    }
    for (int i = 0; i < 3; i++) mesh->X_mm[block->node[node]][i] = sum[i] / corners;
}

void blocks_straighten(struct mesh *mesh, const struct block *block, int count)
{
    for (int b = 0; b < count; b++)
        for (int k = 0; k < BLOCK_NODES; k++)
            if (k % 3 == 1 || k / 3 % 3 == 1 || k / 9 == 1) move_to_middle(mesh, &block[b], k);
}
