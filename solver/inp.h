/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_INP_H
#define ISCHIA_SOLVER_INP_H

#include <stdio.h>

#include "solver/error.h"
#include "solver/mesh.h"

/*
 * A mesh, its materials, contact and load as an input deck for CalculiX (checked with 2.20): mm, N,
 * MPa. Abaqus reads the same keywords, but takes only the first number after *FRICTION, and wants
 * C3D8H where the bulk ratio is high.
 *
 * CalculiX has no mixed hexahedron: its C3D8 locks when bulk modulus / shear modulus is
 * large, so compare results at a ratio of 10 to 20.
 *
 * What the deck says: C3D8 hexahedra in element sets MUSCLE, FAT, SKIN; symmetry on node sets SYMX
 * and SYMY; nodes of set BONE move together in z with one reference node (set BONEREF) and, unless
 * the bone slides, not at all in x and y; the seat is a fixed block (set SEAT) whose top face is
 * the master of a node-to-surface contact with Coulomb friction. The body must start on or above
 * z = 0, touching the seat when driven by a force. Results wanted: displacements (set BODY), total
 * force on SEAT, stresses and Green-Lagrange strains of the body, as text (.dat) and for viewers
 * (.frd).
 */

enum inp_drive {
    INP_FORCE_N,        /* the bone is pushed down by drive_value newton, of the quarter model */
    INP_DISPLACEMENT_MM /* the bone is moved down by drive_value mm                            */
};

struct inp_tissue {
    double mu_MPa;    /* initial shear modulus                        */
    double kappa_MPa; /* bulk modulus: U = kappa / 2 (J - 1)^2        */
};

struct inp_model {
    struct inp_tissue tissue[TISSUE_COUNT];
    double alpha;    /* W = 2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3) */
    double friction; /* Coulomb's coefficient; 0 leaves friction out           */
    /* CalculiX's contact is by penalty: normal stiffness and stick slope in MPa/mm; 0 and 0 take
     * 100 and 10, with which blocks converge. */
    double contact_stiffness_MPa_mm, stick_slope_MPa_mm;
    bool bone_slides; /* BONE is held in z only: uniaxial blocks, for checks    */
    enum inp_drive drive;
    double drive_value;
    const char *title; /* one line, for the reader of the deck */
};

/* ISCHIA_E_MEMORY, ISCHIA_E_IO. The stream stays the caller's. */
ISCHIA_MUST_CHECK enum ischia_code inp_write(FILE *out, const struct mesh *mesh,
                                             const struct inp_model *model,
                                             struct ischia_error *err);

#endif
