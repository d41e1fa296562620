/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Inputs: points of a shifted Sobol' sequence. A sample of an output is
 *   y = m(x) + rho d + sqrt(1 - rho^2) s(x) xi,   d = (solve - m)(x0),   rho = (1 + r^2/4)^-2,
 * m the emulator's mean and s its standard deviation, x0 the measured case, xi standard normal and
 * r the distance to x0 in scaled inputs over error_reach: the emulator's error is known where there
 * is a solve, and is forgotten within about the distance of the solves it was trained with. So an
 * sd of 0 everywhere gives the solve itself, and far away the emulator's own band remains.
 *
 * Sobol' indices by Jansen's estimators (Comput. Phys. Commun. 117 (1999) 35) from two independent
 * sets A and B and those of A with one column of B, all of the mean: with V = var y,
 *   total_i = mean (y_A - y_ABi)^2 / 2V,   first_i = 1 - mean (y_B - y_ABi)^2 / 2V.
 * The columns are what R1, R2 ... are drawn with, so R2's is independent of R1's.
 */
#include "solver/study/uncertainty.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/study/sampling.h"
#include "solver/study/sequence.h"
#include "solver/study/special.h"

static const double error_reach = 0.5;
const double uncertainty_inside_min = 0.8;

const double uncertainty_probabilities[UNCERTAINTY_QUANTILES] = {0.05, 0.25, 0.5, 0.75, 0.95};

const char *const uncertain_response[UNCERTAIN_COUNT] = {
    [UNCERTAIN_EPS_MAX] = "eps_max",
    [UNCERTAIN_E_SHEAR] = "E_shear_max",
    [UNCERTAIN_E_COMP] = "E_comp_max",
    [UNCERTAIN_VOLUME_SHEAR] = "volume_shear_mm3",
    [UNCERTAIN_VOLUME_COMPRESSION] = "volume_compression_mm3",
    [UNCERTAIN_VOLUME_BOTH] = "volume_both_mm3",
    [UNCERTAIN_FORCE_SHEAR] = "force_shear_N",
    [UNCERTAIN_FORCE_COMPRESSION] = "force_compression_N",
};

const char *const uncertainty_status_names[UNCERTAINTY_STATUS_COUNT] = {
    [UNCERTAINTY_GIVEN] = "given",
    [UNCERTAINTY_NO_EMULATOR] = "no_emulator",
    [UNCERTAINTY_OTHER_MODEL] = "other_model",
    [UNCERTAINTY_OUTSIDE] = "outside_training",
};

double uncertain_value(enum uncertain_quantity quantity, const struct ischia_result *r)
{
    const double value[UNCERTAIN_COUNT] = {
        [UNCERTAIN_EPS_MAX] = r->strain.eps_max,
        [UNCERTAIN_E_SHEAR] = r->strain.E_shear_max,
        [UNCERTAIN_E_COMP] = r->strain.E_comp_max,
        [UNCERTAIN_VOLUME_SHEAR] = r->clusters[ISCHIA_OVER_SHEAR].volume_mm3,
        [UNCERTAIN_VOLUME_COMPRESSION] = r->clusters[ISCHIA_OVER_COMPRESSION].volume_mm3,
        [UNCERTAIN_VOLUME_BOTH] = r->clusters[ISCHIA_OVER_BOTH].volume_mm3,
        [UNCERTAIN_FORCE_SHEAR] = r->threshold_force_shear_N,
        [UNCERTAIN_FORCE_COMPRESSION] = r->threshold_force_compression_N,
    };
    return value[quantity];
}

/* -------------------------------------------------------- the emulator, tied to one solve */

struct tied {
    const struct predictor *predictor;
    const struct predictor_output *output[UNCERTAIN_COUNT]; /* NULL: the emulator has none */
    const struct ischia_case *measured;
    const double *sd;
    struct predictor_point at_measured;
    double difference[UNCERTAIN_COUNT]; /* d, as the output is summed: before its power */
};

static double root_of(double value, int power) { return power == 2 ? sqrt(fmax(value, 0)) : value; }

