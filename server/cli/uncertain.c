/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/uncertain.h"

#include "server/cli/run.h"

enum { UNCERTAINTY_SEED = 1 }; /* the same request gives the same interval, always */

/* One of several solves, to an observer who sees them as one. */
struct stage {
    const struct ischia_observer *observer;
    int done, count;
};

static bool on_stage(void *context, const struct ischia_progress *progress)
{
    const struct stage *stage = context;
    struct ischia_progress whole = *progress;
    whole.fraction = (stage->done + progress->fraction) / stage->count;
    return stage->observer->on_progress(stage->observer->context, &whole);
}

const struct ischia_uncertainty *uncertain_of(const struct uncertain_solution *solution)
{
    return solution->has_uncertainty ? &solution->uncertainty : NULL;
}

enum ischia_code uncertain_emulator(struct estimator **ret, const char *path,
                                    struct ischia_error *err)
{
    char installed[ESTIMATOR_PATH_BYTES];
    *ret = NULL;
    if (path == NULL && !estimator_installed(installed)) return ISCHIA_OK;
    return estimator_create(ret, path != NULL ? path : installed, err);
}

enum ischia_code uncertain_interval(struct ischia_uncertainty *ret,
                                    const struct estimator *estimator, const struct ischia_case *c,
                                    const double sd[ISCHIA_PARAM_COUNT],
                                    const struct ischia_result *result, struct ischia_error *err)
{
    return uncertainty_compute(ret, estimator != NULL ? &estimator->predictor : NULL, c, sd, result,
                               UNCERTAINTY_SEED, err);
}

static enum ischia_code solve_checks(struct ischia_solver *solver, const struct ischia_case *c,
                                     struct stage *stage, struct ischia_uncertainty *u,
                                     struct ischia_error *err)
{
    const struct ischia_observer observer = {on_stage, stage};
    for (int k = 0; k < u->check_count; k++) {
        const struct ischia_case at = uncertainty_check_case(c, &u->check[k]);
        struct ischia_result result;
        stage->done = 1 + k;
        TRY(timed_solve(solver, &at, &observer, &result, NULL, err));
        if (ischia_result_converged(&result)) u->check[k].eps_max = result.strain.eps_max;
    }
    return ISCHIA_OK;
}

static enum ischia_code
add_uncertainty(struct ischia_solver *solver, const struct estimator *estimator,
                const struct ischia_request *request, struct stage *stage,
                struct uncertain_solution *solution, struct ischia_error *err)
{
    double sd[ISCHIA_PARAM_COUNT];
    struct ischia_uncertainty *u = &solution->uncertainty;
    case_doc_sd(request, sd);
    TRY(uncertain_interval(u, estimator, &request->values, sd, &solution->result, err));
    u->typical = request->sd_typical;
    solution->has_uncertainty = true;
    return solve_checks(solver, &request->values, stage, u, err);
}

enum ischia_code uncertain_solve(struct ischia_solver *solver, const struct estimator *estimator,
                                 const struct ischia_request *request,
                                 const struct ischia_observer *observer,
                                 struct uncertain_solution *ret, struct ischia_error *err)
{
    struct stage stage = {observer, 0, request->has_sd ? 1 + UNCERTAINTY_CHECKS : 1};
    const struct ischia_observer whole = {on_stage, &stage};
    struct uncertain_solution s = {.has_uncertainty = false};
    TRY(timed_solve(solver, &request->values, &whole, &s.result, &s.field, err));
    enum ischia_code code = ISCHIA_OK;
    if (request->has_sd && ischia_result_converged(&s.result))
        code = add_uncertainty(solver, estimator, request, &stage, &s, err);
    if (code == ISCHIA_OK)
        *ret = s;
    else
        ischia_field_finish(&s.field);
    return code;
}
