/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/risk.h"

#include <assert.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>

const struct risk_band_info risk_bands[RISK_BAND_COUNT] = {
    [RISK_BELOW] = {"below", "Muscle strain stays below both damage thresholds."},
    [RISK_SHEAR] = {"shear", "Muscle strain crosses the shear threshold."},
    [RISK_COMPRESSION] = {"compression", "Muscle strain crosses the compression threshold."},
    [RISK_BOTH] = {"both", "Muscle strain crosses both damage thresholds."},
};

const char *const risk_caveats[RISK_CAVEAT_COUNT] = {
    "The damage thresholds come from experiments on animals.",
    ("The local model reads higher than a full model of the same person (RMS difference 0.5 in the "
     "published comparison): it ranks, it does not diagnose."),
    "This is not a medical device.",
};

/* One criterion: what was reached, against what, and where. */
struct crossing {
    const char *name;
    double reached;
    double threshold;
    double volume_mm3;
    double first_crossed_N; /* NaN: never on the load path */
};

/* A peak at a single point counts even when no element as a whole is over the threshold. */
static bool is_crossed(const struct crossing *x)
{
    return x->reached > x->threshold || x->volume_mm3 > 0;
}

__attribute__((format(printf, 2, 3))) static void add_reason(struct risk *risk, const char *format,
                                                             ...)
{
    va_list arguments;
    assert(risk->reason_count < RISK_REASONS_MAX);
    va_start(arguments, format);
    (void)vsnprintf(risk->reason[risk->reason_count++], RISK_REASON_BYTES, format, arguments);
    va_end(arguments);
}

static void explain(struct risk *risk, const struct crossing *x, double muscle_mm3, double F_N)
{
    if (!is_crossed(x))
        add_reason(risk,
                   "Green-Lagrange %s strain in muscle reaches %.3g, under the threshold of %.2f.",
                   x->name, x->reached, x->threshold);
    else if (x->volume_mm3 > 0 && muscle_mm3 > 0)
        add_reason(risk,
                   "Green-Lagrange %s strain in muscle reaches %.3g; it is over the threshold of "
                   "%.2f in %.0f mm³ (%.2g %% of the muscle in the model).",
                   x->name, x->reached, x->threshold, x->volume_mm3,
                   100 * x->volume_mm3 / muscle_mm3);
    else
        add_reason(risk,
                   "Green-Lagrange %s strain in muscle reaches %.3g, over the threshold of %.2f, "
                   "at a point smaller than one element of the model.",
                   x->name, x->reached, x->threshold);
    if (!isnan(x->first_crossed_N))
        add_reason(risk, "The %s threshold is first crossed at %.0f N of %.0f N.", x->name,
                   x->first_crossed_N, F_N);
}

void risk_assess(struct risk *ret, const struct ischia_case *c, const struct ischia_result *result)
{
    assert(ischia_result_converged(result));
    const struct ischia_cluster_set *both = &result->clusters[ISCHIA_OVER_BOTH];
    const double F_N = c->param[ISCHIA_F];
    const struct crossing shear = {"shear", result->strain.E_shear_max, ISCHIA_E_SHEAR_THRESHOLD,
                                   result->clusters[ISCHIA_OVER_SHEAR].volume_mm3,
                                   result->threshold_force_shear_N};
    const struct crossing compression = {"compression", result->strain.E_comp_max,
                                         ISCHIA_E_COMP_THRESHOLD,
                                         result->clusters[ISCHIA_OVER_COMPRESSION].volume_mm3,
                                         result->threshold_force_compression_N};
    const enum risk_band bands[2][2] = {{RISK_BELOW, RISK_COMPRESSION}, {RISK_SHEAR, RISK_BOTH}};
    *ret = (struct risk){.band = bands[is_crossed(&shear)][is_crossed(&compression)]};
    explain(ret, &shear, result->muscle_volume_mm3, F_N);
    explain(ret, &compression, result->muscle_volume_mm3, F_N);
    if (both->has_largest)
        add_reason(ret,
                   "Both are crossed in the same muscle in %.0f mm³; the largest connected body "
                   "of it has %.0f mm³.",
                   both->volume_mm3, both->largest.volume_mm3);
}