/* A threshold that the solve never crosses is crossed by some force above its own. */
static void tie(struct tied *t, const struct ischia_result *result)
{
    t->at_measured = predictor_point_of(t->predictor, t->measured);
    for (int q = 0; q < UNCERTAIN_COUNT; q++) {
        const struct predictor_output *output =
            predictor_output_named(t->predictor, uncertain_response[q]);
        double solved = uncertain_value((enum uncertain_quantity)q, result);
        t->output[q] = output;
        if (output == NULL) continue;
        const double mean = predictor_root_of(t->predictor, output, &t->at_measured).mean;
        if (isnan(solved)) solved = fmax(mean, t->measured->param[ISCHIA_F] * (1 + 1e-9));
        t->difference[q] = root_of(solved, output->power) - mean;
    }
}

/* rho: how much of the emulator's error at a point is that at the measured case. */
static double shared_error(const struct tied *t, const struct predictor_point *point)
{
    double square = 0;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const double d = point->coordinate[i] - t->at_measured.coordinate[i];
        square += d * d / (error_reach * error_reach);
    }
    const double base = 1 + square / 4;
    return 1 / (base * base);
}

/* Mean and standard deviation at a point, before the power. */
static struct predictor_root tied_root(const struct tied *t, enum uncertain_quantity q,
                                       const struct predictor_point *point)
{
    struct predictor_root root = predictor_root_of(t->predictor, t->output[q], point);
    const double rho = shared_error(t, point);
    root.mean += rho * t->difference[q];
    root.sd *= sqrt(fmax(1 - rho * rho, 0));
    return root;
}

static double tied_value(const struct tied *t, enum uncertain_quantity q,
                         const struct predictor_point *point, double xi)
{
    const struct predictor_root root = tied_root(t, q, point);
    const double value = predictor_raised(root.mean + xi * root.sd, t->output[q]->power);
    return q == UNCERTAIN_E_COMP ? fmin(value, 0.5) : fmax(value, 0);
}

/* ----------------------------------------------------------------------------- samples */

enum { COLUMNS = 2 * ISCHIA_PARAM_COUNT };
_Static_assert((int)COLUMNS <= (int)SEQUENCE_DIMENSIONS_MAX,
               "a column of the sequence for each input, twice");

/* Sample `index` of set A; `from_b`: the input whose column is that of set B, COLUMNS: all are. */
static struct ischia_case sample_case(const struct tied *t, uint64_t seed, uint32_t index,
                                      int from_b)
{
    double u[ISCHIA_PARAM_COUNT];
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const bool b = from_b == COLUMNS || from_b == i;
        u[i] = sequence_sobol(index, b ? ISCHIA_PARAM_COUNT + i : i, seed);
    }
    return sampling_case(t->measured, t->sd, u);
}
enum { SET_A = -1, SET_B = COLUMNS };

struct samples {
    int inside; /* rows of the arrays */
    double *value[UNCERTAIN_COUNT];
    struct ischia_case *c;
    double emulator_variance; /* of eps_max, summed */
    int shear, compression, both;
};

static enum ischia_code samples_init(struct samples *s, struct ischia_error *err)
{
    const size_t n = UNCERTAINTY_SAMPLES;
    double *all = calloc(n * UNCERTAIN_COUNT, sizeof *all);
    *s = (struct samples){.c = calloc(n, sizeof *s->c)};
    s->value[0] = all;
    CHECK(all != NULL && s->c != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu samples", n);
    for (int q = 0; q < UNCERTAIN_COUNT; q++) s->value[q] = all + (size_t)q * n;
    return ISCHIA_OK;
}

static void samples_finish(struct samples *s)
{
    free(s->value[0]);
    free(s->c);
}

static double random_normal(struct sequence_random *random)
{
    const double u = ((double)(sequence_random_next(random) >> 11) + 0.5) * 0x1p-53;
    return special_normal_quantile(u);
}

static void count_outside(const struct tied *t, const struct ischia_case *c,
                          struct ischia_uncertainty *u)
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        if (!predictor_covers(t->predictor, c, (enum ischia_param)i))
            u->outside[i] += 1.0 / UNCERTAINTY_SAMPLES;
}

