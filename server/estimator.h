/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_ESTIMATOR_H
#define ISCHIA_SERVER_ESTIMATOR_H

#include <stdbool.h>

#include "api/predictor_doc.h"
#include "server/digest.h"
#include "solver/error.h"

/* The trained emulator that estimates are made with. Constant once it is there: any thread. */
struct estimator {
    struct predictor predictor;
    char digest[DIGEST_HEX_BYTES]; /* names the training: SHA-256 of what the file holds */
};

/* Reads the file and checks its digest. ISCHIA_E_INPUT, with the path: it is damaged, no such file,
 * or of another model version; ISCHIA_E_IO, ISCHIA_E_MEMORY. *ret is the caller's to destroy. */
ISCHIA_MUST_CHECK enum ischia_code estimator_create(struct estimator **ret, const char *path,
                                                    struct ischia_error *err);
enum { ESTIMATOR_PATH_BYTES = 4096 };

/* True when an emulator was installed with the program that runs; ret_path is then where. */
bool estimator_installed(char ret_path[ESTIMATOR_PATH_BYTES]);

void estimator_destroy(struct estimator *estimator); /* NULL allowed */

#endif
