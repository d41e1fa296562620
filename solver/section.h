/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_SECTION_H
#define ISCHIA_SOLVER_SECTION_H

#include "solver/error.h"
#include "solver/mesh.h"
#include "solver/strain.h"

/*
 * The geometry behind the section drawing: what the two symmetry planes cut out of the deformed
 * quarter model, the shear strain recovered at the nodes, and contours of it.
 */

enum section_plane { SECTION_Y0, SECTION_X0, SECTION_PLANE_COUNT };

struct section_quad {
    int node[4]; /* round the quad */
    enum tissue tissue;
};

struct section {
    enum section_plane plane;
    struct section_quad *quad; /* [quad_count] the element faces on the plane                    */
    int quad_count;
    int *bone_node; /* [bone_node_count] along the bone from the axis to the rim               */
    int bone_node_count;
};

/* ISCHIA_E_MEMORY; on error *ret is untouched. Freed with section_finish. */
ISCHIA_MUST_CHECK enum ischia_code section_init(struct section *ret, const struct mesh *mesh,
                                                enum section_plane plane, struct ischia_error *err);
void section_finish(struct section *section); /* a zeroed one is allowed */

/* Deformed position of a node in a section: outward from the axis, and up, in mm. */
void section_position(const struct section *section, const struct mesh *mesh,
                      const double *displacement_mm, int node, double ret_at_mm[2]);

/*
 * GREEN-LAGRANGE shear strain at the nodes: the volume mean over the muscle's integration-point
 * cells at the node (no extrapolation: values stay within those of the points). ret_value has
 * room for node_count numbers; nodes without muscle get 0. ISCHIA_E_MEMORY.
 */
ISCHIA_MUST_CHECK enum ischia_code
section_recover_shear(const struct mesh *mesh, const struct strain_field *field, double *ret_value,
                      struct ischia_error *err);

/* A corner of a triangle over which the value is linear. */
struct section_vertex {
    double at_mm[2];
    double value;
};

enum { SECTION_TRIANGLES = 4, SECTION_CLIPPED_MAX = 4 };

/* Divides a quad into triangles round its centre, which has the mean of its corners. */
void section_divide(const struct section_vertex quad[4],
                    struct section_vertex ret_triangle[SECTION_TRIANGLES][3]);

/* The part of a triangle where value >= level: a convex polygon of 0, 3 or 4 corners, in the
 * triangle's sense of rotation. Returns the number of corners. */
int section_clip(const struct section_vertex triangle[3], double level,
                 struct section_vertex ret_polygon[SECTION_CLIPPED_MAX]);

/* The straight piece of the contour value = level inside a triangle; false when there is none. */
bool section_contour(const struct section_vertex triangle[3], double level,
                     struct section_vertex ret_end[2]);

#endif
