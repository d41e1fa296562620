/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Any bytes as a stored result or problem: no crash; what is read as one can be written, and reads
 * back as the same. */
#include "tests/fuzz/fuzz.h"

#include <string.h>

#include "api/problem_doc.h"
#include "api/result_doc.h"

static void result(const char *text, size_t length)
{
    const struct ischia_case c = ischia_case_default();
    struct ischia_result first, second;
    char *once, *twice;
    if (result_doc_read(&first, NULL, text, length, &json_limits_stored, NULL) != ISCHIA_OK) return;
    MUST(result_doc_text(&once, &c, &first, NULL, 0, NULL) == ISCHIA_OK);
    MUST(result_doc_read(&second, NULL, once, strlen(once), &json_limits_stored, NULL) ==
         ISCHIA_OK);
    MUST(result_doc_text(&twice, &c, &second, NULL, 0, NULL) == ISCHIA_OK);
    MUST(strcmp(once, twice) == 0);
    free(once);
    free(twice);
}

static void problem(const char *text, size_t length)
{
    struct problem first, second;
    char *once;
    if (problem_doc_read(&first, text, length, NULL) != ISCHIA_OK) return;
    MUST(problem_doc_text(&once, &first, NULL) == ISCHIA_OK);
    MUST(problem_doc_read(&second, once, strlen(once), NULL) == ISCHIA_OK);
    MUST(second.kind == first.kind && strcmp(second.detail, first.detail) == 0);
    free(once);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    result((const char *)data, size);
    problem((const char *)data, size);
    return 0;
}
