/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/estimator.h"

#include <stdlib.h>
#include <string.h>

#include "server/textfile.h"

static enum ischia_code read_text(struct estimator *estimator, const char *text,
                                  struct ischia_error *err)
{
    const char *json = NULL;
    char expected[PREDICTOR_DIGEST_DIGITS + 1];
    unsigned char digest[DIGEST_BYTES];
    TRY(predictor_doc_split(text, strlen(text), expected, &json, err));
    digest_plain(json, strlen(json), digest);
    digest_hex(digest, estimator->digest);
    CHECK(strcmp(estimator->digest, expected) == 0, err, ISCHIA_E_INPUT,
          "its content does not match its checksum");
    return predictor_doc_read(&estimator->predictor, json, strlen(json), err);
}

enum ischia_code estimator_create(struct estimator **ret, const char *path,
                                  struct ischia_error *err)
{
    struct estimator *estimator = calloc(1, sizeof *estimator);
    struct ischia_error why = {0};
    char *text = NULL;
    CHECK(estimator != NULL, err, ISCHIA_E_MEMORY, "no memory for an emulator");
    enum ischia_code code = textfile_read(path, &text, err);
    if (code == ISCHIA_OK) {
        code = read_text(estimator, text, &why);
        if (code != ISCHIA_OK)
            code = FAIL(err, code, "the emulator %s cannot be used: %.400s", path, why.message);
    }
    free(text);
    if (code == ISCHIA_OK)
        *ret = estimator;
    else
        estimator_destroy(estimator);
    return code;
}

void estimator_destroy(struct estimator *estimator)
{
    if (estimator == NULL) return;
    predictor_finish(&estimator->predictor);
    free(estimator);
}
