/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_PREDICTOR_H
#define ISCHIA_SOLVER_STUDY_PREDICTOR_H

#include <stdbool.h>

#include "solver/case.h"

/*
 * Evaluates a trained emulator: for each output a sum of products of Legendre polynomials in the
 * seven inputs, scaled to [-1, 1] over the box it was trained in, and a second such sum for the
 * logarithm of its error. Training is emulator/train.py's; the file is read by api/predictor_doc.h.
 */

enum { PREDICTOR_DEGREE_MAX = 12, PREDICTOR_OUTPUTS_MAX = 16, PREDICTOR_NAME_BYTES = 32 };

struct predictor_input {
    double min, max; /* of the training box, in the unit of ischia_params */
    bool log;        /* scaled in the logarithm                          */
};

struct predictor_term {
    unsigned char degree[ISCHIA_PARAM_COUNT];
    double value;
};

struct predictor_sum {
    int count;
    struct predictor_term *term; /* [count] */
};

struct predictor_output {
    char name[PREDICTOR_NAME_BYTES]; /* a response of api/study_response.h                       */
    int power; /* 1: the sum is the value; 2: its square root, not below zero    */
    struct predictor_sum mean;
    struct predictor_sum spread; /* logarithm of the error's size                                */
    double reach;                /* the 95 % band is mean +- reach * exp(spread), before power   */
    double held_out_rms;         /* of predictions of points left out in training                */
};

struct predictor {
    struct predictor_input input[ISCHIA_PARAM_COUNT];
    double option[ISCHIA_OPTION_COUNT]; /* it holds for these alone */
    enum ischia_resolution resolution;  /* of the solves it was trained with */
    int rows;                           /* how many */
    bool trial;                         /* made for trying out: not to be relied on */
    int output_count;
    struct predictor_output output[PREDICTOR_OUTPUTS_MAX];
};

/* True when every number is finite and within its bounds; the evaluation relies on it. */
bool predictor_is_valid(const struct predictor *p);
void predictor_finish(struct predictor *p); /* a zeroed one is allowed */

/* True when the input lies in the training box; when its options are those of the training. */
bool predictor_covers(const struct predictor *p, const struct ischia_case *c,
                      enum ischia_param input);
bool predictor_same_options(const struct predictor *p, const struct ischia_case *c);

/* The polynomials of one case, from which every output is summed. */
struct predictor_point {
    double legendre[ISCHIA_PARAM_COUNT][PREDICTOR_DEGREE_MAX + 1];
};
struct predictor_point predictor_point_of(const struct predictor *p, const struct ischia_case *c);

struct predictor_estimate {
    double value, low, high; /* low ... high: 95 % band */
};

/* In the unit of the response that the output is named after. */
struct predictor_estimate predictor_estimate_of(const struct predictor_output *output,
                                                const struct predictor_point *point);

#endif
