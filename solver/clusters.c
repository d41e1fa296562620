/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Union-find over the muscle's cells with path halving; a set's root is its lowest cell, so the
 * numbering depends on the mesh alone. Cells under the threshold have no parent.
 */
#include "solver/clusters.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/kinematics.h"
#include "solver/units.h"

const char *const criterion_names[ISCHIA_CRITERION_COUNT] = {
    [ISCHIA_OVER_SHEAR] = "shear",
    [ISCHIA_OVER_COMPRESSION] = "compression",
    [ISCHIA_OVER_BOTH] = "both",
};

/* The symmetry planes: the flag of their nodes, and the coordinate that is zero on them. */
static const struct {
    enum node_flag flag;
    int axis;
} symmetry_plane[] = {{NODE_ON_X0, 0}, {NODE_ON_Y0, 1}};

/* The pairs of cells of one element that share a face. */
static const int inner_pair[12][2] = {
    {0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7},
};

/* A cluster of the quarter model while it is summed up. */
struct body {
    double volume_mm3; /* of the quarter's part */
    double moment_mm4[3];
    struct strain_measures largest;
    unsigned planes; /* flags of the symmetry planes it has a face on */
    int first_cell;
};

bool criterion_is_met(enum ischia_criterion criterion, const struct strain_measures *strain)
{
    const bool shear = strain->green_lagrange_shear > ISCHIA_E_SHEAR_THRESHOLD;
    const bool compression = strain->green_lagrange_compression > ISCHIA_E_COMP_THRESHOLD;
    switch (criterion) {
    case ISCHIA_OVER_SHEAR:
        return shear;
    case ISCHIA_OVER_COMPRESSION:
        return compression;
    default:
        return shear && compression;
    }
}

static int root_of(int *parent, int cell)
{
    while (parent[cell] != cell) {
        parent[cell] = parent[parent[cell]];
        cell = parent[cell];
    }
    return cell;
}

static void unite(int *parent, int a, int b)
{
    if (parent[a] < 0 || parent[b] < 0) return;
    const int root_a = root_of(parent, a), root_b = root_of(parent, b);
    if (root_a < root_b)
        parent[root_b] = root_a;
    else
        parent[root_a] = root_b;
}

static int corner_with_node(const int hex[HEX_CORNERS], int node)
{
    int corner = 0;
    while (hex[corner] != node) corner++;
    return corner;
}

/* Unites the four pairs of cells on the two sides of a shared face. */
static void unite_across(const struct mesh *mesh, int face, int other_face, int *parent)
{
    const int e = face / HEX_SIDES, other = other_face / HEX_SIDES;
    for (int i = 0; i < FACE_CORNERS; i++) {
        const int corner = hex_side_corner[face % HEX_SIDES][i];
        const int twin = corner_with_node(mesh->hex[other], mesh->hex[e][corner]);
        unite(parent, e * HEX_CELLS + corner, other * HEX_CELLS + twin);
    }
}

static void unite_neighbours(const struct mesh *mesh, const struct faces *faces, int *parent)
{
    for (int e = 0; e < mesh->muscle_count; e++) {
        for (int i = 0; i < 12; i++)
            unite(parent, e * HEX_CELLS + inner_pair[i][0], e * HEX_CELLS + inner_pair[i][1]);
        for (int face = e * HEX_SIDES; face < (e + 1) * HEX_SIDES; face++) {
            const int other = faces->across[face];
            if (other > face && other / HEX_SIDES < mesh->muscle_count)
                unite_across(mesh, face, other, parent);
        }
    }
}

static void add_cell(struct body *body, const struct strain_cell *cell)
{
    struct strain_measures *largest = &body->largest;
    const struct strain_measures *s = &cell->strain;
    body->volume_mm3 += cell->volume_mm3;
    for (int d = 0; d < 3; d++) body->moment_mm4[d] += cell->volume_mm3 * cell->X_mm[d];
    largest->green_lagrange_shear = fmax(largest->green_lagrange_shear, s->green_lagrange_shear);
    largest->green_lagrange_compression =
        fmax(largest->green_lagrange_compression, s->green_lagrange_compression);
    largest->engineering_shear = fmax(largest->engineering_shear, s->engineering_shear);
}

/* Sums the cells into bodies, numbered by their lowest cell; returns how many there are. */
static int sum_bodies(const struct strain_field *field, int cell_count, int *parent,
                      struct body *bodies, int *body_of)
{
    int count = 0;
    for (int i = 0; i < cell_count; i++) {
        body_of[i] = -1;
        if (parent[i] < 0) continue;
        const int root = root_of(parent, i);
        if (root == i) bodies[count] = (struct body){.first_cell = i};
        body_of[i] = root == i ? count++ : body_of[root];
        add_cell(&bodies[body_of[i]], &field->cell[i]);
    }
    return count;
}

static void mark_planes(const struct mesh *mesh, const struct faces *faces, const int *body_of,
                        struct body *bodies)
{
    const size_t planes = sizeof symmetry_plane / sizeof symmetry_plane[0];
    for (int face = 0; face < mesh->muscle_count * HEX_SIDES; face++) {
        if (faces->across[face] != FACE_ALONE) continue;
        unsigned flags = 0;
        for (size_t p = 0; p < planes; p++)
            if (face_has_flag(mesh, face, symmetry_plane[p].flag)) flags |= symmetry_plane[p].flag;
        for (int i = 0; flags != 0 && i < FACE_CORNERS; i++) {
            const int corner = hex_side_corner[face % HEX_SIDES][i];
            const int body = body_of[face / HEX_SIDES * HEX_CELLS + corner];
            if (body >= 0) bodies[body].planes |= flags;
        }
    }
}

