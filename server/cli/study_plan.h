/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_STUDY_PLAN_H
#define ISCHIA_SERVER_CLI_STUDY_PLAN_H

#include <stdint.h>

#include "api/text.h"
#include "server/cli/study_response.h"
#include "solver/study/design.h"

/*
 * A study as its design file states it, and the table of rows it leads to. docs/STUDIES.md
 * describes the file.
 */
enum { STUDY_NAME_BYTES = 65 };

struct study_plan {
    char name[STUDY_NAME_BYTES]; /* as a pseudonym: [A-Za-z0-9._-] */
    struct design design;
    struct design_points points;
    int response_count;
    int response[STUDY_RESPONSES_MAX]; /* indices into study_responses */
};

/* Reads a design file and makes its points. ISCHIA_E_INPUT: the message holds every fault, one a
 * line; ISCHIA_E_IO, ISCHIA_E_LIMIT, ISCHIA_E_MEMORY. *ret is untouched on error. */
ISCHIA_MUST_CHECK enum ischia_code study_plan_init(struct study_plan *ret, const char *path,
                                                   struct text_out *ret_faults,
                                                   struct ischia_error *err);
void study_plan_finish(struct study_plan *plan); /* a zeroed one is allowed */

/* The header line of the result file, and the start of a row's line: its number and its inputs,
 * with the comma that follows. What comes after is study_response.h's. */
void study_plan_put_header(struct text_out *out, const struct study_plan *plan);
void study_plan_put_inputs(struct text_out *out, const struct study_plan *plan, size_t row);

/* Equal for two plans exactly when their result files would be: every row's case, the responses,
 * the version of program and model. */
uint64_t study_plan_fingerprint(const struct study_plan *plan);

#endif
