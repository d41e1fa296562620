/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_STUDY_PUBLISHED_H
#define ISCHIA_SERVER_CLI_STUDY_PUBLISHED_H

#include "solver/error.h"

/*
 * Coefficients that somebody printed, to set beside ours:
 *   { "source": "...",
 *     "degree_1": { "mean_squared_residuals": 0.02,
 *                   "terms": [ { "term": "muM", "theta": -0.177, "S_percent": 38 }, ... ] },
 *     "degree_2": { ..., "terms": [ ..., { "term": "muM^2", ... }, { "term": "muM*eM", ... } ] } }
 * S_percent belongs to a parameter (linear term and square together) or to a product; it may be
 * missing.
 */
enum { STUDY_PUBLISHED_TERMS_MAX = 120, STUDY_PUBLISHED_NAME_BYTES = 100 };

struct study_published_term {
    char name[STUDY_PUBLISHED_NAME_BYTES];
    double theta;
    double S_percent; /* NaN: not printed */
};

struct study_published_degree {
    int count;
    struct study_published_term term[STUDY_PUBLISHED_TERMS_MAX];
    double mean_square; /* NaN: not printed */
};

struct study_published {
    char source[256];
    struct study_published_degree degree[2]; /* degree 1, degree 2 */
};

/* ISCHIA_E_INPUT: not JSON, or not of that form; else as file_read. *ret is untouched on error. */
ISCHIA_MUST_CHECK enum ischia_code study_published_read(struct study_published *ret,
                                                        const char *path, struct ischia_error *err);

#endif
