/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/body.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Index of an element, of which there are no more than the mesh has. */
static int element_of(const struct body *body, int b, int lane)
{
    const int e = b * BATCH + lane, last = body->mesh->element_count - 1;
    return e < last ? e : last;
}

/* Lanes of a batch that are not repeats. */
static int lanes_of(const struct body *body, int b)
{
    const int left = body->mesh->element_count - b * BATCH;
    return left < BATCH ? left : BATCH;
}

static bool allocate(struct body *body)
{
    const size_t count = (size_t)body->batch_count;
    body->batch = aligned_alloc(_Alignof(struct element_batch), count * sizeof *body->batch);
    body->pressure_MPa = calloc(count * BATCH, sizeof *body->pressure_MPa);
    body->volume = calloc(count, sizeof *body->volume);
    return body->batch && body->pressure_MPa && body->volume;
}

static void set_lane(struct body *body, int b, int lane)
{
    const struct mesh *mesh = body->mesh;
    const int e = element_of(body, b, lane);
    struct element_reference reference;
    double X[HEX_NODES][3];
    for (int k = 0; k < HEX_NODES; k++) memcpy(X[k], mesh->X_mm[mesh->hex[e][k]], sizeof X[k]);
    element_reference_init(&reference, (const double(*)[3])X);
    element_batch_set(&body->batch[b], lane, &reference, &body->material[mesh->tissue[e]]);
}

enum ischia_code body_init(struct body *ret, const struct mesh *mesh,
                           const struct element_material material[TISSUE_COUNT],
                           struct ischia_error *err)
{
    struct body b = {.mesh = mesh, .batch_count = (mesh->element_count + BATCH - 1) / BATCH};
    memcpy(b.material, material, sizeof b.material);
    if (!allocate(&b)) {
        body_finish(&b);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the elements");
    }
    for (int k = 0; k < b.batch_count; k++)
        for (int lane = 0; lane < BATCH; lane++) set_lane(&b, k, lane);
    *ret = b;
    return ISCHIA_OK;
}

void body_finish(struct body *body)
{
    free(body->batch);
    free(body->pressure_MPa);
    free(body->volume);
    *body = (struct body){0};
}

static void gather(const struct body *body, int b, const double (*u)[3],
                   struct element_batch_u *ret)
{
    for (int lane = 0; lane < BATCH; lane++) {
        const int *hex = body->mesh->hex[element_of(body, b, lane)];
        for (int k = 0; k < HEX_NODES; k++)
            for (int c = 0; c < 3; c++) ret->mm[k][c][lane] = u[hex[k]][c];
    }
}

/* --- derivatives ------------------------------------------------------------------------------ */

/* What a batch adds, and to which lane of it the functions below look. */
struct part {
    const struct element_batch_derivatives *d;
    int lane;
};

static void scatter_force(const struct part *part, const int hex[HEX_NODES], double (*force)[3])
{
    for (int k = 0; k < HEX_NODES; k++)
        for (int c = 0; c < 3; c++) force[hex[k]][c] += part->d->force[c][k][part->lane];
}

static double stiffness_entry(const struct part *part, int p, int q)
{
    const int row = p > q ? p : q, column = p > q ? q : p;
    return part->d->stiffness[row * (row + 1) / 2 + column][part->lane];
}

/* The bone's rows: u_z = -d of all of them, so their entries go to border and corner. */
static void scatter_bone(const struct part *part, const int eq[HEX_DOFS],
                         struct body_derivatives *ret)
{
    for (int p = 2 * HEX_NODES; p < HEX_DOFS; p++) {
        if (eq[p] != EQUATION_BONE) continue;
        for (int q = 0; q < HEX_DOFS; q++) {
            if (eq[q] >= 0) ret->border[eq[q]] -= stiffness_entry(part, p, q);
            if (eq[q] == EQUATION_BONE) ret->corner += stiffness_entry(part, p, q);
        }
    }
}

static void scatter_stiffness(const struct part *part, const int place[HEX_ENTRIES], double *values)
{
    for (int k = 0; k < HEX_ENTRIES; k++)
        if (place[k] >= 0) values[place[k]] += part->d->stiffness[k][part->lane];
}

static bool touches_bone(const struct mesh *mesh, int e)
{
    for (int k = 0; k < HEX_NODES; k++)
        if (mesh->node_flags[mesh->hex[e][k]] & (NODE_ON_BONE | NODE_ON_PLATE)) return true;
    return false;
}

static void scatter(const struct part *part, int e, const struct mesh *mesh,
                    const struct assembly *a, struct body_derivatives *ret)
{
    int eq[HEX_DOFS];
    scatter_force(part, mesh->hex[e], ret->force);
    scatter_stiffness(part, assembly_element_scatter(a, e), linear_values(a->linear));
    if (!touches_bone(mesh, e)) return;
    assembly_element_equations(a, mesh->hex[e], HEX_NODES, eq);
    scatter_bone(part, eq, ret);
}

/* Sum over the lanes of a batch that are not repeats. */
static double sum_energy(const struct body *body, int b, const double energy[BATCH])
{
    double sum = 0;
    for (int lane = 0; lane < lanes_of(body, b); lane++) sum += energy[lane];
    return sum;
}

