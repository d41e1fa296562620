/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_MEASURE_H
#define ISCHIA_API_MEASURE_H

#include "solver/case.h"
#include "solver/result.h"
#include "solver/study/uncertainty.h"

/*
 * The mapping to record systems: every number that travels, a row each. FHIR Observations, the
 * CodeSystem, the OperationDefinition, HL7 v2 OBX segments and docs/INTEGRATION.md iterate it. The
 * first ISCHIA_PARAM_COUNT rows are the inputs, made from ischia_params; then the results; then
 * what uncertain inputs leave of them.
 */
enum {
    MEASURE_RESULT_COUNT = 14,
    MEASURE_INTERVAL_COUNT = 2,
    MEASURE_FIRST_INTERVAL = ISCHIA_PARAM_COUNT + MEASURE_RESULT_COUNT,
    MEASURE_COUNT = MEASURE_FIRST_INTERVAL + MEASURE_INTERVAL_COUNT
};
enum { MEASURE_ID_BYTES = 32 };

struct measure {
    const char *code;       /* in the code system; OBX-3.1                                */
    const char *display;    /* a few words                                                */
    const char *unit;       /* UCUM                                                       */
    const char *definition; /* one plain sentence                                         */
    const char *v1;         /* where /v1 has it: a JSON pointer into the assessment       */
};

/* Row `index`, 0 ... MEASURE_COUNT - 1 (asserted); its texts are static. */
struct measure measure_at(int index);
/* The seven inputs come first. */
static inline bool measure_is_input(int index) { return index < ISCHIA_PARAM_COUNT; }

/* The row with this code, -1 when there is none. */
int measure_find(const char *code);

/* The number; NaN when there is none (a threshold that is never crossed, inputs without standard
 * deviations). result may be NULL for inputs, u always. */
double measure_value(int index, const struct ischia_case *c, const struct ischia_result *result,
                     const struct ischia_uncertainty *u);

/* The code as part of a FHIR id: '-' for '_', which ids may not have. */
void measure_id(int index, char ret[MEASURE_ID_BYTES]);

#endif