/* How many parts of the quarter model one whole-side body is made of: 1, 2 or 4. */
static int joined_images(const struct body *body)
{
    int images = 1;
    if (body->planes & NODE_ON_X0) images *= 2;
    if (body->planes & NODE_ON_Y0) images *= 2;
    return images;
}

static double side_volume(const struct body *body)
{
    return body->volume_mm3 * joined_images(body);
}

static int by_volume_descending(const void *a, const void *b)
{
    const struct body *x = a, *y = b;
    const double volume_x = side_volume(x), volume_y = side_volume(y);
    if (volume_x != volume_y) return volume_x > volume_y ? -1 : 1;
    return x->first_cell - y->first_cell;
}

static struct ischia_cluster cluster_of(const struct body *body)
{
    struct ischia_cluster cluster = {
        .volume_mm3 = side_volume(body),
        .eps_max = body->largest.engineering_shear,
        .E_shear_max = body->largest.green_lagrange_shear,
        .E_comp_max = body->largest.green_lagrange_compression,
    };
    for (int d = 0; d < 3; d++) cluster.centroid_mm[d] = body->moment_mm4[d] / body->volume_mm3;
    for (size_t p = 0; p < sizeof symmetry_plane / sizeof symmetry_plane[0]; p++)
        if (body->planes & symmetry_plane[p].flag) cluster.centroid_mm[symmetry_plane[p].axis] = 0;
    return cluster;
}

static struct ischia_cluster_set set_of(const struct body *bodies, int count)
{
    struct ischia_cluster_set set = {.has_largest = count > 0};
    for (int b = 0; b < count; b++) {
        set.volume_mm3 += side_extent(bodies[b].volume_mm3);
        set.count += ISCHIA_QUARTERS_PER_SIDE / joined_images(&bodies[b]);
    }
    if (count > 0) set.largest = cluster_of(&bodies[0]);
    return set;
}

/* Numbers every cell by its body's place in the order of size; rank is scratch, a number a body. */
static void number_cells(const struct strain_field *field, int muscle_cells,
                         const struct body *bodies, int count, const int *parent, int *rank,
                         int *ret_cell_id)
{
    for (int b = 0; b < count; b++) rank[bodies[b].first_cell] = b + 1;
    for (int i = 0; i < field->cell_count; i++) {
        const bool inside = i < muscle_cells && parent[i] >= 0;
        ret_cell_id[i] = NO_CLUSTER;
        if (!inside) continue;
        /* The root is lower than every other cell of its body, so it has its number already. */
        ret_cell_id[i] = parent[i] == i ? rank[i] : ret_cell_id[parent[i]];
    }
}

enum ischia_code clusters_find(const struct mesh *mesh, const struct faces *faces,
                               const struct strain_field *field, enum ischia_criterion criterion,
                               struct ischia_cluster_set *ret_set, int *ret_cell_id,
                               struct ischia_error *err)
{
    const int cells = mesh->muscle_count * HEX_CELLS;
    int *parent = calloc((size_t)cells + 1, sizeof *parent);
    int *body_of = calloc((size_t)cells + 1, sizeof *body_of);
    struct body *bodies = calloc((size_t)cells + 1, sizeof *bodies);
    enum ischia_code code = ISCHIA_OK;
    if (parent == NULL || body_of == NULL || bodies == NULL) {
        code = FAIL(err, ISCHIA_E_MEMORY, "out of memory for clusters among %d cells", cells);
        goto free_work;
    }
    for (int i = 0; i < cells; i++)
        parent[i] = criterion_is_met(criterion, &field->cell[i].strain) ? i : -1;
    unite_neighbours(mesh, faces, parent);
    const int count = sum_bodies(field, cells, parent, bodies, body_of);
    mark_planes(mesh, faces, body_of, bodies);
    qsort(bodies, (size_t)count, sizeof *bodies, by_volume_descending);
    if (ret_cell_id != NULL)
        number_cells(field, cells, bodies, count, parent, body_of, ret_cell_id);
    *ret_set = set_of(bodies, count);
free_work:
    free(bodies);
    free(body_of);
    free(parent);
    return code;
}

enum ischia_code clusters_find_all(const struct mesh *mesh, const struct strain_field *field,
                                   struct ischia_cluster_set ret_sets[ISCHIA_CRITERION_COUNT],
                                   struct ischia_error *err)
{
    struct faces faces;
    struct ischia_cluster_set sets[ISCHIA_CRITERION_COUNT];
    TRY(faces_init(&faces, mesh, err));
    enum ischia_code code = ISCHIA_OK;
    for (int c = 0; code == ISCHIA_OK && c < ISCHIA_CRITERION_COUNT; c++)
        code = clusters_find(mesh, &faces, field, (enum ischia_criterion)c, &sets[c], NULL, err);
    if (code == ISCHIA_OK) memcpy(ret_sets, sets, sizeof sets);
    faces_finish(&faces);
    return code;
}
