/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_SECTION_SVG_H
#define ISCHIA_SOLVER_SECTION_SVG_H

#include <stdio.h>

#include "solver/case.h"
#include "solver/error.h"
#include "solver/mesh.h"
#include "solver/solver.h"

/*
 * The two symmetry sections of the deformed whole side as one figure: y = 0 (the plane of R2) and
 * x = 0 (the plane of R1), each drawn with its mirror image, at one scale. Muscle is coloured by
 * GREEN-LAGRANGE shear strain, always on the same scale (0 to 2) so that figures compare; the
 * contour of the damage threshold 0.75 is a line; tissue without colour is grey. With title and
 * description for screen readers, scale bar and colour bar; readable in grey print; all words are
 * the labels'. Fixed decimals: the same field and labels give the same bytes.
 */

/* displacement_mm: [node_count][3], flat, finite. ISCHIA_E_MEMORY, ISCHIA_E_IO. */
ISCHIA_MUST_CHECK enum ischia_code
section_svg_write(FILE *out, const struct ischia_case *c, const struct mesh *mesh,
                  const double *displacement_mm, const struct ischia_section_labels *labels,
                  struct ischia_error *err);

#endif
