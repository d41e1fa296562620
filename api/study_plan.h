/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_API_STUDY_PLAN_H
#define ISCHIA_API_STUDY_PLAN_H

#include <stdint.h>

#include "api/case_doc.h"
#include "api/study_response.h"
#include "api/text.h"
#include "solver/study/design.h"

/*
 * A study as its design file states it, and the table of rows it leads to. docs/STUDIES.md
 * describes the file.
 */
enum { STUDY_NAME_BYTES = 65, STUDY_PLAN_BYTES_MAX = 1024 * 1024 };

struct study_plan {
    char name[STUDY_NAME_BYTES];      /* as a pseudonym: [A-Za-z0-9._-] */
    char preset[ISCHIA_PRESET_BYTES]; /* the named set of options that its cases start from */
    struct design design;
    struct design_points points;
    int response_count;
    int response[STUDY_RESPONSES_MAX]; /* indices into study_responses */
};

/*
 * Reads a design (JSON of at most 1 MiB) and makes its points, at most rows_max (at most
 * DESIGN_ROWS_MAX). It can be run when the code is ISCHIA_OK and faults->count is 0, and only then;
 * otherwise *ret is untouched. ISCHIA_E_INPUT: not JSON; ISCHIA_E_LIMIT: too long;
 * ISCHIA_E_MEMORY.
 */
ISCHIA_MUST_CHECK enum ischia_code
study_plan_read(struct study_plan *ret, const char *json, size_t length,
                const struct case_doc_defaults *defaults, size_t rows_max,
                struct doc_faults *faults, struct ischia_error *err);
void study_plan_finish(struct study_plan *plan); /* a zeroed one is allowed */

/* The header line of the result file, and the start of a row's line: its number and its inputs,
 * with the comma that follows. What comes after is study_response.h's. */
void study_plan_put_header(struct text_out *out, const struct study_plan *plan);
void study_plan_put_inputs(struct text_out *out, const struct study_plan *plan, size_t row);

/* Equal for two plans exactly when their result files would be: every row's case, the responses,
 * the version of program and model. */
uint64_t study_plan_fingerprint(const struct study_plan *plan);

#endif
