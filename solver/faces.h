/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_FACES_H
#define ISCHIA_SOLVER_FACES_H

#include "solver/error.h"
#include "solver/mesh.h"

/*
 * Which faces of the mesh's hexahedra are shared, and by whom. A face is one number, 6 x element +
 * side; an element's face and its corners are numbered as CalculiX and Abaqus do (S1 ... S6), each
 * face's normal pointing out of the element.
 */

enum { HEX_SIDES = 6, FACE_CORNERS = 4, FACE_ALONE = -1 };

extern const int hex_side_corner[HEX_SIDES][FACE_CORNERS]; /* corners 0 ... 7 of each side */

struct faces {
    int count;   /* 6 x element_count                                                    */
    int *across; /* [count] the same face seen from the element across, or FACE_ALONE     */
};

/* O(elements). ISCHIA_E_MEMORY; on error *ret is untouched. Freed with faces_finish. */
ISCHIA_MUST_CHECK enum ischia_code faces_init(struct faces *ret, const struct mesh *mesh,
                                              struct ischia_error *err);
void faces_finish(struct faces *faces); /* a zeroed one is allowed */

/* The four nodes of a face. */
void face_nodes(const struct mesh *mesh, int face, int ret_nodes[FACE_CORNERS]);

/* True when all four nodes of the face carry the flag: the face lies on that boundary. */
bool face_has_flag(const struct mesh *mesh, int face, enum node_flag flag);

#endif
