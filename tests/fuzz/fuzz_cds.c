/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Any bytes as the body of a CDS hook and of its feedback. */
#include "tests/fuzz/fuzz.h"

#include <string.h>

#include "api/cds.h"

static void feedback(const char *bytes, size_t size)
{
    static struct cds_feedback items[CDS_FEEDBACK_MAX];
    struct doc_faults faults;
    struct json *root = NULL;
    size_t count = 0;
    doc_faults_init(&faults);
    const enum ischia_code code = cds_read_feedback(items, &count, bytes, size, &faults, NULL);
    MUST(code == ISCHIA_OK || code == ISCHIA_E_INPUT || code == ISCHIA_E_LIMIT);
    MUST(count <= CDS_FEEDBACK_MAX);
    for (size_t i = 0; i < count; i++) {
        MUST(json_parse(&root, items[i].document, strlen(items[i].document), &json_limits_stored,
                        &faults, NULL) == ISCHIA_OK);
        json_destroy(root);
    }
    cds_feedback_finish(items, count);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct cds_request request;
    struct doc_faults faults;
    for (int service = 0; service < CDS_SERVICE_COUNT; service++) {
        doc_faults_init(&faults);
        const enum ischia_code code =
            cds_read(&request, (enum cds_service)service, (const char *)data, size, &faults, NULL);
        MUST(code == ISCHIA_OK || code == ISCHIA_E_INPUT || code == ISCHIA_E_LIMIT);
        if (code == ISCHIA_OK && faults.count == 0)
            MUST(strncmp(request.patient, "Patient/", 8) == 0);
    }
    feedback((const char *)data, size);
    return 0;
}
