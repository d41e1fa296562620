/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_SOLVER_H
#define ISCHIA_SOLVER_SOLVER_H

#include <stdio.h>

#include "solver/case.h"
#include "solver/error.h"
#include "solver/result.h"

/*
 * The one door to the mechanics: case in, result out. One solver keeps what is reusable from case
 * to case (sparsity pattern, scatter map, symbolic factorisation); it serves one solve at a time
 * and may be used from any one thread. The same case gives the same bits, whatever was solved
 * before.
 */

struct ischia_solver;

struct ischia_progress {
    double fraction;      /* 0 ... 1, never decreasing within a solve          */
    int load_step;        /* 1 ...                                             */
    int newton_iteration; /* within the load step                              */
    double F_N;           /* whole-side force reached so far                   */
    const char *message;  /* short English phrase, valid during the call only  */
};

/* Called between Newton iterations, from inside ischia_solve. Return false to cancel. */
struct ischia_observer {
    bool (*on_progress)(void *context, const struct ischia_progress *progress);
    void *context;
};

/* The deformed state: enough, with its case, to draw or export it again later. */
struct ischia_field {
    size_t node_count;
    double *displacement_mm; /* [node_count][3], in the order of the mesh that the case defines;
                                seat frame: outer skin starts at z = 0, the seat stays there */
};

/* *ret_solver is the caller's to destroy. ISCHIA_E_MEMORY when it cannot be made. */
ISCHIA_MUST_CHECK enum ischia_code ischia_solver_create(struct ischia_solver **ret_solver,
                                                        struct ischia_error *err);
void ischia_solver_destroy(struct ischia_solver *solver); /* NULL allowed */

/* Drops what is kept of the last solve, a person's side: the next starts from rest. */
void ischia_solver_forget(struct ischia_solver *solver);

/*
 * Solves a valid case (ischia_case_is_valid, asserted). The side of the last solve with a larger
 * force goes on from there where its path allows it: the same bits, sooner.
 *
 * ISCHIA_OK: *ret_result is filled, converged or not: look at numerics.reason. ret_field (NULL
 * allowed) then holds the displacements, to be freed with ischia_field_finish; it is empty unless
 * converged. ISCHIA_E_CANCELLED when the observer returned false; ISCHIA_E_MEMORY; on any error the
 * outputs are untouched. observer may be NULL.
 */
ISCHIA_MUST_CHECK enum ischia_code
ischia_solve(struct ischia_solver *solver, const struct ischia_case *c,
             const struct ischia_observer *observer, struct ischia_result *ret_result,
             struct ischia_field *ret_field, struct ischia_error *err);

void ischia_field_finish(struct ischia_field *field); /* NULL and empty allowed */

/* What the section's picture says, in the reader's language. All are needed, and borrowed. */
struct ischia_section_labels {
    const char *language;        /* its BCP 47 tag                                         */
    const char *title, *heading; /* for those who hear the picture, and above it           */
    const char *description;     /* for those who hear it: all that there is to see        */
    const char *plane[2];        /* y = 0, x = 0                                           */
    const char *strain, *index;  /* Green-Lagrange shear strain; the index of its symbol E */
    const char *threshold;       /* in front of "E = 0.75"                                 */
    const char *bone, *fat, *skin, *seat;
    char decimal_mark;
};
/* Where the scale of colours ends, open to all higher strains. */
#define ISCHIA_SECTION_E_SHEAR_MAX 2.0

/*
 * Writers of a solved field; each rebuilds the mesh from the case. ISCHIA_E_INPUT when the field
 * does not fit the case's mesh, ISCHIA_E_IO when the stream fails. The stream stays the caller's.
 */
ISCHIA_MUST_CHECK enum ischia_code ischia_write_vtu(FILE *out, const struct ischia_case *c,
                                                    const struct ischia_field *field,
                                                    struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code
ischia_write_section_svg(FILE *out, const struct ischia_case *c, const struct ischia_field *field,
                         const struct ischia_section_labels *labels, struct ischia_error *err);
/* The same mesh, materials, contact and load as an Abaqus/CalculiX input deck. */
ISCHIA_MUST_CHECK enum ischia_code ischia_write_inp(FILE *out, const struct ischia_case *c,
                                                    struct ischia_error *err);

/* Compares every hand-written derivative with finite differences, a line of text each, to out.
 * ISCHIA_E_NUMERIC when one disagrees. */
ISCHIA_MUST_CHECK enum ischia_code ischia_check_tangents(FILE *out, struct ischia_error *err);

#endif
