/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_BOX_MESH_H
#define ISCHIA_TESTS_BOX_MESH_H

#include <stdlib.h>
#include <string.h>

#include "solver/mesh.h"

/*
 * A structured box [0, size] of hexahedra for tests: symmetry planes x = 0 and y = 0, seat at
 * z = 0 (bottom quads only), bone on the whole top. The lowest layers are skin, then fat, the rest
 * muscle; layers are numbered from the top, so that the muscle comes first.
 */
struct box {
    int n[3]; /* elements along x, y, z */
    double size_mm[3];
    int skin_layers, fat_layers;
};

static inline void *box_alloc(size_t count, size_t size)
{
    void *p = count > 0 ? calloc(count, size) : NULL;
    if (p == NULL) abort();
    return p;
}

/* Node (i, j, k), k counted from the bottom. */
static inline int box_node(const struct box *box, int i, int j, int k)
{
    return i + (box->n[0] + 1) * (j + (box->n[1] + 1) * k);
}

/* Element (i, j, k), k counted from the bottom. */
static inline int box_element(const struct box *box, int i, int j, int k)
{
    return i + box->n[0] * (j + box->n[1] * (box->n[2] - 1 - k));
}

static inline void box_set_element(const struct box *box, struct mesh *mesh, int i, int j, int k)
{
    static const int corner[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                     {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    const int e = box_element(box, i, j, k);
    for (int a = 0; a < 8; a++)
        mesh->hex[e][a] = box_node(box, i + corner[a][0], j + corner[a][1], k + corner[a][2]);
    mesh->tissue[e] = TISSUE_MUSCLE;
    if (k < box->skin_layers + box->fat_layers) mesh->tissue[e] = TISSUE_FAT;
    if (k < box->skin_layers) mesh->tissue[e] = TISSUE_SKIN;
    mesh->muscle_count += mesh->tissue[e] == TISSUE_MUSCLE;
    if (k > 0) return;
    static const int down[4] = {0, 3, 2, 1};
    for (int a = 0; a < 4; a++) mesh->seat_quad[mesh->seat_quad_count][a] = mesh->hex[e][down[a]];
    mesh->seat_quad_count = ++mesh->outer_skin_quad_count;
}

static inline void box_set_node(const struct box *box, struct mesh *mesh, int i, int j, int k)
{
    const int index[3] = {i, j, k};
    const int node = box_node(box, i, j, k);
    for (int d = 0; d < 3; d++) mesh->X_mm[node][d] = box->size_mm[d] * index[d] / box->n[d];
    mesh->node_flags[node] =
        (unsigned char)((k == box->n[2] ? NODE_ON_BONE : 0) | (i == 0 ? NODE_ON_X0 : 0) |
                        (j == 0 ? NODE_ON_Y0 : 0) | (k == 0 ? NODE_ON_SEAT : 0));
}

static inline struct mesh box_mesh(const struct box *box)
{
    const int *n = box->n;
    struct mesh mesh = {.node_count = (n[0] + 1) * (n[1] + 1) * (n[2] + 1),
                        .element_count = n[0] * n[1] * n[2]};
    mesh.X_mm = box_alloc((size_t)mesh.node_count, sizeof *mesh.X_mm);
    mesh.node_flags = box_alloc((size_t)mesh.node_count, 1);
    mesh.hex = box_alloc((size_t)mesh.element_count, sizeof *mesh.hex);
    mesh.tissue = box_alloc((size_t)mesh.element_count, 1);
    mesh.seat_quad = box_alloc((size_t)(n[0] * n[1]), sizeof *mesh.seat_quad);
    for (int k = 0; k <= n[2]; k++)
        for (int j = 0; j <= n[1]; j++)
            for (int i = 0; i <= n[0]; i++) box_set_node(box, &mesh, i, j, k);
    for (int k = 0; k < n[2]; k++)
        for (int j = 0; j < n[1]; j++)
            for (int i = 0; i < n[0]; i++) box_set_element(box, &mesh, i, j, k);
    return mesh;
}

static inline void box_mesh_free(struct mesh *mesh)
{
    free(mesh->X_mm);
    free(mesh->node_flags);
    free(mesh->hex);
    free(mesh->tissue);
    free(mesh->seat_quad);
    memset(mesh, 0, sizeof *mesh);
}

/* u = (A - I) X at every node: the homogeneous deformation of gradient A. */
static inline double *box_displacement(const struct mesh *mesh, double A[3][3])
{
    double *u = box_alloc((size_t)mesh->node_count * 3, sizeof *u);
    for (int n = 0; n < mesh->node_count; n++) {
        for (int i = 0; i < 3; i++) {
            u[3 * n + i] = -mesh->X_mm[n][i];
            for (int j = 0; j < 3; j++) u[3 * n + i] += A[i][j] * mesh->X_mm[n][j];
        }
    }
    return u;
}

/* Moves every node by a smooth map, so that the elements are no longer boxes. */
static inline void box_distort(struct mesh *mesh, double amount)
{
    for (int n = 0; n < mesh->node_count; n++) {
        double *X = mesh->X_mm[n];
        const double x = X[0], y = X[1], z = X[2];
        X[0] += amount * x * (y + 2 * z);
        X[1] += amount * y * (z - x);
        X[2] += amount * z * (x + y);
    }
}

#endif
