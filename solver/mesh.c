/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/mesh.h"

#include <stdlib.h>

const char *const tissue_names[TISSUE_COUNT] = {
    [TISSUE_MUSCLE] = "muscle",
    [TISSUE_FAT] = "fat",
    [TISSUE_SKIN] = "skin",
};

void mesh_finish(struct mesh *mesh)
{
    free(mesh->X_mm);
    free(mesh->hex);
    free(mesh->tissue);
    free(mesh->node_flags);
    free(mesh->seat_quad);
    free(mesh->axis);
    *mesh = (struct mesh){0};
}

/* The three neighbours of each corner of a hexahedron, right-handed. */
static const int corner_neighbours[8][3] = {{1, 3, 4}, {2, 0, 5}, {3, 1, 6}, {0, 2, 7},
                                            {7, 5, 0}, {4, 6, 1}, {5, 7, 2}, {6, 4, 3}};

static double triple_product(const double *o, const double *a, const double *b, const double *c)
{
    double p[3], q[3], r[3];
    for (int i = 0; i < 3; i++) {
        p[i] = a[i] - o[i];
        q[i] = b[i] - o[i];
        r[i] = c[i] - o[i];
    }
    return p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) +
           p[2] * (q[0] * r[1] - q[1] * r[0]);
}

static bool element_is_valid(const struct mesh *mesh, int e)
{
    const int *hex = mesh->hex[e];
    for (int a = 0; a < 8; a++)
        if (hex[a] < 0 || hex[a] >= mesh->node_count) return false;
    for (int a = 0; a < 8; a++) {
        const int *n = corner_neighbours[a];
        if (triple_product(mesh->X_mm[hex[a]], mesh->X_mm[hex[n[0]]], mesh->X_mm[hex[n[1]]],
                           mesh->X_mm[hex[n[2]]]) <= 0)
            return false;
    }
    return mesh->tissue[e] < TISSUE_COUNT;
}

static bool every_node_is_used(const struct mesh *mesh)
{
    bool all = true;
    unsigned char *used = calloc((size_t)mesh->node_count, 1);
    if (used == NULL) return false;
    for (int e = 0; e < mesh->element_count; e++)
        for (int a = 0; a < 8; a++) used[mesh->hex[e][a]] = 1;
    for (int n = 0; n < mesh->node_count; n++) all = all && used[n];
    free(used);
    return all;
}

bool mesh_is_valid(const struct mesh *mesh)
{
    if (mesh->node_count <= 0 || mesh->element_count <= 0) return false;
    for (int e = 0; e < mesh->element_count; e++)
        if (!element_is_valid(mesh, e)) return false;
    return every_node_is_used(mesh);
}
