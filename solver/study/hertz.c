/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Elliptical Hertz contact (Johnson, Contact Mechanics, 1985, section 4.2c): half axes a >= b,
 * q = b/a, modulus k^2 = 1 - q^2, complete elliptic integrals K, E and D = (K - E)/k^2,
 *   R_long / R_short = (K - D) / (q^2 D)                       gives q,
 *   1 / (2 R_long)   = (p0 / E*) q^2 D / b,   delta = (p0 / E*) b K,   P = (2/3) pi a b p0.
 * Incompressible tissue: E* = E / (1 - 1/4) = 4 mu. Muscle and fat act in series:
 * h / mu = eM / muM + eF / muF, h = eM + eF. R_short = R1; R_long is the outer radius of the torus.
 *
 * The rigid seat behind the layer stiffens it. Bonded incompressible layer (Dimitriadis et al.,
 * Biophys. J. 82 (2002) 2798), with R = sqrt(R_short R_long) and chi = sqrt(R delta) / h:
 *   F = P(delta) (1 + 1.133 chi + 1.283 chi^2 + 0.769 chi^3 + 0.0975 chi^4).
 * Their range is delta <= 0.1 h. The added pressure is mostly hydrostatic and shears nothing, so
 * the shear is read from the half-space field at that delta.
 *
 * On the axis, for Poisson's ratio 1/2, each surface load p dA adds the purely radial stress
 *   sigma_ij = -(3 / 2 pi) p dA z x_i x_j / r^5                (Boussinesq),
 * and the shear strain is half the principal strain difference: (sigma_1 - sigma_3) / (4 muM).
 */
#include "solver/study/hertz.h"

#include <assert.h>
#include <math.h>

static const double pi = 3.14159265358979323846;

struct elliptic {
    double K, D;
};

/* By the arithmetic-geometric mean (DLMF 19.8): K - E = K sum 2^(n-1) c_n^2, c_0 = k. */
static struct elliptic elliptic_of(double q)
{
    const double k2 = (1 - q) * (1 + q);
    double a = 1, g = q, sum = 0.5, power = 1;
    for (int n = 0; n < 40 && k2 > 0; n++) {
        const double c = (a - g) / 2, mean = (a + g) / 2;
        g = sqrt(a * g);
        a = mean;
        sum += power * c * c / k2;
        power *= 2;
        if (c < 1e-9) break; /* the next c is below 1e-18 */
    }
    const double K = pi / (2 * a);
    return (struct elliptic){K, K * sum};
}

/* The axis ratio of the contact; radius_ratio = R_long / R_short >= 1. */
static double axis_ratio(double radius_ratio)
{
    double low = 1e-6, high = 1;
    for (int i = 0; i < 100; i++) {
        const double q = (low + high) / 2;
        const struct elliptic e = elliptic_of(q);
        if ((e.K - e.D) / (q * q * e.D) > radius_ratio) {
            low = q;
        } else {
            high = q;
        }
    }
    return high;
}

/* Principal stresses x, y, z over p0 at depth z (over b) on the axis; Simpson in t, r = sin t, and
 * the midpoint rule over a quarter turn: exact to rounding for a smooth periodic function. */
static void axis_stress(double q, double z, double ret[3])
{
    enum { RINGS = 128, SPOKES = 48 };
    double sum[3] = {0};
    for (int i = 0; i <= RINGS; i++) {
        const double t = pi / 2 * i / RINGS, r = sin(t), p = cos(t);
        const double simpson = i == 0 || i == RINGS ? 1 : 2 + 2 * (i % 2);
        const double weight = simpson * p * r * p;
        for (int j = 0; j < SPOKES; j++) {
            const double angle = pi / 2 * (j + 0.5) / SPOKES;
            const double x[3] = {r * cos(angle) / q, r * sin(angle), z};
            const double r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
            const double scale = weight / (r2 * r2 * sqrt(r2));
            for (int c = 0; c < 3; c++) sum[c] += scale * x[c] * x[c];
        }
    }
    const double dA = (1 / q) * (pi / 2 / RINGS / 3) * (2 * pi / SPOKES);
    for (int c = 0; c < 3; c++) ret[c] = -1.5 * z / pi * dA * sum[c];
}

