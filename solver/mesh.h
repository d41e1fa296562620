/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_MESH_H
#define ISCHIA_SOLVER_MESH_H

#include <stdbool.h>

#include "solver/case.h"
#include "solver/error.h"

/*
 * The quarter model (x >= 0, y >= 0; mm; z up; z = 0 the outer skin) as 8-node hexahedra.
 *
 * Five structured blocks whose topology depends on the divisions alone, never on the seven inputs:
 * three blocks of muscle between the bone's bowl and the outer faces (below, +x, +y; they meet
 * along the line from the bowl to the box' corner), and fat and skin extruded below.
 */

enum tissue { TISSUE_MUSCLE, TISSUE_FAT, TISSUE_SKIN, TISSUE_COUNT };
extern const char *const tissue_names[TISSUE_COUNT];

/* Bits of mesh.node_flags. */
enum node_flag {
    NODE_ON_BONE = 1,  /* tied to the rigid bone                                    */
    NODE_ON_X0 = 2,    /* symmetry plane x = 0: u_x = 0                             */
    NODE_ON_Y0 = 4,    /* symmetry plane y = 0: u_y = 0                             */
    NODE_ON_SEAT = 8,  /* outer skin or outer side: may touch the seat              */
    NODE_ON_PLATE = 16 /* moves with the bone in z and is free in x and y: a body to verify with */
};

/* How finely the blocks are divided. All counts are of elements. */
struct mesh_divisions {
    int across; /* core patch under the bone, in x and in y (also fat and skin)     */
    int around; /* from the core patch to the rim, along the bone's bowl            */
    int radial; /* from the bone to the outer faces of the muscle                   */
    int fat;    /* through the fat                                                  */
    int skin;   /* through the skin                                                 */
};
extern const struct mesh_divisions mesh_divisions[ISCHIA_RESOLUTION_COUNT];

struct mesh {
    int node_count;
    int element_count;
    int muscle_count;          /* elements 0 ... muscle_count - 1 are the muscle's */
    double (*X_mm)[3];         /* [node_count] unloaded positions                              */
    int (*hex)[8];             /* [element_count] VTK order: 0-3 one face, 4-7 the opposite,
                                    positive volume                                              */
    unsigned char *tissue;     /* [element_count] enum tissue                                  */
    unsigned char *node_flags; /* [node_count] enum node_flag                                  */
    int (*seat_quad)[4];       /* [seat_quad_count] faces that may touch: outer skin first,
                                    then the sides; normals point out of the body                */
    int seat_quad_count;
    int outer_skin_quad_count; /* the first of them that lie on z = 0                          */
    int (*axis)[5];            /* [axis_count] nodes on x = y = 0 from the tip down through the
                                    muscle, each with its first and second neighbours along +x
                                    and along +y: {axis, x1, x2, y1, y2}                         */
    int axis_count;
    struct mesh_divisions divisions;
    double tip_z_mm, top_z_mm, muscle_z_mm, half_width_mm;
};

/* Builds the local model's mesh for a valid case. On error *ret is untouched. */
ISCHIA_MUST_CHECK enum ischia_code mesh_local_init(struct mesh *ret, const struct ischia_case *c,
                                                   const struct mesh_divisions *divisions,
                                                   struct ischia_error *err);

/* Number of nodes of the local mesh with these divisions. */
int mesh_local_node_count(const struct mesh_divisions *divisions);

void mesh_finish(struct mesh *mesh); /* frees the arrays; a zeroed mesh is allowed */

/* True when the elements' nodes and tissues are in range, every element has positive volume at its
 * corners, and every node belongs to an element. False also when there is no memory to look. */
bool mesh_is_valid(const struct mesh *mesh);

#endif
