/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Any bytes as a case in JSON: no crash; what the scan has passed, cJSON takes (the only other
 * error would be memory, which is there); a case without faults is valid and survives being
 * written.
 */
#include "tests/fuzz/fuzz.h"

#include <string.h>

#include "api/case_doc.h"

static void read_back(const struct ischia_request *request)
{
    struct ischia_request back;
    struct doc_faults faults;
    struct json_out out;
    char *text;
    size_t length;
    doc_faults_init(&faults);
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    case_doc_write(&out, request);
    json_close_object(&out);
    MUST(json_out_take(&out, &text, &length, NULL) == ISCHIA_OK);
    MUST(case_doc_read(&back, text, length, &json_limits_request, &faults, NULL) == ISCHIA_OK);
    MUST(faults.count == 0);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        MUST(back.values.param[i] == request->values.param[i]);
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++)
        MUST(back.values.option[i] == request->values.option[i]);
    MUST(back.values.resolution == request->values.resolution);
    MUST(strcmp(back.label, request->label) == 0 && strcmp(back.subject, request->subject) == 0);
    free(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct ischia_request request;
    struct doc_faults faults;
    struct ischia_error err;
    doc_faults_init(&faults);
    const enum ischia_code code =
        case_doc_read(&request, (const char *)data, size, &json_limits_request, &faults, &err);
    MUST(code == ISCHIA_OK || code == ISCHIA_E_INPUT || code == ISCHIA_E_LIMIT);
    for (size_t i = 0; i < faults.count; i++) {
        MUST(text_is_utf8(faults.item[i].detail, strlen(faults.item[i].detail)));
        MUST(strpbrk(faults.item[i].detail, "\n\r\x1b") == NULL);
        MUST(faults.item[i].code[0] != '\0');
    }
    if (code != ISCHIA_OK || faults.count > 0) return 0;
    MUST(ischia_case_is_valid(&request.values));
    read_back(&request);
    return 0;
}
