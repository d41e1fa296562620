/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_VTU_H
#define ISCHIA_SOLVER_VTU_H

#include <stdio.h>

#include "solver/case.h"
#include "solver/error.h"
#include "solver/mesh.h"

/*
 * The deformed quarter model as a VTK XML UnstructuredGrid (.vtu; ParaView, VTK, meshio), in mm.
 *
 * Points are DEFORMED positions; the point array `displacement` gives the unloaded ones back
 * (position - displacement, or ParaView's Warp By Vector with scale -1). The cells are the mesh's
 * hexahedra as they were solved, with these arrays:
 *
 *   tissue             0 muscle, 1 fat, 2 skin
 *   E_shear, E_comp    GREEN-LAGRANGE, volume mean of the element's eight integration points
 *   eps_shear          ENGINEERING, the same mean
 *   E_shear_max, E_comp_max, eps_shear_max    the largest of the eight; over the muscle these
 *                      reach the maxima that the result reports
 *   cluster            the cluster over both thresholds that holds most of the element: 1 the
 *                      largest, 2 the next, ...; 0 none (clusters are of integration-point cells)
 *   cluster_volume_mm3 how much of the element's unloaded volume lies in any such cluster; the
 *                      sum times four is the reported volume
 *
 * The seven inputs are in the file's field data, as text; the model's name and version in a comment
 * at its top. All other numbers are base64 doubles and integers, little-endian on every machine:
 * the same field gives the same bytes.
 */

/* displacement_mm: [node_count][3], flat, finite. ISCHIA_E_MEMORY, ISCHIA_E_IO. */
ISCHIA_MUST_CHECK enum ischia_code vtu_write(FILE *out, const struct ischia_case *c,
                                             const struct mesh *mesh, const double *displacement_mm,
                                             struct ischia_error *err);

#endif
