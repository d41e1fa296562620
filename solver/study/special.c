/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * I_x(a, b) by the continued fraction DLMF 8.17.22, evaluated with Lentz's method as modified by
 * Thompson and Barnett; it converges fast for x < (a + 1)/(a + b + 2), and the symmetry
 * I_x(a, b) = 1 - I_{1-x}(b, a) serves the rest. Student's t follows from I with
 * x = f/(f + t^2), a = f/2, b = 1/2 (DLMF 8.17, Abramowitz and Stegun 26.7.1). The quantiles invert
 * their distribution by bisection down to neighbouring doubles: a few microseconds, no tables.
 */
#include "solver/study/special.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>

enum { FRACTION_TERMS_MAX = 10000, BISECTIONS_MAX = 2000 };

static double away_from_zero(double value)
{
    const double tiny = 1e-300;
    return fabs(value) < tiny ? tiny : value;
}

/* Coefficient d_n of DLMF 8.17.23, n = 1, 2, ... */
static double fraction_coefficient(int n, double a, double b, double x)
{
    const double m = floor(n / 2.0);
    if (n % 2 == 0) return m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    return -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
}

static double continued_fraction(double a, double b, double x)
{
    double f = 1, c = 1, d = 0;
    for (int n = 1; n <= FRACTION_TERMS_MAX; n++) {
        const double k = fraction_coefficient(n, a, b, x);
        d = 1 / away_from_zero(1 + k * d);
        c = away_from_zero(1 + k / c);
        f *= c * d;
        if (fabs(c * d - 1) < 1e-16) break;
    }
    return 1 / f;
}

/* The sign that lgamma_r stores is always + here, and no global is touched. */
static double log_gamma(double value)
{
    int sign;
    return lgamma_r(value, &sign);
}

/* What Stirling's (z - 1/2) log z - z + log(2 pi)/2 leaves of log Gamma(z), z >= 20. */
static double stirling_rest(double z)
{
    const double w = 1 / (z * z);
    return (1.0 / 12 - w * (1.0 / 360 - w * (1.0 / 1260 - w / 1680))) / z;
}

/* -log B(a, b). For large arguments the difference of two log Gammas is taken apart first, or
 * their leading terms would cancel and leave ten digits at a = 50 000. */
static double minus_log_beta(double a, double b)
{
    const double large = fmax(a, b), small = fmin(a, b);
    if (large < 20) return log_gamma(a + b) - log_gamma(a) - log_gamma(b);
    return (large - 0.5) * log1p(small / large) + small * log(a + b) - small +
           stirling_rest(a + b) - stirling_rest(large) - log_gamma(small);
}

static double lower_part(double a, double b, double x, double y)
{
    const double log_front = a * log(x) + b * log(y) + minus_log_beta(a, b) - log(a);
    return exp(log_front) * continued_fraction(a, b, x);
}

/* x + y = 1, both given so that neither loses digits near an end. */
static double incomplete_beta(double a, double b, double x, double y)
{
    if (x <= 0) return 0;
    if (y <= 0) return 1;
    if (x < (a + 1) / (a + b + 2)) return lower_part(a, b, x, y);
    return 1 - lower_part(b, a, y, x);
}

double special_incomplete_beta(double a, double b, double x)
{
    assert(a > 0 && b > 0 && x >= 0 && x <= 1);
    return incomplete_beta(a, b, x, 1 - x);
}

double special_t_two_sided(double t, double freedom)
{
    assert(freedom > 0 && !isnan(t));
    if (isinf(t)) return 0;
    const double sum = freedom + t * t;
    return incomplete_beta(freedom / 2, 0.5, freedom / sum, t * t / sum);
}

/* The x > 0 at which a falling function reaches `target`. */
static double invert(double (*upper_tail)(double x, double freedom), double freedom, double target)
{
    double low = 0, high = 1;
    while (upper_tail(high, freedom) > target && high < 1e300) {
        low = high;
        high *= 2;
    }
    for (int i = 0; i < BISECTIONS_MAX; i++) {
        const double middle = low + (high - low) / 2;
        if (middle <= low || middle >= high) break;
        if (upper_tail(middle, freedom) > target) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return high;
}

static double normal_two_sided(double z, double unused)
{
    (void)unused;
    return erfc(z / sqrt(2.0));
}

static double symmetric_quantile(double (*two_sided)(double, double), double freedom,
                                 double probability)
{
    assert(probability > 0 && probability < 1);
    if (probability == 0.5) return 0;
    const double tail = probability < 0.5 ? probability : 1 - probability;
    const double magnitude = invert(two_sided, freedom, 2 * tail);
    return probability < 0.5 ? -magnitude : magnitude;
}

double special_t_quantile(double probability, double freedom)
{
    assert(freedom > 0);
    return symmetric_quantile(special_t_two_sided, freedom, probability);
}

double special_normal_quantile(double probability)
{
    return symmetric_quantile(normal_two_sided, 0, probability);
}
