/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_TESTS_UNIT_SAMPLES_H
#define ISCHIA_TESTS_UNIT_SAMPLES_H

/* What every test of a document includes, and the case and result that they share. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "api/case_doc.h"
#include "solver/result.h"

/* Row 1L of Table 2. */
static inline struct ischia_request sample_request(void)
{
    static const double param[ISCHIA_PARAM_COUNT] = {7.1, 22.8, 31, 10, 8.0, 5.0, 258};
    struct ischia_request request;
    ischia_request_init(&request);
    memcpy(request.values.param, param, sizeof param);
    return request;
}

/* A converged result with numbers that need all their digits; not one that a solver gave. */
static inline struct ischia_result sample_result(void)
{
    const struct ischia_cluster body = {1e4 / 3, 1.1, 1.7, 0.47, {0, 0.1, 2.0 / 3}};
    return (struct ischia_result){
        .strain = {4.0 / 3, 0.1 + 0.2, 1.9, 0.49},
        .clusters = {[ISCHIA_OVER_SHEAR] = {14400.1, 2, true, body},
                     [ISCHIA_OVER_COMPRESSION] = {8100.7, 1, true, body},
                     [ISCHIA_OVER_BOTH] = {0, 0, false, {0}}},
        .muscle_volume_mm3 = 173456.78125,
        .seat = {32.5, 4400, 58.6, 1e3 / 7},
        .load_curve = {{129, 20, 0.7, 0.8, 0.3}, {258, 32.5, 4.0 / 3, 1.9, 0.49}},
        .load_curve_count = 2,
        .threshold_force_shear_N = 61.25,
        .threshold_force_compression_N = (double)NAN,
        .numerics = {.reason = ISCHIA_CONVERGED,
                     .elements = 1600,
                     .dof = 5200,
                     .load_steps = 12,
                     .newton_iterations = 140,
                     .factorisations = 150,
                     .force_residual = 3e-10,
                     .energy_residual = 5e-324,
                     .det_F_min = 0.25,
                     .eps_max_error = 0.01,
                     .last_converged_F_N = 258,
                     .wall_s = 1.5,
                     .cpu_s = 1.25},
    };
}

static inline struct ischia_result sample_failure(void)
{
    struct ischia_result result = sample_result();
    result.numerics.reason = ISCHIA_DIVERGED_STEP;
    result.numerics.last_converged_F_N = 129;
    result.load_curve_count = 1;
    (void)snprintf(result.numerics.detail, sizeof result.numerics.detail, "steps down to 1e-6 N");
    return result;
}

#endif
