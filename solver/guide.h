/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_GUIDE_H
#define ISCHIA_SOLVER_GUIDE_H

#include "solver/body.h"
#include "solver/seat.h"

/*
 * The load path that a coarser mesh of the same case went, to lead a finer one along: where the
 * finer mesh has reached an approach of the guide, it goes on by the change that the coarser one
 * underwent (the idea of the full approximation scheme; Brandt 1977). It predicts, and it is what
 * the finer mesh's work is integrated against; the equilibrium that is found owes nothing to it.
 */
struct guide_point {                                /* a converged step of the coarser mesh */
    double d_mm, force_N, stiffness_N_mm, work_Nmm; /* approach; of the seat, quarter model      */
    double (*u_mm)[3];                              /* [node]                                    */
    double (*pressure)[3]; /* [node] contact force over its spring's stiffness (seat.h), mm;
                              mean pressure of the tissue, MPa; 0                                */
};

struct guide {
    struct mesh_divisions divisions; /* of the coarser mesh                          */
    int count, capacity;
    struct guide_point *point; /* in the order of the path                     */
    bool complete;             /* the last point is at the force of the target */
    int stride;                /* a finer mesh is led from every stride-th point to the next */
};

void guide_finish(struct guide *guide); /* a zeroed one is allowed */

/* Appends a state of the coarser mesh: `numbers` but for the fields, which are copied from body,
 * seat and u_mm[node]. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code
guide_record(struct guide *guide, const struct guide_point *numbers, const struct body *body,
             const struct seat *seat, const double (*u_mm)[3], struct ischia_error *err);

/* The seat's force, its slope and its work at an approach, between the guide's points by cubics and
 * beyond the last by a straight line; all zero without a guide (NULL, or no points). */
struct guide_load {
    double force_N, stiffness_N_mm, work_Nmm;
};
struct guide_load guide_load_at(const struct guide *guide, double d_mm);

/* Where a finer mesh is on its guide. */
struct guide_cursor {
    const struct guide *guide; /* NULL: there is none                                  */
    int next;                  /* the point ahead                                      */
    struct guide_place {       /* a point, carried to the finer mesh                   */
        double (*u_mm)[3];     /* [node]                                               */
        double (*pressure)[3]; /* [node]                                               */
    } here, ahead;             /* here: the point before next, or rest                 */
};

/* At rest, looking at the first point. guide may be NULL. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code guide_cursor_init(struct guide_cursor *ret,
                                                     const struct guide *guide, int node_count,
                                                     struct ischia_error *err);
void guide_cursor_finish(struct guide_cursor *cursor);

/* The approach of the point ahead; HUGE_VAL when there is none. */
double guide_next_mm(const struct guide_cursor *cursor);
/* True when the point ahead is the last and bears the whole force. */
bool guide_is_last(const struct guide_cursor *cursor);
/* Carries the point ahead to the finer mesh. */
void guide_look_ahead(struct guide_cursor *cursor, const struct mesh *mesh);
/* The point ahead was reached, after guide_look_ahead: it becomes `here`. */
void guide_advance(struct guide_cursor *cursor);

#endif
