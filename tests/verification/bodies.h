/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_BODIES_H
#define ISCHIA_TESTS_BODIES_H

#include "solver/newton.h"

/* Bodies to verify the mechanics on, and everything that one solve of them needs. */

/* A box [0, size] of equal hexahedra, all muscle; faces x = 0, y = 0 are symmetry planes, z = 0 may
 * touch the seat, the top face carries top_flags. To be freed with mesh_finish. */
ISCHIA_MUST_CHECK enum ischia_code block_init(struct mesh *ret, const double size_mm[3],
                                              const int divisions[3], unsigned top_flags,
                                              struct ischia_error *err);

/* A body at rest with its equations, seat and Newton work space. */
struct bench {
    struct mesh mesh;
    struct body body;
    struct assembly assembly;
    struct seat seat;
    struct newton *newton;
    struct equilibrium state;
    double *normal_before_N; /* [node] contact forces at the end of the last step */
    double (*ahead)[3];      /* [node] du/dd at the last equilibrium, which the next starts along */
    double *normal_rate_N_mm; /* [node] of the contact forces, the same */
};

/* Fills a zeroed bench whose mesh is already there, one material for each tissue. On error call
 * bench_finish all the same. */
ISCHIA_MUST_CHECK enum ischia_code bench_init(struct bench *bench,
                                              const struct element_material material[TISSUE_COUNT],
                                              double friction, struct ischia_error *err);
void bench_finish(struct bench *bench); /* mesh included */

/* Moves bone and plate down to d_mm and finds equilibrium there; the friction anchors stay. */
ISCHIA_MUST_CHECK enum ischia_code bench_press(struct bench *bench, double d_mm,
                                               struct ischia_error *err);

/* Finds equilibrium under dead loads in N on every node, bone and plate held, the seat ignored; the
 * load grows in `steps` equal steps. ISCHIA_E_NUMERIC when it does not converge. */
ISCHIA_MUST_CHECK enum ischia_code bench_load(struct bench *bench, const double (*load_N)[3],
                                              int steps, struct ischia_error *err);

/* The energy that slip dissipates at the end of a step, N mm; anchors follow. */
double bench_end_step(struct bench *bench);

#endif
