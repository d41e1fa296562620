/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_STUDY_RESPONSE_H
#define ISCHIA_API_STUDY_RESPONSE_H

#include <stdbool.h>
#include <stddef.h>

#include "api/text.h"
#include "solver/case.h"
#include "solver/result.h"

/*
 * What a study can record of a solve, by the column names of `ischia cohort`. Times are not among
 * them: the same design gives the same file, byte for byte, on one machine.
 */
struct study_response {
    const char *name;
    size_t offset; /* into struct ischia_result */
    bool is_int;   /* else a double             */
    bool always;   /* also meaningful when the solve did not converge */
};
enum { STUDY_RESPONSES_MAX = 32 };
extern const struct study_response study_responses[];
extern const int study_response_count;

int study_response_find(const char *name); /* -1: no such response */

/* A response of a result; NaN for one that needs a converged state when there is none. */
double study_response_value(int response, const struct ischia_result *result);

/* "status,reason,value,..." of one row, no line end. result: NULL when there is none, and then all
 * numbers stay empty; word and detail: why, "word: detail" or one of them. */
void study_response_put(struct text_out *out, const struct ischia_result *result, const char *word,
                        const char *detail, const int *chosen, int count);

/* The same for a case that was never solved because it is not valid. */
void study_response_put_refused(struct text_out *out, const struct ischia_case *c, int count);

#endif
