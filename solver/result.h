/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_RESULT_H
#define ISCHIA_SOLVER_RESULT_H

#include <stdbool.h>
#include <stddef.h>

/*
 * What a solve says, as plain numbers: volumes and areas are of the WHOLE side (quarter x 4) and
 * volumes are of the unloaded tissue; forces are of the whole side. No pointers: copy freely.
 */

/* Why the load path ended: positive converged, negative not (after PETSc's SNES). */
enum ischia_reason {
    ISCHIA_CONVERGED = 1, /* residual, det F and energy checks all hold               */
    ISCHIA_NOT_STARTED = 0,
    ISCHIA_DIVERGED_STEP = -1,       /* the load step became smaller than its floor              */
    ISCHIA_DIVERGED_ITERATIONS = -2, /* the Newton iteration limit was reached                   */
    ISCHIA_DIVERGED_LINEAR = -3,     /* no positive definite tangent could be factored           */
    ISCHIA_DIVERGED_CHECKS = -4      /* it converged, but a check of the result failed           */
};

/* The muscle damage thresholds, on GREEN-LAGRANGE strain (Ceelen et al. 2008). */
#define ISCHIA_E_SHEAR_THRESHOLD 0.75
#define ISCHIA_E_COMP_THRESHOLD  0.45

struct ischia_strain {
    double eps_max;          /* ENGINEERING max principal shear in muscle on the symmetry axis */
    double eps_max_depth_mm; /* where: below the bone tip, unloaded                            */
    double E_shear_max;      /* GREEN-LAGRANGE, over the integration points of the muscle      */
    double E_comp_max;       /* GREEN-LAGRANGE, magnitude; never above 0.5                     */
};

struct ischia_cluster {
    double volume_mm3;
    double eps_max; /* ENGINEERING, largest in the cluster */
    double E_shear_max;
    double E_comp_max;
    double centroid_mm[3]; /* unloaded; axes as in model docs, z up from the outer skin; a body
                              that its mirror images join has its centroid on the shared planes */
};

struct ischia_cluster_set {
    double volume_mm3;
    int count;
    bool has_largest;
    struct ischia_cluster largest;
};

enum ischia_criterion {
    ISCHIA_OVER_SHEAR,
    ISCHIA_OVER_COMPRESSION,
    ISCHIA_OVER_BOTH,
    ISCHIA_CRITERION_COUNT
};

struct ischia_seat {
    double displacement_mm;
    double contact_area_mm2;
    double mean_pressure_kPa;
    double peak_pressure_kPa;
};

struct ischia_load_point {
    double F_N;
    double displacement_mm;
    double eps_max;
    double E_shear_max;
    double E_comp_max;
};
enum { ISCHIA_LOAD_POINTS_MAX = 150 }; /* one for each load step that a path may take */

struct ischia_numerics {
    enum ischia_reason reason;
    int elements;
    int dof;
    int load_steps;
    int newton_iterations;
    int factorisations;
    double force_residual;  /* |unbalanced force| / F, dimensionless                           */
    double energy_residual; /* (seat work - stored - friction - drag) / seat work, with sign   */
    double det_F_min;       /* over all integration points and corners of elements             */
    double eps_max_error;   /* estimated discretisation error of eps_max, absolute             */
    double last_converged_F_N;
    double wall_s; /* filled in by the program: the solver has no clock               */
    double cpu_s;
    char detail[160]; /* what was tried, when not converged; else the rule of a later attempt   */
};

struct ischia_result {
    struct ischia_strain strain;
    struct ischia_cluster_set clusters[ISCHIA_CRITERION_COUNT];
    double muscle_volume_mm3;
    struct ischia_seat seat;
    struct ischia_load_point load_curve[ISCHIA_LOAD_POINTS_MAX];
    int load_curve_count;
    double threshold_force_shear_N;       /* NaN: the path never crosses it */
    double threshold_force_compression_N; /* NaN: the path never crosses it */
    struct ischia_numerics numerics;
};

/* "converged", "diverged_step", ...: stable words for documents and CSV; never NULL. */
const char *ischia_reason_name(enum ischia_reason reason);

static inline bool ischia_result_converged(const struct ischia_result *r)
{
    return r->numerics.reason > 0;
}

/* True when every number that a converged result shows is finite and inside its physical range
 * (E_comp_max <= 0.5, volumes >= 0, ...). */
bool ischia_result_is_valid(const struct ischia_result *r);

#endif
