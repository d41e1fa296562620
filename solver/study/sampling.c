/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * x = m + s Phi^-1(Phi(a) + u (Phi(b) - Phi(a))), a = (low - m)/s, b = (high - m)/s. Where both
 * limits lie above the mean the same is done below it, mirrored: there Phi keeps its digits.
 *
 * R1 comes first; R2 is then drawn from what its own distribution leaves above that R1, which is
 * the joint distribution written as one of R1 and one of R2 given R1, up to the factor by which the
 * condition R2 >= R1 changes that of R1 itself; it is 1 unless the two are within some sd.
 */
#include "solver/study/sampling.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

#include "solver/study/special.h"

static double lower_tail(double x) { return 0.5 * erfc(-x * M_SQRT1_2); }

static double between(double x, double low, double high) { return fmin(fmax(x, low), high); }

/* The standard normal value at u between a and b, a <= 0 or a < b <= 0 for its digits. Where the
 * limits leave next to nothing of the distribution it may lie beyond them. */
static double standard_value(double a, double b, double u)
{
    const double below = lower_tail(a);
    return special_normal_quantile(
        between(below + u * (lower_tail(b) - below), 1e-300, 1 - 0x1p-53));
}

double sampling_truncated_normal(double mean, double sd, double low, double high,
                                 double probability)
{
    const double a = (low - mean) / sd, b = (high - mean) / sd;
    assert(sd > 0 && low <= high);
    const double x =
        a > 0 ? -standard_value(-b, -a, 1 - probability) : standard_value(a, b, probability);
    return between(mean + sd * x, low, high);
}

double sampling_sd_max(enum ischia_param input)
{
    return ischia_params[input].accepted_max - ischia_params[input].accepted_min;
}

bool sampling_sd_is_valid(const double sd[ISCHIA_PARAM_COUNT])
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        if (!(sd[i] >= 0 && sd[i] <= sampling_sd_max((enum ischia_param)i))) return false;
    return true;
}

struct ischia_case sampling_case(const struct ischia_case *measured,
                                 const double sd[ISCHIA_PARAM_COUNT],
                                 const double u[ISCHIA_PARAM_COUNT])
{
    struct ischia_case c = *measured;
    assert(sampling_sd_is_valid(sd));
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        double low = ischia_params[i].accepted_min, high = ischia_params[i].accepted_max;
        if (!(sd[i] > 0)) continue;
        if (i == ISCHIA_R1 && !(sd[ISCHIA_R2] > 0)) high = fmin(high, measured->param[ISCHIA_R2]);
        if (i == ISCHIA_R2) low = fmax(low, c.param[ISCHIA_R1]); /* drawn before */
        c.param[i] = sampling_truncated_normal(measured->param[i], sd[i], low, high, u[i]);
    }
    return c;
}

const struct sampling_typical sampling_typical[ISCHIA_PARAM_COUNT] = {
    [ISCHIA_R1] = {0.84, 0}, [ISCHIA_R2] = {10.6, 0},  [ISCHIA_EM] = {2, 0},
    [ISCHIA_EF] = {3, 0},    [ISCHIA_MUM] = {0, 0.20}, [ISCHIA_MUF] = {0, 0.20},
    [ISCHIA_F] = {0, 0.10},
};

void sampling_sd_typical(const struct ischia_case *measured, double ret[ISCHIA_PARAM_COUNT])
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        ret[i] = sampling_typical[i].absolute + sampling_typical[i].relative * measured->param[i];
}
