/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_UNCERTAINTY_H
#define ISCHIA_SOLVER_STUDY_UNCERTAINTY_H

#include <stdbool.h>
#include <stdint.h>

#include "solver/case.h"
#include "solver/error.h"
#include "solver/result.h"
#include "solver/study/predictor.h"

/*
 * What a result says when its inputs are only known up to a standard deviation each. Samples of
 * the inputs (sampling.h) go through the emulator, which is tied to the solve of the measured case;
 * a handful of full solves at chosen samples shows whether it can be trusted there.
 */

enum uncertain_quantity {
    UNCERTAIN_EPS_MAX,
    UNCERTAIN_E_SHEAR,
    UNCERTAIN_E_COMP,
    UNCERTAIN_VOLUME_SHEAR,
    UNCERTAIN_VOLUME_COMPRESSION,
    UNCERTAIN_VOLUME_BOTH,
    UNCERTAIN_FORCE_SHEAR,
    UNCERTAIN_FORCE_COMPRESSION,
    UNCERTAIN_COUNT
};
extern const char *const uncertain_response[UNCERTAIN_COUNT]; /* of api/study_response.h */

enum {
    UNCERTAINTY_SAMPLES = 2048,
    UNCERTAINTY_SENSITIVITY_SAMPLES = 1024,
    UNCERTAINTY_QUANTILES = 5,
    UNCERTAINTY_CHECKS = 4
};
extern const double uncertainty_probabilities[UNCERTAINTY_QUANTILES]; /* 0.05 ... 0.95 */
extern const double uncertainty_inside_min; /* share of samples that must lie in the training box */

/* The published difference between the local model and a full model of the same person: root mean
 * square of eps_max after regression (Macron et al. 2020). Never merged with the rest. */
#define ISCHIA_MODEL_FORM_EPS_MAX 0.075

/* Why there is an interval, or none. */
enum uncertainty_status {
    UNCERTAINTY_GIVEN,
    UNCERTAINTY_NO_EMULATOR,
    UNCERTAINTY_OTHER_MODEL, /* options that it was not trained with */
    UNCERTAINTY_OUTSIDE, /* the measured case is outside the training box, or too many samples */
    UNCERTAINTY_STATUS_COUNT
};
extern const char *const uncertainty_status_names[UNCERTAINTY_STATUS_COUNT];

/* A full solve at one of the samples. */
struct uncertainty_check {
    double param[ISCHIA_PARAM_COUNT];
    double eps_max;             /* of the solve; NaN: it did not converge */
    double estimate, low, high; /* of the emulator; 95 % band              */
};

struct ischia_uncertainty {
    enum uncertainty_status status;
    double sd[ISCHIA_PARAM_COUNT];
    bool typical; /* they are sampling_sd_typical's */
    bool trial;   /* the emulator was made for trying out */
    int samples, inside;
    /* Share of samples that an input alone puts outside; 1, and no sample, where the measured case
     * itself is outside by it. */
    double outside[ISCHIA_PARAM_COUNT];
    /* NaN without an interval; a force that the threshold is not reached by is NaN too */
    double quantile[UNCERTAIN_COUNT][UNCERTAINTY_QUANTILES];
    /* Of samples that cross the thresholds; NaN also where the emulator lacks the strain. */
    double share_shear, share_compression, share_both;
    /* Sobol' indices of eps_max; NaN when it does not vary, or too few samples are inside */
    double first_order[ISCHIA_PARAM_COUNT], total[ISCHIA_PARAM_COUNT];
    double emulator_sd; /* of eps_max, root mean square over the samples; NaN without an interval */
    int check_count;    /* 0 ... UNCERTAINTY_CHECKS; chosen here, solved by the caller */
    struct uncertainty_check check[UNCERTAINTY_CHECKS];
};

/*
 * result is the converged solve of c (asserted), sd is valid (asserted). predictor NULL: there is
 * none. The same seed and arguments give the same bits. The eps_max of the checks are NaN: the
 * caller's to fill in. ISCHIA_E_MEMORY.
 */
ISCHIA_MUST_CHECK enum ischia_code
uncertainty_compute(struct ischia_uncertainty *ret, const struct predictor *predictor,
                    const struct ischia_case *c, const double sd[ISCHIA_PARAM_COUNT],
                    const struct ischia_result *result, uint64_t seed, struct ischia_error *err);

/* The case that a check solves. */
struct ischia_case uncertainty_check_case(const struct ischia_case *c,
                                          const struct uncertainty_check *check);

/* True when every number is within its bounds. */
bool uncertainty_is_valid(const struct ischia_uncertainty *u);

/* The value of a quantity in a result; NaN: the threshold is not reached. */
double uncertain_value(enum uncertain_quantity quantity, const struct ischia_result *result);

#endif
