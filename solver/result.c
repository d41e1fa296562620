/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/result.h"

#include <math.h>

const char *ischia_reason_name(enum ischia_reason reason)
{
    switch (reason) {
    case ISCHIA_CONVERGED:
        return "converged";
    case ISCHIA_NOT_STARTED:
        return "not_started";
    case ISCHIA_DIVERGED_STEP:
        return "diverged_step";
    case ISCHIA_DIVERGED_ITERATIONS:
        return "diverged_iterations";
    case ISCHIA_DIVERGED_LINEAR:
        return "diverged_linear";
    case ISCHIA_DIVERGED_CHECKS:
        return "diverged_checks";
    }
    return "unknown";
}

static bool in_range(double value, double min, double max)
{
    return isfinite(value) && value >= min && value <= max;
}

static bool strain_is_valid(const struct ischia_strain *s)
{
    return in_range(s->eps_max, 0, 1e3) && in_range(s->eps_max_depth_mm, 0, 1e3) &&
           in_range(s->E_shear_max, 0, 1e6) && in_range(s->E_comp_max, 0, 0.5);
}

static bool clusters_are_valid(const struct ischia_result *r)
{
    for (int k = 0; k < ISCHIA_CRITERION_COUNT; k++) {
        const struct ischia_cluster_set *set = &r->clusters[k];
        if (!in_range(set->volume_mm3, 0, 1e9) || set->count < 0) return false;
        if (set->has_largest != (set->count > 0)) return false;
        if (set->has_largest &&
            !in_range(set->largest.volume_mm3, 0, set->volume_mm3 * (1 + 1e-12)))
            return false;
    }
    return true;
}

bool ischia_result_is_valid(const struct ischia_result *r)
{
    const struct ischia_seat *seat = &r->seat;
    return strain_is_valid(&r->strain) && clusters_are_valid(r) &&
           in_range(seat->displacement_mm, 0, 1e3) && in_range(seat->contact_area_mm2, 0, 1e7) &&
           in_range(seat->mean_pressure_kPa, 0, 1e6) && in_range(seat->peak_pressure_kPa, 0, 1e6) &&
           r->load_curve_count > 0 && r->load_curve_count <= ISCHIA_LOAD_POINTS_MAX;
}
