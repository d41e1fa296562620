/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/risk.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>

const struct risk_band_info risk_bands[RISK_BAND_COUNT] = {
    [RISK_BELOW] = {"below", WORD_DAEMON_RISK_BELOW},
    [RISK_SHEAR] = {"shear", WORD_DAEMON_RISK_SHEAR},
    [RISK_COMPRESSION] = {"compression", WORD_DAEMON_RISK_COMPRESSION},
    [RISK_BOTH] = {"both", WORD_DAEMON_RISK_BOTH},
};

const enum word risk_caveats[RISK_CAVEAT_COUNT] = {
    WORD_DAEMON_RISK_CAVEAT_ANIMAL,
    WORD_DAEMON_RISK_CAVEAT_HIGH,
    WORD_DAEMON_RISK_CAVEAT_DEVICE,
};

const char *risk_headline(enum risk_band band)
{
    return words_get(LANGUAGE_EN, risk_bands[band].headline);
}

const char *risk_caveat(size_t index) { return words_get(LANGUAGE_EN, risk_caveats[index]); }

/* One criterion: what was reached, against what, and where. */
struct crossing {
    enum word name;
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

static void add_reason(struct risk *risk, enum language language, enum word word,
                       const struct word_value *values)
{
    assert(risk->reason_count < RISK_REASONS_MAX);
    (void)words_fill(risk->reason[risk->reason_count++], RISK_REASON_BYTES, language, word, values);
}

static void explain(struct risk *risk, enum language language, const struct crossing *x,
                    double muscle_mm3, double F_N)
{
    const struct word_value criterion = word_text("criterion", words_get(language, x->name));
    const struct word_value reached = word_number("reached", x->reached, 3);
    const struct word_value threshold = word_fixed("threshold", x->threshold, 2);
    if (!is_crossed(x))
        add_reason(risk, language, WORD_DAEMON_RISK_UNDER, WORDS(criterion, reached, threshold));
    else if (x->volume_mm3 > 0 && muscle_mm3 > 0)
        add_reason(risk, language, WORD_DAEMON_RISK_OVER,
                   WORDS(criterion, reached, threshold, word_fixed("volume", x->volume_mm3, 0),
                         word_number("percent", 100 * x->volume_mm3 / muscle_mm3, 2)));
    else
        add_reason(risk, language, WORD_DAEMON_RISK_POINT, WORDS(criterion, reached, threshold));
    if (!isnan(x->first_crossed_N))
        add_reason(
            risk, language, WORD_DAEMON_RISK_FIRST,
            WORDS(criterion, word_fixed("at", x->first_crossed_N, 0), word_fixed("F", F_N, 0)));
}

void risk_assess(struct risk *ret, const struct ischia_case *c, const struct ischia_result *result,
                 enum language language)
{
    assert(ischia_result_converged(result));
    const struct ischia_cluster_set *both = &result->clusters[ISCHIA_OVER_BOTH];
    const double F_N = c->param[ISCHIA_F];
    const struct crossing shear = {
        WORD_DAEMON_RISK_OF_SHEAR, result->strain.E_shear_max, ISCHIA_E_SHEAR_THRESHOLD,
        result->clusters[ISCHIA_OVER_SHEAR].volume_mm3, result->threshold_force_shear_N};
    const struct crossing compression = {WORD_DAEMON_RISK_OF_COMPRESSION, result->strain.E_comp_max,
                                         ISCHIA_E_COMP_THRESHOLD,
                                         result->clusters[ISCHIA_OVER_COMPRESSION].volume_mm3,
                                         result->threshold_force_compression_N};
    const enum risk_band bands[2][2] = {{RISK_BELOW, RISK_COMPRESSION}, {RISK_SHEAR, RISK_BOTH}};
    *ret = (struct risk){.band = bands[is_crossed(&shear)][is_crossed(&compression)]};
    explain(ret, language, &shear, result->muscle_volume_mm3, F_N);
    explain(ret, language, &compression, result->muscle_volume_mm3, F_N);
    if (both->has_largest)
        add_reason(ret, language, WORD_DAEMON_RISK_TOGETHER,
                   WORDS(word_fixed("volume", both->volume_mm3, 0),
                         word_fixed("largest", both->largest.volume_mm3, 0)));
}
