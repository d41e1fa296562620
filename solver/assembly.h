/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_ASSEMBLY_H
#define ISCHIA_SOLVER_ASSEMBLY_H

#include "solver/element.h"
#include "solver/error.h"
#include "solver/linear.h"
#include "solver/mesh.h"

/*
 * Numbering, sparsity pattern and scatter map of a mesh: made once for a topology. They depend on
 * node flags, connectivity, and which nodes rest on the seat only, so that they serve every case of
 * one resolution. The equations of the nodes that rest on the seat are the tail of the linear
 * system: contact and friction are solved on what is condensed there (contact.h).
 *
 * Unknowns: the free displacement components, and the approach d of bone and seat, which moves all
 * bone nodes by u_z = -d. d is kept out of the matrix as a border: its column would be dense.
 */

enum { EQUATION_FIXED = -1, EQUATION_BONE = -2 }; /* BONE: u_z = -d */

struct assembly {
    int n;               /* equations, d not counted                                            */
    int seat_first;      /* the first of those of the nodes that rest on the seat: the last ones */
    int (*equation)[3];  /* [node] equation of each component, or EQUATION_*                    */
    int (*scatter)[300]; /* [element] place in the values of each entry of the lower triangle
                             of the element matrix, row by row; -1: none                         */
    int (*diagonal)[3];  /* [node] place of the diagonal entry of each component, or -1         */
    int *tangential;     /* [node] place of the (x, y) entry, or -1                             */
    struct linear *linear;
};

/* Numbers the equations of a valid mesh and analyses their pattern. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code assembly_init(struct assembly *ret, const struct mesh *mesh,
                                                 struct ischia_error *err);
void assembly_finish(struct assembly *assembly); /* a zeroed one is allowed */

/* Equations of an element in the order of its matrix: component * 8 + node. */
void assembly_element_equations(const struct assembly *assembly, const int hex[HEX_NODES],
                                int ret[HEX_DOFS]);

#endif
