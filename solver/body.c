/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/body.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum ischia_code body_init(struct body *ret, const struct mesh *mesh,
                           const struct element_material material[TISSUE_COUNT],
                           struct ischia_error *err)
{
    const size_t count = (size_t)mesh->element_count;
    struct body b = {.mesh = mesh};
    memcpy(b.material, material, sizeof b.material);
    b.reference = malloc(count * sizeof *b.reference);
    b.pressure_MPa = calloc(count, sizeof *b.pressure_MPa);
    b.volume = calloc(count, sizeof *b.volume);
    if (b.reference == NULL || b.pressure_MPa == NULL || b.volume == NULL) {
        body_finish(&b);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the elements");
    }
    for (int e = 0; e < mesh->element_count; e++) {
        double X[HEX_NODES][3];
        for (int k = 0; k < HEX_NODES; k++) memcpy(X[k], mesh->X_mm[mesh->hex[e][k]], sizeof X[k]);
        element_reference_init(&b.reference[e], (const double(*)[3])X);
    }
    *ret = b;
    return ISCHIA_OK;
}

void body_finish(struct body *body)
{
    free(body->reference);
    free(body->pressure_MPa);
    free(body->volume);
    *body = (struct body){0};
}

static void gather(const struct mesh *mesh, int e, const double (*u)[3], double ret[HEX_NODES][3])
{
    for (int k = 0; k < HEX_NODES; k++) memcpy(ret[k], u[mesh->hex[e][k]], sizeof ret[k]);
}

static double energy_of_element(const struct body *body, int e, const double (*u)[3],
                                const struct element_tangent *tangent,
                                struct element_derivatives *ret)
{
    double ue[HEX_NODES][3];
    gather(body->mesh, e, u, ue);
    return element_energy(&body->reference[e], &body->material[body->mesh->tissue[e]],
                          (const double(*)[3])ue, tangent, ret);
}

static void scatter_force(const int hex[HEX_NODES], const double f[3][HEX_NODES],
                          double (*force)[3])
{
    for (int k = 0; k < HEX_NODES; k++)
        for (int c = 0; c < 3; c++) force[hex[k]][c] += f[c][k];
}

/* The bone's rows: u_z = -d of all of them, so their entries go to border and corner. */
static void scatter_bone(const int eq[HEX_DOFS], const double K[HEX_DOFS][HEX_DOFS],
                         struct body_derivatives *ret)
{
    for (int p = 2 * HEX_NODES; p < HEX_DOFS; p++) {
        if (eq[p] != EQUATION_BONE) continue;
        for (int q = 0; q < HEX_DOFS; q++) {
            if (eq[q] >= 0) ret->border[eq[q]] -= K[p][q];
            if (eq[q] == EQUATION_BONE) ret->corner += K[p][q];
        }
    }
}

static void scatter_stiffness(const int place[], const double K[HEX_DOFS][HEX_DOFS], double *values)
{
    for (int i = 0, k = 0; i < HEX_DOFS; i++)
        for (int j = 0; j <= i; j++, k++)
            if (place[k] >= 0) values[place[k]] += K[i][j];
}

static bool touches_bone(const struct mesh *mesh, int e)
{
    for (int k = 0; k < HEX_NODES; k++)
        if (mesh->node_flags[mesh->hex[e][k]] & (NODE_ON_BONE | NODE_ON_PLATE)) return true;
    return false;
}

double body_energy(const struct body *body, const double (*u)[3])
{
    double energy = 0;
    for (int e = 0; e < body->mesh->element_count && energy < HUGE_VAL; e++)
        energy += energy_of_element(body, e, u, NULL, NULL);
    return energy;
}

double body_linearise(struct body *body, const struct assembly *a, const double (*u)[3],
                      double convexity, struct body_derivatives *ret)
{
    const struct mesh *mesh = body->mesh;
    double energy = 0;
    ret->corner = 0;
    memset(ret->force, 0, sizeof *ret->force * (size_t)mesh->node_count);
    memset(ret->border, 0, sizeof *ret->border * (size_t)a->n);
    linear_clear(a->linear);
    for (int e = 0; e < mesh->element_count; e++) {
        const struct element_tangent tangent = {body->pressure_MPa[e], convexity};
        struct element_derivatives d;
        const double part = energy_of_element(body, e, u, &tangent, &d);
        if (part == HUGE_VAL) return HUGE_VAL;
        energy += part;
        scatter_force(mesh->hex[e], (const double(*)[HEX_NODES])d.force, ret->force);
        scatter_stiffness(a->scatter[e], (const double(*)[HEX_DOFS])d.stiffness,
                          linear_values(a->linear));
        memcpy(body->volume[e].gradient, d.volume_gradient, sizeof d.volume_gradient);
        body->volume[e].pressure_MPa = d.pressure_MPa;
        if (!touches_bone(mesh, e)) continue;
        int eq[HEX_DOFS];
        assembly_element_equations(a, mesh->hex[e], eq);
        scatter_bone(eq, (const double(*)[HEX_DOFS])d.stiffness, ret);
    }
    return energy;
}

static double mean_kappa_MPa(const struct body *body, int e)
{
    const struct element_material *m = &body->material[body->mesh->tissue[e]];
    return m->kappa_MPa - m->kappa_point_MPa;
}

void body_track_pressure(struct body *body, double alpha, const double (*from)[3],
                         const double (*to)[3])
{
    for (int e = 0; e < body->mesh->element_count; e++) {
        const struct element_volume *volume = &body->volume[e];
        double dv = 0;
        for (int k = 0; k < HEX_NODES; k++) {
            const int n = body->mesh->hex[e][k];
            for (int c = 0; c < 3; c++) dv += volume->gradient[c][k] * (to[n][c] - from[n][c]);
        }
        body->pressure_MPa[e] = alpha * volume->pressure_MPa + (1 - alpha) * body->pressure_MPa[e] +
                                mean_kappa_MPa(body, e) * dv / body->reference[e].volume;
    }
}

void body_reset_pressure(struct body *body, const double (*u)[3])
{
    for (int e = 0; e < body->mesh->element_count; e++) {
        struct element_derivatives d;
        if (energy_of_element(body, e, u, NULL, &d) < HUGE_VAL)
            body->pressure_MPa[e] = d.pressure_MPa;
    }
}

double body_det_F_min(const struct body *body, const double (*u)[3])
{
    double smallest = HUGE_VAL;
    for (int e = 0; e < body->mesh->element_count; e++) {
        double ue[HEX_NODES][3];
        gather(body->mesh, e, u, ue);
        smallest = fmin(smallest, element_det_F_min(&body->reference[e], (const double(*)[3])ue));
    }
    return smallest;
}
