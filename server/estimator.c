/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/estimator.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

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

/* Below where a package puts the programs, or where a build leaves ischiad and ischia. */
bool estimator_installed(char ret_path[ESTIMATOR_PATH_BYTES])
{
    static const char *const places[] = {"../share/ischia/emulator.txt", "../emulator/emulator.txt",
                                         "../../emulator/emulator.txt"};
    char own[ESTIMATOR_PATH_BYTES - 64];
    const ssize_t n = readlink("/proc/self/exe", own, sizeof own - 1);
    if (n <= 0) return false;
    own[n] = '\0';
    char *slash = strrchr(own, '/');
    if (slash == NULL) return false;
    *slash = '\0';
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        (void)snprintf(ret_path, ESTIMATOR_PATH_BYTES, "%s/%s", own, places[i]);
        if (access(ret_path, R_OK) == 0) return true;
    }
    return false;
}
