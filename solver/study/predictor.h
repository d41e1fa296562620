/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SOLVER_STUDY_PREDICTOR_H
#define ISCHIA_SOLVER_STUDY_PREDICTOR_H

#include <stdbool.h>

#include "solver/case.h"
#include "solver/error.h"

/*
 * Evaluates a trained emulator (kriging). Of each output: a trend, which is a sum of products of
 * Legendre polynomials in the seven inputs scaled to [-1, 1] over the box of the training; what
 * lies near the solves it was trained with, each of which is a centre; and a second sum for the
 * logarithm of its error. Training is emulator/train.py's; api/predictor_doc.h reads the file.
 */

enum {
    PREDICTOR_DEGREE_MAX = 12,
    PREDICTOR_OUTPUTS_MAX = 16,
    PREDICTOR_NAME_BYTES = 32,
    PREDICTOR_CENTRES_MAX = 8192,
    PREDICTOR_GROUPS_MAX = 8,
    PREDICTOR_COORDINATES_MAX = ISCHIA_PARAM_COUNT + PREDICTOR_GROUPS_MAX,
    PREDICTOR_LANES = 8 /* rows of centres are padded to a multiple of these */
};

struct predictor_input {
    double min, max; /* of the training box, in the unit of ischia_params */
    bool log;        /* scaled in the logarithm                          */
};

/* A product of powers of the inputs, such as F / (muM R1 R2): what acts as one is near as one. */
struct predictor_group {
    double power[ISCHIA_PARAM_COUNT];
    double low, high; /* of its logarithm; these become -1 and 1 */
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
    double length[PREDICTOR_COORDINATES_MAX]; /* so far apart, points have little in common  */
    double *weight; /* [stride] of the centres, zero beyond the last; NULL: none do   */
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
    int centre_count;                   /* 0: there are none */
    int stride;                         /* of a row of centres: a multiple of PREDICTOR_LANES */
    double *centre;                     /* [coordinates][stride] */
    int group_count;
    struct predictor_group group[PREDICTOR_GROUPS_MAX];
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

/* Room for count centres, all zero; the groups are set. ISCHIA_E_INPUT: too many; _MEMORY. */
ISCHIA_MUST_CHECK enum ischia_code predictor_reserve(struct predictor *p, int count,
                                                     struct ischia_error *err);

/* Where a case lies: the scaled inputs, then the scaled groups. Returns how many there are. */
int predictor_coordinates(const struct predictor *p, const double param[ISCHIA_PARAM_COUNT],
                          double ret[PREDICTOR_COORDINATES_MAX]);

/* The output of that name; NULL: the emulator has none. */
const struct predictor_output *predictor_output_named(const struct predictor *p, const char *name);

/* True when there is an estimate for the case: it lies in the box and has the options. */
bool predictor_knows(const struct predictor *p, const struct ischia_case *c);

/* The polynomials and coordinates of one case, from which every output is summed. */
struct predictor_point {
    double coordinate[PREDICTOR_COORDINATES_MAX];
    double legendre[ISCHIA_PARAM_COUNT][PREDICTOR_DEGREE_MAX + 1];
};
struct predictor_point predictor_point_of(const struct predictor *p, const struct ischia_case *c);

struct predictor_estimate {
    double value, low, high; /* low ... high: 95 % band */
};

/* In the unit of the response that the output is named after. */
struct predictor_estimate predictor_estimate_of(const struct predictor *p,
                                                const struct predictor_output *output,
                                                const struct predictor_point *point);

/* The same before the power is taken: what is normally distributed about `mean` with `sd`. */
struct predictor_root {
    double mean, sd;
};
struct predictor_root predictor_root_of(const struct predictor *p,
                                        const struct predictor_output *output,
                                        const struct predictor_point *point);
double predictor_raised(double root, int power);

#endif
