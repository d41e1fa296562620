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
    int n;              /* equations, d not counted                                            */
    int seat_first;     /* the first of those of the nodes that rest on the seat: the last ones */
    int (*equation)[3]; /* [node] equation of each component, or EQUATION_*                    */
    int entries;        /* of the lower triangle of an element's matrix                        */
    int *scatter;       /* [element][entries] place in the values of each, row by row; -1: none */
    int (*diagonal)[3]; /* [node] place of the diagonal entry of each component, or -1         */
    int *tangential;    /* [node] place of the (x, y) entry, or -1                             */
    struct linear *linear;
};

/* Which nodes act on each other: those of an element. */
struct connectivity {
    int elements;
    int nodes;       /* of an element, at most ELEMENT_NODES_MAX */
    const int *node; /* [element][nodes] indices into the mesh's */
};
enum { ELEMENT_NODES_MAX = 27 };

/* Numbers the equations of a valid mesh's nodes, and analyses their pattern. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code assembly_init(struct assembly *ret, const struct mesh *mesh,
                                                 struct ischia_error *err);
/* The same for other elements on these nodes than the mesh's hexahedra. */
ISCHIA_MUST_CHECK enum ischia_code
assembly_init_elements(struct assembly *ret, const struct mesh *mesh,
                       const struct connectivity *elements, struct ischia_error *err);
void assembly_finish(struct assembly *assembly); /* a zeroed one is allowed */

/* Equations of an element's nodes in the order of its matrix, to ret[3 * nodes]: component * nodes
 * + node. */
void assembly_element_equations(const struct assembly *assembly, const int *node, int nodes,
                                int *ret);

/* Where the entries of an element's matrix belong: [entries]. */
const int *assembly_element_scatter(const struct assembly *assembly, int element);

#endif
