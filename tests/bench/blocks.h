/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_BENCH_BLOCKS_H
#define ISCHIA_TESTS_BENCH_BLOCKS_H

#include "solver/mesh.h"

/* Hexahedra of 27 nodes on a mesh of ones of 8: each takes the nodes of 2 x 2 x 2 of them. */

enum { BLOCK_SIDE = 3, BLOCK_NODES = 27, BLOCK_HEXES = 8 };

struct block {
    int node[BLOCK_NODES]; /* i + 3 j + 9 k, each index 0 to 2 along an edge, positive volume */
    enum tissue tissue;
};

/* All of them, the caller's to free; NULL: no memory, or the divisions of the mesh are not even. */
struct block *blocks_of(const struct mesh *mesh, int *ret_count);

/* Moves the nodes inside the edges, faces and interiors of blocks to the middles there: elements
 * whose inner nodes are off them, as graded spacings put them, are less accurate, or folded. */
void blocks_straighten(struct mesh *mesh, const struct block *block, int count);

#endif
