/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/section.h"

#include <stdlib.h>
#include <string.h>

#include "solver/faces.h"
#include "solver/kinematics.h"

/* The nodes' flag of each section plane, and the coordinate that runs outward in it. */
static const struct {
    enum node_flag flag;
    int outward;
} planes[SECTION_PLANE_COUNT] = {
    [SECTION_Y0] = {NODE_ON_Y0, 0},
    [SECTION_X0] = {NODE_ON_X0, 1},
};

/* Fills quads (NULL: only counts) and returns how many element faces lie on the plane. */
static int collect_quads(const struct mesh *mesh, enum section_plane plane,
                         struct section_quad *quads)
{
    int count = 0;
    for (int face = 0; face < HEX_SIDES * mesh->element_count; face++) {
        if (!face_has_flag(mesh, face, planes[plane].flag)) continue;
        if (quads != NULL) {
            face_nodes(mesh, face, quads[count].node);
            quads[count].tissue = (enum tissue)mesh->tissue[face / HEX_SIDES];
        }
        count++;
    }
    return count;
}

static int collect_bone_nodes(const struct mesh *mesh, enum section_plane plane, int *nodes)
{
    const unsigned wanted = NODE_ON_BONE | (unsigned)planes[plane].flag;
    int count = 0;
    for (int n = 0; n < mesh->node_count; n++) {
        if ((mesh->node_flags[n] & wanted) != wanted) continue;
        if (nodes != NULL) nodes[count] = n;
        count++;
    }
    return count;
}

/* True when bone node a comes before b on the way from the axis to the rim. */
static bool is_nearer_axis(const struct mesh *mesh, enum section_plane plane, int a, int b)
{
    const double *A = mesh->X_mm[a], *B = mesh->X_mm[b];
    const int outward = planes[plane].outward;
    return A[outward] < B[outward] || (A[outward] == B[outward] && A[2] < B[2]);
}

/* Insertion sort: a few dozen nodes. */
static void sort_bone_nodes(const struct mesh *mesh, struct section *section)
{
    for (int i = 1; i < section->bone_node_count; i++) {
        const int node = section->bone_node[i];
        int at = i;
        for (; at > 0 && is_nearer_axis(mesh, section->plane, node, section->bone_node[at - 1]);
             at--)
            section->bone_node[at] = section->bone_node[at - 1];
        section->bone_node[at] = node;
    }
}

enum ischia_code section_init(struct section *ret, const struct mesh *mesh,
                              enum section_plane plane, struct ischia_error *err)
{
    struct section s = {.plane = plane,
                        .quad_count = collect_quads(mesh, plane, NULL),
                        .bone_node_count = collect_bone_nodes(mesh, plane, NULL)};
    s.quad = calloc((size_t)s.quad_count + 1, sizeof *s.quad);
    s.bone_node = calloc((size_t)s.bone_node_count + 1, sizeof *s.bone_node);
    if (s.quad == NULL || s.bone_node == NULL) {
        section_finish(&s);
        return FAIL(err, ISCHIA_E_MEMORY, "out of memory for a section");
    }
    (void)collect_quads(mesh, plane, s.quad);
    (void)collect_bone_nodes(mesh, plane, s.bone_node);
    sort_bone_nodes(mesh, &s);
    *ret = s;
    return ISCHIA_OK;
}

void section_finish(struct section *section)
{
    free(section->quad);
    free(section->bone_node);
    *section = (struct section){0};
}

void section_position(const struct section *section, const struct mesh *mesh,
                      const double *displacement_mm, int node, double ret_at_mm[2])
{
    const int axis[2] = {planes[section->plane].outward, 2};
    for (int k = 0; k < 2; k++)
        ret_at_mm[k] =
            mesh->X_mm[node][axis[k]] + displacement_mm[3 * (size_t)node + (size_t)axis[k]];
}

enum ischia_code section_recover_shear(const struct mesh *mesh, const struct strain_field *field,
                                       double *ret_value, struct ischia_error *err)
{
    const size_t nodes = (size_t)mesh->node_count;
    double *volume = calloc(nodes, sizeof *volume);
    CHECK(volume != NULL, err, ISCHIA_E_MEMORY, "out of memory for strains at %zu nodes", nodes);
    memset(ret_value, 0, nodes * sizeof *ret_value);
    for (int i = 0; i < mesh->muscle_count * HEX_CELLS; i++) {
        const struct strain_cell *cell = &field->cell[i];
        const int node = mesh->hex[i / HEX_CELLS][i % HEX_CELLS];
        volume[node] += cell->volume_mm3;
        ret_value[node] += cell->volume_mm3 * cell->strain.green_lagrange_shear;
    }
    for (size_t n = 0; n < nodes; n++)
        if (volume[n] > 0) ret_value[n] /= volume[n];
    free(volume);
    return ISCHIA_OK;
}

void section_divide(const struct section_vertex quad[4],
                    struct section_vertex ret_triangle[SECTION_TRIANGLES][3])
{
    struct section_vertex centre = {.value = 0};
    for (int a = 0; a < 4; a++) {
        centre.value += quad[a].value / 4;
        for (int k = 0; k < 2; k++) centre.at_mm[k] += quad[a].at_mm[k] / 4;
    }
    for (int a = 0; a < 4; a++) {
        ret_triangle[a][0] = quad[a];
        ret_triangle[a][1] = quad[(a + 1) % 4];
        ret_triangle[a][2] = centre;
    }
}

static struct section_vertex crossing(const struct section_vertex *a,
                                      const struct section_vertex *b, double level)
{
    const double t = (level - a->value) / (b->value - a->value);
    struct section_vertex v = {.value = level};
    for (int k = 0; k < 2; k++) v.at_mm[k] = (1 - t) * a->at_mm[k] + t * b->at_mm[k];
    return v;
}

int section_clip(const struct section_vertex triangle[3], double level,
                 struct section_vertex ret_polygon[SECTION_CLIPPED_MAX])
{
    int count = 0;
    for (int i = 0; i < 3; i++) {
        const struct section_vertex *a = &triangle[i], *b = &triangle[(i + 1) % 3];
        if (a->value >= level) ret_polygon[count++] = *a;
        if ((a->value >= level) != (b->value >= level))
            ret_polygon[count++] = crossing(a, b, level);
    }
    return count;
}

bool section_contour(const struct section_vertex triangle[3], double level,
                     struct section_vertex ret_end[2])
{
    int count = 0;
    for (int i = 0; i < 3; i++) {
        const struct section_vertex *a = &triangle[i], *b = &triangle[(i + 1) % 3];
        if ((a->value >= level) != (b->value >= level)) ret_end[count++] = crossing(a, b, level);
    }
    return count == 2;
}
