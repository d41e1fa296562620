/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Legendre polynomials by their recurrence, (n + 1) P_{n+1} = (2n + 1) x P_n - n P_{n-1}
 * (Abramowitz and Stegun 22.7.10). A sum is at most some hundred products of seven numbers, so an
 * estimate of every output takes some microseconds.
 */
#include "solver/study/predictor.h"

#include <math.h>
#include <stdlib.h>

static bool sum_is_valid(const struct predictor_sum *sum)
{
    if (sum->count < 1 || sum->term == NULL) return false;
    for (int t = 0; t < sum->count; t++) {
        if (!isfinite(sum->term[t].value)) return false;
        for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
            if (sum->term[t].degree[i] > PREDICTOR_DEGREE_MAX) return false;
    }
    return true;
}

static bool output_is_valid(const struct predictor_output *output)
{
    return output->name[0] != '\0' && (output->power == 1 || output->power == 2) &&
           sum_is_valid(&output->mean) && sum_is_valid(&output->spread) &&
           isfinite(output->reach) && output->reach >= 0 && isfinite(output->held_out_rms);
}

bool predictor_is_valid(const struct predictor *p)
{
    if (p->output_count < 1 || p->output_count > PREDICTOR_OUTPUTS_MAX) return false;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct predictor_input *in = &p->input[i];
        if (!isfinite(in->min) || !isfinite(in->max) || !(in->min < in->max)) return false;
        if (in->log && !(in->min > 0)) return false;
    }
    for (int o = 0; o < p->output_count; o++)
        if (!output_is_valid(&p->output[o])) return false;
    return true;
}

void predictor_finish(struct predictor *p)
{
    for (int o = 0; o < PREDICTOR_OUTPUTS_MAX; o++) {
        free(p->output[o].mean.term);
        free(p->output[o].spread.term);
    }
    *p = (struct predictor){0};
}

bool predictor_covers(const struct predictor *p, const struct ischia_case *c,
                      enum ischia_param input)
{
    const struct predictor_input *in = &p->input[input];
    return c->param[input] >= in->min && c->param[input] <= in->max;
}

bool predictor_same_options(const struct predictor *p, const struct ischia_case *c)
{
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++)
        if (p->option[i] != c->option[i]) return false;
    return true;
}

static double scaled(const struct predictor_input *in, double value)
{
    const double x = in->log ? log(value) : value;
    const double low = in->log ? log(in->min) : in->min, high = in->log ? log(in->max) : in->max;
    return (2 * x - low - high) / (high - low);
}

struct predictor_point predictor_point_of(const struct predictor *p, const struct ischia_case *c)
{
    struct predictor_point point;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        double *P = point.legendre[i];
        const double x = scaled(&p->input[i], c->param[i]);
        P[0] = 1;
        P[1] = x;
        for (int n = 1; n < PREDICTOR_DEGREE_MAX; n++)
            P[n + 1] = ((2 * n + 1) * x * P[n] - n * P[n - 1]) / (n + 1);
    }
    return point;
}

static double sum_of(const struct predictor_sum *sum, const struct predictor_point *point)
{
    double total = 0;
    for (int t = 0; t < sum->count; t++) {
        const struct predictor_term *term = &sum->term[t];
        double product = term->value;
        for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
            if (term->degree[i] != 0) product *= point->legendre[i][term->degree[i]];
        total += product;
    }
    return total;
}

static double raised(double root, int power)
{
    if (power == 1) return root;
    return root > 0 ? root * root : 0;
}

struct predictor_estimate predictor_estimate_of(const struct predictor_output *output,
                                                const struct predictor_point *point)
{
    const double mean = sum_of(&output->mean, point);
    const double half = output->reach * exp(sum_of(&output->spread, point));
    return (struct predictor_estimate){.value = raised(mean, output->power),
                                       .low = raised(mean - half, output->power),
                                       .high = raised(mean + half, output->power)};
}
