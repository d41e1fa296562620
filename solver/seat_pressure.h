/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_SEAT_PRESSURE_H
#define ISCHIA_SOLVER_SEAT_PRESSURE_H

#include "solver/error.h"
#include "solver/mesh.h"
#include "solver/result.h"

/*
 * Contact area and pressures on the seat, from the nodal contact forces of a solved state.
 *
 * Each node owns the part of the deformed seat faces that its shape function gives it, projected on
 * the seat (faces that do not look down own nothing). The contact area is the sum over the nodes
 * that press: where a face is only partly in contact this puts the border half way between the
 * last node that presses and the first that does not, which errs by at most half a face and to
 * neither side on average. A node's pressure is its force over its area.
 */

struct seat_state {
    const double *displacement_mm; /* [node_count][3], flat                                    */
    const double *normal_force_N;  /* [node_count] of the quarter model; > 0 exactly where the
                                      node presses on the seat                                 */
};

/*
 * Sets contact area (whole side), mean pressure (total force over contact area) and peak pressure
 * (the highest at a node of the outer skin: folded sides carry little, and their steep faces own
 * almost no area) of *ret_seat, 0 without contact; its displacement_mm is left alone.
 * ISCHIA_E_MEMORY; on error *ret_seat is untouched.
 */
ISCHIA_MUST_CHECK enum ischia_code
seat_pressure(const struct mesh *mesh, const struct seat_state *state, struct ischia_seat *ret_seat,
              struct ischia_error *err);

#endif