/* Every output of one sample. A force beyond the sample's own crosses nothing: infinite. */
static void add_sample(const struct tied *t, const struct ischia_case *c,
                       struct sequence_random *random, struct samples *s)
{
    const struct predictor_point point = predictor_point_of(t->predictor, c);
    const int row = s->inside++;
    s->c[row] = *c;
    for (int q = 0; q < UNCERTAIN_COUNT; q++) {
        const double xi = random_normal(random);
        double value = (double)NAN;
        if (t->output[q] != NULL) value = tied_value(t, (enum uncertain_quantity)q, &point, xi);
        if (q >= UNCERTAIN_FORCE_SHEAR && value > c->param[ISCHIA_F]) value = (double)INFINITY;
        s->value[q][row] = value;
    }
    if (t->output[UNCERTAIN_EPS_MAX] != NULL) {
        const double sd = tied_root(t, UNCERTAIN_EPS_MAX, &point).sd;
        s->emulator_variance += sd * sd;
    }
    const bool shear = s->value[UNCERTAIN_E_SHEAR][row] >= ISCHIA_E_SHEAR_THRESHOLD;
    const bool compression = s->value[UNCERTAIN_E_COMP][row] >= ISCHIA_E_COMP_THRESHOLD;
    s->shear += shear;
    s->compression += compression;
    s->both += shear && compression;
}

static void draw_samples(const struct tied *t, uint64_t seed, struct samples *s,
                         struct ischia_uncertainty *u)
{
    struct sequence_random random = {seed};
    for (uint32_t k = 0; k < UNCERTAINTY_SAMPLES; k++) {
        const struct ischia_case c = sample_case(t, seed, k, SET_A);
        count_outside(t, &c, u);
        if (predictor_knows(t->predictor, &c)) add_sample(t, &c, &random, s);
    }
    u->samples = UNCERTAINTY_SAMPLES;
    u->inside = s->inside;
}

