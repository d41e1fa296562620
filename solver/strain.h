/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STRAIN_H
#define ISCHIA_SOLVER_STRAIN_H

#include "solver/error.h"
#include "solver/mesh.h"

/*
 * Strain measures from the principal stretches of F = I + du/dX: the full gradient at each
 * integration point, with no averaging over the element (the mean-dilatation element averages J in
 * its stress only, so J scatters within an element here).
 *
 * Two families that must never be compared: GREEN-LAGRANGE E = (stretch^2 - 1)/2, on which the
 * damage thresholds are, and ENGINEERING eps = stretch - 1, in which the paper's eps_max is.
 */

struct strain_measures {
    double green_lagrange_shear;       /* half of the largest difference of two principal E   */
    double green_lagrange_compression; /* magnitude of the smallest principal E when that is
                                          compressive, 0 otherwise; never above 0.5           */
    double engineering_shear;          /* half of the largest difference of two principal eps */
};

/* The principal Green-Lagrange strain of a principal stretch, (stretch^2 - 1)/2. */
double green_lagrange(double stretch);

/* All measures at once. stretch: the principal stretches, largest first, none negative. */
struct strain_measures strain_measures_of(const double stretch[3]);

/* An element is eight cells, one to an integration point; cell 8 e + q is point q of element e. */
struct strain_cell {
    struct strain_measures strain;
    double volume_mm3; /* unloaded */
    double X_mm[3];    /* unloaded position of the integration point */
};

struct strain_field {
    int cell_count;           /* 8 x the mesh's element_count; the muscle's cells come first */
    struct strain_cell *cell; /* [cell_count], owned */
};

/*
 * Strains at every integration point of the mesh. displacement_mm: [node_count][3], flat.
 * ISCHIA_E_MEMORY; on error *ret is untouched. Freed with strain_field_finish.
 */
ISCHIA_MUST_CHECK enum ischia_code
strain_field_init(struct strain_field *ret, const struct mesh *mesh, const double *displacement_mm,
                  struct ischia_error *err);
void strain_field_finish(struct strain_field *field); /* a zeroed one is allowed */

/* The largest Green-Lagrange strains over the integration points of the muscle: the bits of the
 * field's own maxima, without the field. displacement_mm as for it. */
struct strain_maxima {
    double green_lagrange_shear;
    double green_lagrange_compression;
};
struct strain_maxima strain_muscle_maxima(const struct mesh *mesh, const double *displacement_mm);

/* Unloaded muscle volume of the quarter model. */
double strain_muscle_volume_mm3(const struct mesh *mesh, const struct strain_field *field);

#endif
