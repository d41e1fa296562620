/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_RISK_H
#define ISCHIA_API_RISK_H

#include <stddef.h>

#include "api/words.h"
#include "solver/case.h"
#include "solver/result.h"

/*
 * What a converged result says in words: which damage thresholds of Green-Lagrange strain are
 * crossed in muscle, and no more. There is no probability anywhere in here.
 */
enum risk_band { RISK_BELOW, RISK_SHEAR, RISK_COMPRESSION, RISK_BOTH, RISK_BAND_COUNT };

struct risk_band_info {
    const char *name;   /* "below", "shear", ...: stable word for documents */
    enum word headline; /* one plain sentence                                */
};
extern const struct risk_band_info risk_bands[RISK_BAND_COUNT];

enum { RISK_REASONS_MAX = 6, RISK_REASON_BYTES = 240, RISK_CAVEAT_COUNT = 3 };
extern const enum word risk_caveats[RISK_CAVEAT_COUNT]; /* go with every result that is shown */

struct risk {
    enum risk_band band;
    int reason_count;
    char reason[RISK_REASONS_MAX][RISK_REASON_BYTES]; /* sentences with values and units */
};

/* result: converged (asserted); c: the case that gave it; language: of the reasons. */
void risk_assess(struct risk *ret, const struct ischia_case *c, const struct ischia_result *result,
                 enum language language);

/* The headline of a band and one of the caveats in the language of records, English. */
const char *risk_headline(enum risk_band band);
const char *risk_caveat(size_t index);

#endif