static double stress_difference(double q, double z)
{
    double s[3];
    axis_stress(q, z, s);
    return fmax(fabs(s[0] - s[2]), fabs(s[1] - s[2]));
}

double hertz_axis_shear(double q, double *ret_depth)
{
    const double golden = (sqrt(5.0) - 1) / 2;
    double low = 0.1, high = 2;
    assert(q > 0 && q <= 1);
    for (int i = 0; i < 40; i++) {
        const double left = high - golden * (high - low), right = low + golden * (high - low);
        if (stress_difference(q, left) > stress_difference(q, right)) {
            high = right;
        } else {
            low = left;
        }
    }
    *ret_depth = (low + high) / 2;
    return stress_difference(q, *ret_depth);
}

struct contact {
    double q, K;
    double b2_over_delta; /* mm: b^2 = b2_over_delta * delta */
    double modulus_kPa;   /* E* */
    double R_mm, h_mm;
};

static struct contact contact_of(const struct ischia_case *c)
{
    const double *p = c->param;
    const double outer =
        c->option[ISCHIA_R2_SURFACE] > 0.5 ? p[ISCHIA_R2] : p[ISCHIA_R2] + p[ISCHIA_R1];
    struct contact contact = {.h_mm = p[ISCHIA_EM] + p[ISCHIA_EF],
                              .R_mm = sqrt(p[ISCHIA_R1] * outer)};
    const double compliance = p[ISCHIA_EM] / p[ISCHIA_MUM] + p[ISCHIA_EF] / p[ISCHIA_MUF];
    contact.q = axis_ratio(outer / p[ISCHIA_R1]);
    const struct elliptic e = elliptic_of(contact.q);
    contact.K = e.K;
    contact.b2_over_delta = 2 * outer * contact.q * contact.q * e.D / e.K;
    contact.modulus_kPa = 4 * contact.h_mm / compliance;
    return contact;
}

static double pressure_kPa(const struct contact *c, double delta)
{
    return c->modulus_kPa * delta / (sqrt(c->b2_over_delta * delta) * c->K);
}

/* The force of the layer, in N, at an indentation. */
static double layer_force_N(const struct contact *c, double delta)
{
    const double chi = sqrt(c->R_mm * delta) / c->h_mm;
    const double stiffening = 1 + chi * (1.133 + chi * (1.283 + chi * (0.769 + chi * 0.0975)));
    const double half_space_mN =
        2.0 / 3 * pi * c->b2_over_delta * delta / c->q * pressure_kPa(c, delta);
    return half_space_mN * 1e-3 * stiffening;
}

static double indentation_mm(const struct contact *c, double force_N)
{
    double low = 0, high = 1;
    while (layer_force_N(c, high) < force_N) high *= 2;
    for (int i = 0; i < 100; i++) {
        const double middle = (low + high) / 2;
        if (layer_force_N(c, middle) < force_N) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return high;
}

struct hertz_baseline hertz_baseline_of(const struct ischia_case *c)
{
    assert(ischia_case_is_valid(c));
    const struct contact contact = contact_of(c);
    struct hertz_baseline r = {.indentation_mm = indentation_mm(&contact, c->param[ISCHIA_F])};
    double depth_over_b;
    r.contact_b_mm = sqrt(contact.b2_over_delta * r.indentation_mm);
    r.contact_a_mm = r.contact_b_mm / contact.q;
    r.peak_pressure_kPa = pressure_kPa(&contact, r.indentation_mm);
    r.eps_max = r.peak_pressure_kPa * hertz_axis_shear(contact.q, &depth_over_b) /
                (4 * c->param[ISCHIA_MUM]);
    r.eps_max_depth_mm = depth_over_b * r.contact_b_mm;
    r.valid = r.indentation_mm <= 0.1 * contact.h_mm && r.contact_a_mm <= contact.h_mm / 2 &&
              r.eps_max <= 0.1;
    return r;
}