/* --------------------------------------------------------------------------- quantiles */

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Between the order statistics (Hyndman and Fan's definition 7), so that n equal values give
 * themselves; beyond the last finite one: NaN. */
static double quantile_of(const double *sorted, int n, double probability)
{
    const double place = probability * (n - 1);
    const int k = (int)floor(place);
    const double next = sorted[k + 1 < n ? k + 1 : k];
    if (!isfinite(sorted[k]) || !isfinite(next)) return (double)NAN;
    return sorted[k] + (place - k) * (next - sorted[k]);
}

/* An emulator without the quantity says nothing of it: its samples are all NaN. */
static bool is_known(const struct samples *s, enum uncertain_quantity quantity)
{
    return !isnan(s->value[quantity][0]);
}

static void fill_shares(const struct samples *s, struct ischia_uncertainty *u)
{
    const bool shear = is_known(s, UNCERTAIN_E_SHEAR), compression = is_known(s, UNCERTAIN_E_COMP);
    const double n = s->inside;
    if (shear) u->share_shear = s->shear / n;
    if (compression) u->share_compression = s->compression / n;
    if (shear && compression) u->share_both = s->both / n;
}

static void fill_quantiles(struct samples *s, struct ischia_uncertainty *u)
{
    for (int q = 0; q < UNCERTAIN_COUNT; q++) {
        if (!is_known(s, (enum uncertain_quantity)q)) continue;
        qsort(s->value[q], (size_t)s->inside, sizeof(double), compare);
        for (int k = 0; k < UNCERTAINTY_QUANTILES; k++)
            u->quantile[q][k] = quantile_of(s->value[q], s->inside, uncertainty_probabilities[k]);
    }
    u->emulator_sd = sqrt(s->emulator_variance / s->inside);
}

/* ------------------------------------------------------------------------------ checks */

/* Where in the distribution of eps_max full solves are made. */
static const double check_at[UNCERTAINTY_CHECKS] = {0.05, 0.35, 0.65, 0.95};

static double rank_of(const double *value, int n, double of)
{
    int below = 0;
    for (int i = 0; i < n; i++) below += value[i] < of;
    return (double)below / n;
}

/* The first sample whose rank is nearest to what is sought. */
static int sample_at(const struct samples *s, double share)
{
    const double *value = s->value[UNCERTAIN_EPS_MAX];
    int best = 0;
    double least = 2;
    for (int i = 0; i < s->inside && least > 0.001; i++) {
        const double far = fabs(rank_of(value, s->inside, value[i]) - share);
        if (far >= least) continue;
        least = far;
        best = i;
    }
    return best;
}

/* Before the samples are sorted. */
static void choose_checks(const struct tied *t, const struct samples *s,
                          struct ischia_uncertainty *u)
{
    for (int k = 0; k < UNCERTAINTY_CHECKS; k++) {
        struct uncertainty_check *check = &u->check[k];
        const struct ischia_case *c = &s->c[sample_at(s, check_at[k])];
        const struct predictor_point point = predictor_point_of(t->predictor, c);
        const struct predictor_root root = tied_root(t, UNCERTAIN_EPS_MAX, &point);
        memcpy(check->param, c->param, sizeof check->param);
        check->eps_max = (double)NAN;
        check->estimate = root.mean;
        check->low = root.mean - 1.96 * root.sd;
        check->high = root.mean + 1.96 * root.sd;
    }
    u->check_count = UNCERTAINTY_CHECKS;
}

struct ischia_case uncertainty_check_case(const struct ischia_case *c,
                                          const struct uncertainty_check *check)
{
    struct ischia_case at = *c;
    memcpy(at.param, check->param, sizeof at.param);
    return at;
}

/* ------------------------------------------------------------------------- sensitivity */

struct sums {
    int rows;
    double y, square; /* over A and B */
    double first[ISCHIA_PARAM_COUNT], total[ISCHIA_PARAM_COUNT];
};

/* False when the case lies outside the training box. */
static bool mean_eps_max(const struct tied *t, const struct ischia_case *c, double *ret)
{
    if (!predictor_knows(t->predictor, c)) return false;
    const struct predictor_point point = predictor_point_of(t->predictor, c);
    *ret = tied_root(t, UNCERTAIN_EPS_MAX, &point).mean;
    return true;
}

/* One row of A, B and every AB; rows with a point outside are left out whole. */
static void add_row(const struct tied *t, uint64_t seed, uint32_t k, struct sums *sums)
{
    double a, b, mixed[ISCHIA_PARAM_COUNT];
    struct ischia_case c = sample_case(t, seed, k, SET_A);
    if (!mean_eps_max(t, &c, &a)) return;
    c = sample_case(t, seed, k, SET_B);
    if (!mean_eps_max(t, &c, &b)) return;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        mixed[i] = a;
        if (!(t->sd[i] > 0)) continue;
        c = sample_case(t, seed, k, i);
        if (!mean_eps_max(t, &c, &mixed[i])) return;
    }
    sums->rows++;
    sums->y += a + b;
    sums->square += a * a + b * b;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        sums->first[i] += (b - mixed[i]) * (b - mixed[i]);
        sums->total[i] += (a - mixed[i]) * (a - mixed[i]);
    }
}

static void fill_sensitivity(const struct tied *t, uint64_t seed, struct ischia_uncertainty *u)
{
    struct sums sums = {0};
    for (uint32_t k = 0; k < UNCERTAINTY_SENSITIVITY_SAMPLES; k++) add_row(t, seed, k, &sums);
    const double n = sums.rows, mean = sums.y / (2 * n);
    const double variance = sums.square / (2 * n) - mean * mean;
    if (sums.rows < UNCERTAINTY_SENSITIVITY_SAMPLES / 4 || !(variance > 1e-12 * mean * mean))
        return;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const bool varies = t->sd[i] > 0;
        u->first_order[i] = varies ? fmin(fmax(1 - sums.first[i] / (2 * n * variance), 0), 1) : 0;
        u->total[i] = fmin(sums.total[i] / (2 * n * variance), 1);
    }
}

/* --------------------------------------------------------------------------- the whole */

