/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CLI_UNCERTAIN_H
#define ISCHIA_SERVER_CLI_UNCERTAIN_H

#include "api/case_doc.h"
#include "server/estimator.h"
#include "solver/solver.h"
#include "solver/study/uncertainty.h"

/* A solve, and what it is worth when the request gives standard deviations of its inputs: the
 * interval from the emulator, with the full solves that check it. */

struct uncertain_solution {
    struct ischia_result result;
    struct ischia_field field; /* of the measured case; the caller's to finish */
    bool has_uncertainty;      /* the request gave them, and the solve converged */
    struct ischia_uncertainty uncertainty;
};

/* NULL when there are none in this solution: what result_doc_text takes. */
const struct ischia_uncertainty *uncertain_of(const struct uncertain_solution *solution);

/* The emulator at path, or with NULL the one that came with the program: *ret is the caller's to
 * destroy, NULL when none did. Errors as estimator_create. */
ISCHIA_MUST_CHECK enum ischia_code uncertain_emulator(struct estimator **ret, const char *path,
                                                      struct ischia_error *err);

/* The interval alone, without the solves that check it. result is the converged solve of c, sd is
 * valid (asserted both); estimator as below. ISCHIA_E_MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code
uncertain_interval(struct ischia_uncertainty *ret, const struct estimator *estimator,
                   const struct ischia_case *c, const double sd[ISCHIA_PARAM_COUNT],
                   const struct ischia_result *result, struct ischia_error *err);

/* estimator: NULL when no emulator is there. Progress runs over all solves. Errors as ischia_solve;
 * *ret is untouched then. */
ISCHIA_MUST_CHECK enum ischia_code
uncertain_solve(struct ischia_solver *solver, const struct estimator *estimator,
                const struct ischia_request *request, const struct ischia_observer *observer,
                struct uncertain_solution *ret, struct ischia_error *err);

#endif
