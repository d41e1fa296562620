/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Every hand-written derivative against central differences, at states that cover what a solve
 * meets: rest (all stretches equal), two equal stretches, and a strongly distorted element.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/element.h"
#include "solver/ogden.h"
#include "solver/seat.h"
#include "solver/solver.h"

static const double agreement = 1e-6; /* of the largest entry */

struct comparison {
    FILE *out;
    bool all_agree;
};

static void report(struct comparison *c, const char *what, const char *state, double difference,
                   double scale)
{
    const double relative = difference / scale;
    const bool agrees = relative <= agreement;
    c->all_agree = c->all_agree && agrees;
    (void)fprintf(c->out, "%-28s %-18s relative difference %.1e  %s\n", what, state, relative,
                  agrees ? "agrees" : "DISAGREES");
}

struct extremes {
    double difference, scale;
};

/* A difference that is no number stays: fmax would drop it, and what is no number would agree. */
static void note(struct extremes *e, double analytic, double numeric)
{
    const double difference = fabs(analytic - numeric);
    if (difference > e->difference || isnan(difference)) e->difference = difference;
    e->scale = fmax(e->scale, fabs(analytic));
}

/* --- Ogden law -------------------------------------------------------------------------------- */

static double law_energy(const double s[3], double mu, double pressure)
{
    return ogden_energy(mu, s) + pressure * s[0] * s[1] * s[2];
}

static void check_law(struct comparison *c, const char *state, const double stretch[3])
{
    static const double h = 1e-6, mu = 0.008, pressure = 0.03;
    struct ogden_derivatives d;
    struct extremes first = {0, mu}, second = {0, mu};
    ogden_derivatives(mu, pressure, stretch, &d);
    for (int i = 0; i < 3; i++) {
        struct ogden_derivatives plus, minus;
        double up[3], down[3];
        memcpy(up, stretch, sizeof up);
        memcpy(down, stretch, sizeof down);
        up[i] += h;
        down[i] -= h;
        note(&first, d.gradient[i],
             (law_energy(up, mu, pressure) - law_energy(down, mu, pressure)) / (2 * h));
        ogden_derivatives(mu, pressure, up, &plus);
        ogden_derivatives(mu, pressure, down, &minus);
        /* The pressure term's own change with J is not part of the law's second derivative. */
        for (int j = 0; j < 3; j++)
            note(&second, d.normal[j][i], (plus.gradient[j] - minus.gradient[j]) / (2 * h));
    }
    report(c, "Ogden stress", state, first.difference, first.scale);
    report(c, "Ogden tangent", state, second.difference, second.scale);
}

/* The quotients of the gradient by themselves, or as their limit where two stretches are equal. */
static void check_quotients(struct comparison *c, const char *state, const double s[3])
{
    static const double mu = 0.008, pressure = 0.03, equal = 1e-6;
    struct ogden_derivatives d;
    struct extremes even = {0, mu}, odd = {0, mu};
    ogden_derivatives(mu, pressure, s, &d);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double *g = d.gradient, gap = s[i] - s[j];
        note(&even, d.even[k],
             fabs(gap) < equal ? d.normal[i][i] - d.normal[i][j] : (g[i] - g[j]) / gap);
        note(&odd, d.odd[k], (g[i] + g[j]) / (s[i] + s[j]));
    }
    report(c, "Ogden even quotients", state, even.difference, even.scale);
    report(c, "Ogden odd quotients", state, odd.difference, odd.scale);
}

/* --- element ---------------------------------------------------------------------------------- */

static const double brick[HEX_NODES][3] = {{0, 0, 0},        {2.1, 0.1, 0}, {2.0, 1.6, 0.2},
                                           {0.1, 1.5, -0.1}, {0.2, 0, 1.1}, {2.2, 0, 1.0},
                                           {2.1, 1.7, 1.3},  {0, 1.4, 1.2}};

static const struct element_material brick_material = {
    .mu_MPa = 0.008, .kappa_MPa = 0.4, .kappa_point_MPa = 0.04, .corner_share = 0.4};

/* Energy, force and exact stiffness at u. */
static double evaluate(const struct element_reference *ref, const double u[HEX_NODES][3],
                       struct element_derivatives *ret)
{
    struct element_tangent exact = {0};
    (void)element_energy(ref, &brick_material, u, NULL, ret);
    exact.pressure_MPa = ret->pressure_MPa;
    return element_energy(ref, &brick_material, u, &exact, ret);
}

