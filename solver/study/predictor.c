/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * root(z) = sum of theta P_a(z_1) ... P_g(z_7) + sum of w_j (1 + r_j^2 / 4)^-2, r_j^2 = sum over i
 * of ((z_i - c_ji) / l_i)^2, i over the inputs and the groups. The covariance is the rational
 * quadratic one with alpha 2 (Rasmussen and Williams 2006, 4.19), which costs a division and no
 * exponential. Legendre polynomials by their recurrence, (n + 1) P_{n+1} = (2n + 1) x P_n - n
 * P_{n-1} (Abramowitz and Stegun 22.7.10). An estimate of one output takes some ten microseconds.
 */
#include "solver/study/predictor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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

static bool weights_are_valid(const struct predictor *p, const struct predictor_output *output)
{
    if (output->weight == NULL) return true;
    for (int i = 0; i < ISCHIA_PARAM_COUNT + p->group_count; i++)
        if (!isfinite(output->length[i]) || !(output->length[i] > 0)) return false;
    for (int j = 0; j < p->stride; j++)
        if (!isfinite(output->weight[j])) return false;
    return true;
}

static bool centres_are_valid(const struct predictor *p)
{
    if (p->centre_count < 0 || p->stride < p->centre_count || p->stride % PREDICTOR_LANES != 0)
        return false;
    for (int j = 0; j < (ISCHIA_PARAM_COUNT + p->group_count) * p->stride; j++)
        if (!isfinite(p->centre[j])) return false;
    return true;
}

static bool groups_are_valid(const struct predictor *p)
{
    if (p->group_count < 0 || p->group_count > PREDICTOR_GROUPS_MAX) return false;
    for (int g = 0; g < p->group_count; g++) {
        const struct predictor_group *group = &p->group[g];
        if (!isfinite(group->low) || !isfinite(group->high) || !(group->low < group->high))
            return false;
        for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
            if (!(fabs(group->power[i]) <= 4)) return false;
    }
    return true;
}

bool predictor_is_valid(const struct predictor *p)
{
    if (p->output_count < 1 || p->output_count > PREDICTOR_OUTPUTS_MAX) return false;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct predictor_input *in = &p->input[i];
        if (!isfinite(in->min) || !isfinite(in->max) || !(in->min < in->max)) return false;
        if (in->log && !(in->min > 0)) return false;
    }
    if (!groups_are_valid(p) || !centres_are_valid(p)) return false;
    for (int o = 0; o < p->output_count; o++)
        if (!output_is_valid(&p->output[o]) || !weights_are_valid(p, &p->output[o])) return false;
    return true;
}

enum ischia_code predictor_reserve(struct predictor *p, int count, struct ischia_error *err)
{
    const int stride = (count + PREDICTOR_LANES - 1) / PREDICTOR_LANES * PREDICTOR_LANES;
    CHECK(count >= 0 && count <= PREDICTOR_CENTRES_MAX, err, ISCHIA_E_INPUT,
          "%d centres; at most %d are accepted", count, (int)PREDICTOR_CENTRES_MAX);
    const size_t coordinates = ISCHIA_PARAM_COUNT + (size_t)p->group_count;
    p->centre = calloc((size_t)stride * coordinates + 1, sizeof(double));
    CHECK(p->centre != NULL, err, ISCHIA_E_MEMORY, "out of memory for an emulator");
    p->centre_count = count;
    p->stride = stride;
    return ISCHIA_OK;
}

void predictor_finish(struct predictor *p)
{
    for (int o = 0; o < PREDICTOR_OUTPUTS_MAX; o++) {
        free(p->output[o].mean.term);
        free(p->output[o].spread.term);
        free(p->output[o].weight);
    }
    free(p->centre);
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

bool predictor_knows(const struct predictor *p, const struct ischia_case *c)
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        if (!predictor_covers(p, c, (enum ischia_param)i)) return false;
    return predictor_same_options(p, c);
}

