/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Any bytes as a design and as a cohort of a study: no crash; what is taken can be stored (each
 * point has a case or a reason, never both), and every case is one that a worker would take.
 */
#include "tests/fuzz/fuzz.h"

#include <string.h>

#include "server/studies.h"

enum { POINTS_MAX = 200 };

static void check_case(const char *case_json)
{
    struct ischia_request request;
    struct doc_faults faults;
    doc_faults_init(&faults);
    MUST(case_doc_read(&request, case_json, strlen(case_json), &json_limits_stored, &faults,
                       NULL) == ISCHIA_OK);
    MUST(faults.count == 0 && ischia_case_is_valid(&request.values));
}

static void check(struct studies_new *study, enum ischia_code code, const struct doc_faults *faults)
{
    MUST(code == ISCHIA_OK || code == ISCHIA_E_INPUT || code == ISCHIA_E_LIMIT);
    if (code == ISCHIA_OK && faults->count == 0) {
        MUST(study->what.count <= POINTS_MAX && study->what.columns_json != NULL);
        for (size_t i = 0; i < study->what.count; i++) {
            const struct store_study_point_new *point = &study->what.point[i];
            MUST((point->case_json == NULL) == (point->problem_json != NULL));
            if (point->case_json != NULL) check_case(point->case_json);
        }
    }
    studies_new_finish(study);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static char text[1 << 20];
    struct studies_new study;
    struct doc_faults faults;
    const struct case_doc_defaults defaults = {"coarse", "as-published"};
    if (size > sizeof text) return 0;
    memcpy(text, data, size);
    doc_faults_init(&faults);
    check(&study, studies_read_design(&study, text, size, POINTS_MAX, &faults, NULL), &faults);
    doc_faults_init(&faults);
    check(&study,
          studies_read_cohort(&study, text, size, "fuzz", &defaults, POINTS_MAX, &faults, NULL),
          &faults);
    return 0;
}