double body_energy(const struct body *body, const double (*u)[3])
{
    const struct element_kernel *kernel = element_kernel(0);
    double energy = 0;
    for (int b = 0; b < body->batch_count && energy < HUGE_VAL; b++) {
        struct element_batch_u ub;
        BATCH_ALIGNED double part[BATCH];
        gather(body, b, u, &ub);
        kernel->energy(&body->batch[b], &ub, part);
        energy += sum_energy(body, b, part);
    }
    return energy;
}

/* One batch; returns its energy. */
static double linearise_batch(struct body *body, int b, const double (*u)[3], double convexity,
                              struct element_batch_derivatives *ret)
{
    struct element_batch_u ub;
    struct element_batch_tangent tangent = {.convexity = convexity};
    BATCH_ALIGNED double energy[BATCH];
    gather(body, b, u, &ub);
    memcpy(tangent.pressure_MPa, body->pressure_MPa + b * BATCH, sizeof tangent.pressure_MPa);
    element_kernel(0)->linearise(&body->batch[b], &ub, &tangent, ret, energy);
    memcpy(body->volume[b].gradient, ret->volume_gradient, sizeof ret->volume_gradient);
    memcpy(body->volume[b].pressure_MPa, ret->pressure_MPa, sizeof ret->pressure_MPa);
    return sum_energy(body, b, energy);
}

double body_linearise(struct body *body, const struct assembly *a, const double (*u)[3],
                      double convexity, struct body_derivatives *ret)
{
    const struct mesh *mesh = body->mesh;
    struct element_batch_derivatives d;
    double energy = 0;
    ret->corner = 0;
    memset(ret->force, 0, sizeof *ret->force * (size_t)mesh->node_count);
    memset(ret->border, 0, sizeof *ret->border * (size_t)a->n);
    linear_clear(a->linear);
    for (int b = 0; b < body->batch_count; b++) {
        energy += linearise_batch(body, b, u, convexity, &d);
        if (energy == HUGE_VAL) return HUGE_VAL;
        for (int lane = 0; lane < lanes_of(body, b); lane++)
            scatter(&(struct part){&d, lane}, element_of(body, b, lane), mesh, a, ret);
    }
    return energy;
}

/* --- volumes ---------------------------------------------------------------------------------- */

/* dv/du . move, in each lane. */
static void volume_change(const struct body_volume *volume, const struct element_batch_u *from,
                          const struct element_batch_u *to, double ret[BATCH])
{
    memset(ret, 0, BATCH * sizeof *ret);
    for (int k = 0; k < HEX_NODES; k++)
        for (int c = 0; c < 3; c++)
            for (int l = 0; l < BATCH; l++)
                ret[l] += volume->gradient[c][k][l] * (to->mm[k][c][l] - from->mm[k][c][l]);
}

void body_track_pressure(struct body *body, double alpha, const double (*from)[3],
                         const double (*to)[3])
{
    for (int b = 0; b < body->batch_count; b++) {
        const struct element_batch *batch = &body->batch[b];
        const struct body_volume *volume = &body->volume[b];
        struct element_batch_u before, after;
        double dv[BATCH], *pressure = body->pressure_MPa + b * BATCH;
        gather(body, b, from, &before);
        gather(body, b, to, &after);
        volume_change(volume, &before, &after, dv);
        for (int l = 0; l < BATCH; l++)
            pressure[l] = alpha * volume->pressure_MPa[l] + (1 - alpha) * pressure[l] +
                          batch->kappa_mean_MPa[l] * dv[l] / batch->volume[l];
    }
}

static void volume_of_batch(const struct body *body, int b, const double (*u)[3],
                            struct element_batch_volume *ret)
{
    struct element_batch_u ub;
    gather(body, b, u, &ub);
    element_kernel(0)->volume(&body->batch[b], &ub, ret);
}

void body_reset_pressure(struct body *body, const double (*u)[3])
{
    for (int b = 0; b < body->batch_count; b++) {
        struct element_batch_volume volume;
        volume_of_batch(body, b, u, &volume);
        for (int l = 0; l < BATCH; l++)
            if (volume.det_F_min[l] > 0) body->pressure_MPa[b * BATCH + l] = volume.pressure_MPa[l];
    }
}

void body_shear_of_nodes(const struct body *body, double *ret_Nmm)
{
    const struct mesh *mesh = body->mesh;
    memset(ret_Nmm, 0, sizeof *ret_Nmm * (size_t)mesh->node_count);
    for (int e = 0; e < mesh->element_count; e++) {
        const double volume_mm3 = body->batch[e / BATCH].volume[e % BATCH];
        const double share_Nmm = body->material[mesh->tissue[e]].mu_MPa * volume_mm3 / HEX_NODES;
        for (int k = 0; k < HEX_NODES; k++) ret_Nmm[mesh->hex[e][k]] += share_Nmm;
    }
}

double body_det_F_min(const struct body *body, const double (*u)[3])
{
    double smallest = HUGE_VAL;
    for (int b = 0; b < body->batch_count; b++) {
        struct element_batch_volume volume;
        volume_of_batch(body, b, u, &volume);
        for (int l = 0; l < BATCH; l++) smallest = fmin(smallest, volume.det_F_min[l]);
    }
    return smallest;
}
