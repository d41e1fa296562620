/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_VERIFICATION_SIDES_H
#define ISCHIA_TESTS_VERIFICATION_SIDES_H

#include "solver/axis.h"
#include "solver/path.h"

/* Sides of Table 2 on single meshes, with the numerical choices of the model in the caller's hands:
 * what the studies of this folder share. */

struct side {
    const char *name;
    double param[ISCHIA_PARAM_COUNT]; /* Table 2 of Macron et al. (2020) */
};

/* NULL: there is none of that name here. */
const struct side *side_of(const char *name);

struct ischia_case side_case(const struct side *side, enum ischia_resolution resolution);

struct variant {
    double corner_share, kappa_point_over_mu;
    double stick_factor; /* on what seat.c sets */
};

/* Everything one solve on one mesh needs. */
struct run {
    struct mesh mesh;
    struct assembly assembly;
    struct body body;
    struct seat seat;
    struct equilibrium state;
};

/* At rest. run_finish frees what there is, after a failure too. ISCHIA_E_MEMORY, ISCHIA_E_INPUT. */
ISCHIA_MUST_CHECK enum ischia_code run_init(struct run *r, const struct ischia_case *c,
                                            const struct mesh_divisions *divisions,
                                            const struct variant *v, struct ischia_error *err);
void run_finish(struct run *r); /* a zeroed one is allowed */

struct outcome {
    struct axis_strain strain;
    double eps_max;
    struct path_report path;
    double d_mm, det_F_min;
};

/* What the state of a run says; path is left as it is. */
void run_measure(const struct run *r, struct outcome *ret);

/* The path to the whole force. A path that ends short is an outcome, not an error. */
ISCHIA_MUST_CHECK enum ischia_code solve_on(const struct mesh_divisions *divisions,
                                            const struct ischia_case *c, const struct variant *v,
                                            struct outcome *ret, struct ischia_error *err);

/* True when the path arrived and its energy balance is as good as a result's must be. */
bool is_sound(const struct outcome *o);

#endif