static void check_element(struct comparison *c, const char *state, const double u[HEX_NODES][3])
{
    static const double h = 1e-6;
    struct element_reference ref;
    struct element_derivatives at;
    struct extremes force = {0, 1e-3}, stiffness = {0, 1e-3};
    element_reference_init(&ref, brick);
    (void)evaluate(&ref, u, &at);
    for (int q = 0; q < HEX_DOFS; q++) {
        const int component = q / HEX_NODES, node = q % HEX_NODES;
        struct element_derivatives plus, minus;
        double up[HEX_NODES][3], down[HEX_NODES][3];
        memcpy(up, u, sizeof up);
        memcpy(down, u, sizeof down);
        up[node][component] += h;
        down[node][component] -= h;
        const double rise = evaluate(&ref, (const double(*)[3])up, &plus) -
                            evaluate(&ref, (const double(*)[3])down, &minus);
        note(&force, at.force[component][node], rise / (2 * h));
        for (int p = 0; p < HEX_DOFS; p++)
            note(&stiffness, at.stiffness[p][q],
                 ((&plus.force[0][0])[p] - (&minus.force[0][0])[p]) / (2 * h));
    }
    report(c, "element force", state, force.difference, force.scale);
    report(c, "element stiffness", state, stiffness.difference, stiffness.scale);
}

/* --- friction --------------------------------------------------------------------------------- */

static void check_friction(struct comparison *c, const char *state, double dx, double dy)
{
    static const double h = 1e-7;
    double anchor[1][2] = {{0.1, -0.2}}, normal_N[1] = {0.5}, stiffness[1] = {10};
    const struct seat seat = {.friction = 0.4,
                              .stick_stiffness_N_mm = stiffness,
                              .anchor_mm = anchor,
                              .normal_N = normal_N,
                              .node_count = 1};
    const double at[1][3] = {{0.1 + dx, -0.2 + dy, 0}};
    double force[1][3] = {{0}}, hessian[2][2];
    struct extremes first = {0, 1e-3}, second = {0, 1e-3};
    seat_add_force(&seat, normal_N, at, force);
    seat_hessian(&seat, at, 0, hessian);
    for (int i = 0; i < 2; i++) {
        double up[1][3], down[1][3], plus[1][3] = {{0}}, minus[1][3] = {{0}};
        memcpy(up, at, sizeof up);
        memcpy(down, at, sizeof down);
        up[0][i] += h;
        down[0][i] -= h;
        note(&first, force[0][i],
             (seat_energy(&seat, (const double(*)[3])up) -
              seat_energy(&seat, (const double(*)[3])down)) /
                 (2 * h));
        seat_add_force(&seat, normal_N, (const double(*)[3])up, plus);
        seat_add_force(&seat, normal_N, (const double(*)[3])down, minus);
        for (int j = 0; j < 2; j++)
            note(&second, hessian[j][i], (plus[0][j] - minus[0][j]) / (2 * h));
    }
    report(c, "friction force", state, first.difference, first.scale);
    report(c, "friction stiffness", state, second.difference, second.scale);
}

static void distort(double amplitude, double ret_u[HEX_NODES][3])
{
    for (int n = 0; n < HEX_NODES; n++)
        for (int k = 0; k < 3; k++) ret_u[n][k] = amplitude * sin(3.0 * n + 2.0 * k + 1);
}

static const struct {
    const char *name;
    double stretch[3];
} law_states[] = {
    {"at rest", {1, 1, 1}},
    {"two equal", {1.7, 1.7, 0.3}},
    {"nearly equal", {1.2, 1.2 + 1e-9, 0.8}},
    {"all different", {2.4, 1.6, 0.25}},
};

enum ischia_code ischia_check_tangents(FILE *out, struct ischia_error *err)
{
    struct comparison c = {out, true};
    double u[HEX_NODES][3];
    for (size_t k = 0; k < sizeof law_states / sizeof law_states[0]; k++) {
        check_law(&c, law_states[k].name, law_states[k].stretch);
        check_quotients(&c, law_states[k].name, law_states[k].stretch);
    }
    distort(0, u);
    check_element(&c, "at rest", (const double(*)[3])u);
    distort(0.05, u);
    check_element(&c, "distorted", (const double(*)[3])u);
    distort(0.25, u);
    check_element(&c, "strongly distorted", (const double(*)[3])u);
    check_friction(&c, "sticking", 0.005, -0.01);
    check_friction(&c, "slipping", 0.3, 0.4);
    CHECK(ferror(out) == 0, err, ISCHIA_E_IO, "the report could not be written");
    CHECK(c.all_agree, err, ISCHIA_E_NUMERIC,
          "a hand-written derivative disagrees with finite differences");
    return ISCHIA_OK;
}
