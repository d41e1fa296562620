/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Any bytes as a form's body: no crash; a case without faults is valid, and its texts are UTF-8. */
#include "tests/fuzz/fuzz.h"

#include <string.h>

#include "api/case_doc.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct ischia_request request;
    struct doc_faults faults;
    struct ischia_error err;
    doc_faults_init(&faults);
    const enum ischia_code code =
        case_doc_read_form(&request, (const char *)data, size, 65536, &faults, &err);
    MUST(code == ISCHIA_OK || code == ISCHIA_E_INPUT || code == ISCHIA_E_LIMIT);
    MUST(text_is_utf8(request.label, strlen(request.label)));
    MUST(code != ISCHIA_OK || faults.count > 0 || ischia_case_is_valid(&request.values));
    return 0;
}
