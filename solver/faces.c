/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Faces are hung on chains by their smallest node; a node has a bounded number of faces, so finding
 * a face's partner on its chain costs a bounded number of comparisons.
 */
#include "solver/faces.h"

#include <stdlib.h>
#include <string.h>

const int hex_side_corner[HEX_SIDES][FACE_CORNERS] = {
    {0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7},
};

void face_nodes(const struct mesh *mesh, int face, int ret_nodes[FACE_CORNERS])
{
    const int *corner = hex_side_corner[face % HEX_SIDES];
    for (int i = 0; i < FACE_CORNERS; i++) ret_nodes[i] = mesh->hex[face / HEX_SIDES][corner[i]];
}

bool face_has_flag(const struct mesh *mesh, int face, enum node_flag flag)
{
    int nodes[FACE_CORNERS];
    face_nodes(mesh, face, nodes);
    for (int i = 0; i < FACE_CORNERS; i++)
        if ((mesh->node_flags[nodes[i]] & flag) == 0) return false;
    return true;
}

static int smallest(const int nodes[FACE_CORNERS])
{
    int least = nodes[0];
    for (int i = 1; i < FACE_CORNERS; i++)
        if (nodes[i] < least) least = nodes[i];
    return least;
}

static bool same_nodes(const int a[FACE_CORNERS], const int b[FACE_CORNERS])
{
    for (int i = 0; i < FACE_CORNERS; i++) {
        bool found = false;
        for (int j = 0; j < FACE_CORNERS; j++) found = found || a[i] == b[j];
        if (!found) return false;
    }
    return true;
}

/* Pairs the face with the one on its chain that has the same nodes, or hangs it on the chain. */
static void pair_or_hang(const struct mesh *mesh, int face, int *first, int *next, int *across)
{
    int nodes[FACE_CORNERS], other_nodes[FACE_CORNERS];
    face_nodes(mesh, face, nodes);
    int *link = &first[smallest(nodes)];
    for (; *link >= 0; link = &next[*link]) {
        const int other = *link;
        face_nodes(mesh, other, other_nodes);
        if (!same_nodes(nodes, other_nodes)) continue;
        across[face] = other;
        across[other] = face;
        *link = next[other];
        return;
    }
    *link = face;
}

enum ischia_code faces_init(struct faces *ret, const struct mesh *mesh, struct ischia_error *err)
{
    const int count = HEX_SIDES * mesh->element_count;
    const size_t size = (size_t)count * sizeof(int);
    const size_t chains_size = (size_t)mesh->node_count * sizeof(int);
    int *across = malloc(size), *next = malloc(size), *first = malloc(chains_size);
    enum ischia_code code = ISCHIA_OK;
    if (across == NULL || next == NULL || first == NULL) {
        code = FAIL(err, ISCHIA_E_MEMORY, "out of memory for the %d faces of the mesh", count);
        free(across);
        goto free_work;
    }
    /* All bits set is -1: no face, and FACE_ALONE. */
    memset(across, 0xff, size);
    memset(next, 0xff, size);
    memset(first, 0xff, chains_size);
    for (int face = 0; face < count; face++) pair_or_hang(mesh, face, first, next, across);
    *ret = (struct faces){.count = count, .across = across};
free_work:
    free(next);
    free(first);
    return code;
}

void faces_finish(struct faces *faces)
{
    free(faces->across);
    *faces = (struct faces){0};
}
