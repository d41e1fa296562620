/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_CLUSTERS_H
#define ISCHIA_SOLVER_CLUSTERS_H

#include "solver/error.h"
#include "solver/faces.h"
#include "solver/mesh.h"
#include "solver/result.h"
#include "solver/strain.h"

/*
 * Connected muscle over the damage thresholds, on GREEN-LAGRANGE strain.
 *
 * The pieces that connect are integration-point cells, not whole elements: each hexahedron is eight
 * cells, one for each Gauss point, of that point's strain and volume (weight x det J, so that
 * cell volumes sum to the exact tissue volume). Whole elements would round a cluster's border to
 * the element size, and would need a rule for one strain out of eight; cells use the strains
 * that the solver computed, as they are, and resolve the border twice as finely in each direction.
 *
 * Cells connect through shared faces: inside an element, and across a face shared by two elements
 * where they sit at the same node. Touching at an edge or a corner does not connect.
 *
 * The quarter model stands for the whole side. A cluster with a face on one symmetry plane is one
 * body with its mirror image across it, so the side holds two such bodies of twice its volume;
 * with faces on both planes it is one body of four times its volume; with none, four bodies of its
 * own volume. All volumes, counts and centroids are of such whole-side bodies, unloaded; the
 * centroid of a body that its images join lies on the planes that join them, any other is given
 * for the image at x >= 0, y >= 0.
 */

extern const char *const criterion_names[ISCHIA_CRITERION_COUNT]; /* "shear", ... */

/* True when the strains are over the thresholds that the criterion names (strictly). */
bool criterion_is_met(enum ischia_criterion criterion, const struct strain_measures *strain);

enum { NO_CLUSTER = 0 };

/*
 * Finds the clusters of one criterion in O(cells). ret_cell_id (NULL allowed) has room for
 * field->cell_count numbers: 1 for the largest body, 2 for the next, ...; NO_CLUSTER elsewhere and
 * in all other tissue. ISCHIA_E_MEMORY; on error the outputs are untouched.
 */
ISCHIA_MUST_CHECK enum ischia_code
clusters_find(const struct mesh *mesh, const struct faces *faces, const struct strain_field *field,
              enum ischia_criterion criterion, struct ischia_cluster_set *ret_set, int *ret_cell_id,
              struct ischia_error *err);

/* The clusters of every criterion, indexed by it. ISCHIA_E_MEMORY; on error ret is untouched. */
ISCHIA_MUST_CHECK enum ischia_code
clusters_find_all(const struct mesh *mesh, const struct strain_field *field,
                  struct ischia_cluster_set ret_sets[ISCHIA_CRITERION_COUNT],
                  struct ischia_error *err);

#endif