static void blank(struct ischia_uncertainty *u, const double sd[ISCHIA_PARAM_COUNT])
{
    const double none = (double)NAN;
    *u = (struct ischia_uncertainty){
        .share_shear = none, .share_compression = none, .share_both = none, .emulator_sd = none};
    memcpy(u->sd, sd, sizeof u->sd);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) u->first_order[i] = u->total[i] = none;
    for (int q = 0; q < UNCERTAIN_COUNT; q++)
        for (int k = 0; k < UNCERTAINTY_QUANTILES; k++) u->quantile[q][k] = none;
}

static enum uncertainty_status status_of(const struct predictor *p, const struct ischia_case *c)
{
    if (p == NULL) return UNCERTAINTY_NO_EMULATOR;
    if (!predictor_same_options(p, c)) return UNCERTAINTY_OTHER_MODEL;
    if (predictor_output_named(p, uncertain_response[UNCERTAIN_EPS_MAX]) == NULL)
        return UNCERTAINTY_NO_EMULATOR;
    return predictor_knows(p, c) ? UNCERTAINTY_GIVEN : UNCERTAINTY_OUTSIDE;
}

/* No sample is drawn around a case that the emulator does not know: all would be outside. */
static void name_outside(const struct predictor *p, const struct ischia_case *c,
                         struct ischia_uncertainty *u)
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        if (!predictor_covers(p, c, (enum ischia_param)i)) u->outside[i] = 1;
}

static bool varies(const double sd[ISCHIA_PARAM_COUNT])
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        if (sd[i] > 0) return true;
    return false;
}

static void evaluate(const struct tied *t, uint64_t seed, struct samples *s,
                     struct ischia_uncertainty *u)
{
    draw_samples(t, seed, s, u);
    if (s->inside < uncertainty_inside_min * UNCERTAINTY_SAMPLES) {
        u->status = UNCERTAINTY_OUTSIDE;
        return;
    }
    if (varies(t->sd)) {
        choose_checks(t, s, u);
        fill_sensitivity(t, seed, u);
    }
    fill_shares(s, u);
    fill_quantiles(s, u);
}

enum ischia_code
uncertainty_compute(struct ischia_uncertainty *ret, const struct predictor *predictor,
                    const struct ischia_case *c, const double sd[ISCHIA_PARAM_COUNT],
                    const struct ischia_result *result, uint64_t seed, struct ischia_error *err)
{
    assert(ischia_result_converged(result) && sampling_sd_is_valid(sd));
    struct ischia_uncertainty u;
    struct tied t = {.predictor = predictor, .measured = c, .sd = sd};
    struct samples s;
    blank(&u, sd);
    u.status = status_of(predictor, c);
    u.trial = predictor != NULL && predictor->trial;
    if (u.status == UNCERTAINTY_GIVEN) {
        const enum ischia_code code = samples_init(&s, err);
        if (code == ISCHIA_OK) {
            tie(&t, result);
            evaluate(&t, seed, &s, &u);
        }
        samples_finish(&s);
        TRY(code);
    } else if (u.status == UNCERTAINTY_OUTSIDE) {
        name_outside(predictor, c, &u);
    }
    *ret = u;
    return ISCHIA_OK;
}

static bool is_share(double x) { return isnan(x) || (x >= 0 && x <= 1); }

static bool rises(const double *quantile)
{
    for (int k = 1; k < UNCERTAINTY_QUANTILES; k++)
        if (quantile[k] < quantile[k - 1]) return false;
    return true;
}

bool uncertainty_is_valid(const struct ischia_uncertainty *u)
{
    bool good = (unsigned)u->status < UNCERTAINTY_STATUS_COUNT && sampling_sd_is_valid(u->sd) &&
                u->samples >= 0 && u->inside >= 0 && u->inside <= u->samples &&
                u->check_count >= 0 && u->check_count <= UNCERTAINTY_CHECKS &&
                is_share(u->share_shear) && is_share(u->share_compression) &&
                is_share(u->share_both);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        good =
            good && is_share(u->first_order[i]) && is_share(u->total[i]) && is_share(u->outside[i]);
    for (int q = 0; q < UNCERTAIN_COUNT; q++) good = good && rises(u->quantile[q]);
    return good;
}