const struct predictor_output *predictor_output_named(const struct predictor *p, const char *name)
{
    for (int o = 0; o < p->output_count; o++)
        if (strcmp(p->output[o].name, name) == 0) return &p->output[o];
    return NULL;
}

static double scaled(double x, double low, double high)
{
    return (2 * x - low - high) / (high - low);
}

static double scaled_input(const struct predictor_input *in, double value)
{
    return in->log ? scaled(log(value), log(in->min), log(in->max))
                   : scaled(value, in->min, in->max);
}

int predictor_coordinates(const struct predictor *p, const double param[ISCHIA_PARAM_COUNT],
                          double ret[PREDICTOR_COORDINATES_MAX])
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) ret[i] = scaled_input(&p->input[i], param[i]);
    for (int g = 0; g < p->group_count; g++) {
        const struct predictor_group *group = &p->group[g];
        double sum = 0;
        for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
            if (group->power[i] != 0) sum += group->power[i] * log(param[i]);
        ret[ISCHIA_PARAM_COUNT + g] = scaled(sum, group->low, group->high);
    }
    return ISCHIA_PARAM_COUNT + p->group_count;
}

struct predictor_point predictor_point_of(const struct predictor *p, const struct ischia_case *c)
{
    struct predictor_point point;
    (void)predictor_coordinates(p, c->param, point.coordinate);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        double *P = point.legendre[i];
        const double x = point.coordinate[i];
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

/* PREDICTOR_LANES centres from `from` on: their weighted covariances with the point. */
static void add_lanes(const struct predictor *p, const struct predictor_output *output,
                      const double *point, const double *per, int from,
                      double total[PREDICTOR_LANES])
{
    double square[PREDICTOR_LANES] = {0};
    for (int i = 0; i < ISCHIA_PARAM_COUNT + p->group_count; i++) {
        const double *centre = &p->centre[i * p->stride + from];
        for (int k = 0; k < PREDICTOR_LANES; k++) {
            const double d = (point[i] - centre[k]) * per[i];
            square[k] += d * d;
        }
    }
    for (int k = 0; k < PREDICTOR_LANES; k++) {
        const double base = 1 + square[k] / 4;
        total[k] += output->weight[from + k] / (base * base);
    }
}

static double near_centres(const struct predictor *p, const struct predictor_output *output,
                           const struct predictor_point *at)
{
    double per[PREDICTOR_COORDINATES_MAX], total[PREDICTOR_LANES] = {0}, sum = 0;
    if (output->weight == NULL) return 0;
    for (int i = 0; i < ISCHIA_PARAM_COUNT + p->group_count; i++) per[i] = 1 / output->length[i];
    for (int j = 0; j < p->stride; j += PREDICTOR_LANES)
        add_lanes(p, output, at->coordinate, per, j, total);
    for (int k = 0; k < PREDICTOR_LANES; k++) sum += total[k];
    return sum;
}

double predictor_raised(double root, int power)
{
    if (power == 1) return root;
    return root > 0 ? root * root : 0;
}

/* The band reaches 1.96 standard deviations to each side. */
static const double band_sd = 1.959963984540054;

struct predictor_root predictor_root_of(const struct predictor *p,
                                        const struct predictor_output *output,
                                        const struct predictor_point *point)
{
    return (struct predictor_root){
        .mean = sum_of(&output->mean, point) + near_centres(p, output, point),
        .sd = output->reach * exp(sum_of(&output->spread, point)) / band_sd};
}

struct predictor_estimate predictor_estimate_of(const struct predictor *p,
                                                const struct predictor_output *output,
                                                const struct predictor_point *point)
{
    const struct predictor_root root = predictor_root_of(p, output, point);
    const double half = band_sd * root.sd;
    return (struct predictor_estimate){.value = predictor_raised(root.mean, output->power),
                                       .low = predictor_raised(root.mean - half, output->power),
                                       .high = predictor_raised(root.mean + half, output->power)};
}
