/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Any bytes as what $assess is given: no crash; faults that can be shown; what is taken is a valid
 * case whose origin survives being stored, and whose resources are JSON again.
 */
#include "tests/fuzz/fuzz.h"

#include <string.h>

#include "api/fhir.h"
#include "api/measure.h"

static void must_be_json(struct json_out *out)
{
    struct json *root = NULL;
    struct doc_faults faults;
    char *text = NULL;
    size_t length = 0;
    doc_faults_init(&faults);
    MUST(json_out_take(out, &text, &length, NULL) == ISCHIA_OK);
    MUST(json_parse(&root, text, length, &json_limits_stored, &faults, NULL) == ISCHIA_OK);
    MUST(faults.count == 0);
    json_destroy(root);
    free(text);
}

static void write_resources(const struct fhir_input *input)
{
    static struct record record;
    struct json_out out;
    memset(&record, 0, sizeof record);
    (void)snprintf(record.id, sizeof record.id, "01a2023f-833e-73b7-8dcf-cda5e1c2157e");
    (void)snprintf(record.created_at, sizeof record.created_at, "2026-03-01T09:30:00.000Z");
    record.request = input->request;
    record.origin = input->origin;
    json_out_init(&out, 0);
    json_open_array(&out, NULL);
    fhir_put_entries(&out, "https://x/fhir", &record, "");
    json_close_array(&out);
    must_be_json(&out);
}

static void keep_origin(const struct origin *origin)
{
    struct origin back;
    char *text = NULL;
    memset(&back, 0, sizeof back);
    MUST(origin_text(&text, origin, NULL) == ISCHIA_OK);
    MUST(origin_read(&back, text, NULL) == ISCHIA_OK);
    MUST(memcmp(&back, origin, sizeof back) == 0);
    free(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct fhir_input input;
    struct problem problem;
    struct doc_faults faults;
    struct ischia_error err;
    char *text = NULL;
    doc_faults_init(&faults);
    const enum ischia_code code = fhir_read_assess(&input, (const char *)data, size, &faults, &err);
    MUST(code == ISCHIA_OK || code == ISCHIA_E_INPUT || code == ISCHIA_E_LIMIT);
    if (code != ISCHIA_OK)
        problem_from_error(&problem, &err);
    else
        problem_from_faults(&problem, &faults);
    MUST(fhir_outcome_text(&text, &problem, NULL) == ISCHIA_OK);
    MUST(text_is_utf8(text, strlen(text)));
    free(text);
    if (code != ISCHIA_OK || faults.count > 0) return 0;
    MUST(ischia_case_is_valid(&input.request.values));
    keep_origin(&input.origin);
    write_resources(&input);
    return 0;
}
