/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The part of a bilinear face x(s, t) that node a owns is the integral of
 * N_a max(0, -(dx/ds x dx/dt)_z) over the face, by 2 x 2 Gauss points (exact for a flat face that
 * looks down everywhere). Seat faces have outward normals, so "down" is minus z.
 */
#include "solver/seat_pressure.h"

#include <math.h>
#include <stdlib.h>

#include "solver/units.h"

static const double corner_sign[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};

struct quad_shape {
    double N[4], ds[4], dt[4];
};

static struct quad_shape quad_shape_at(int point)
{
    struct quad_shape shape;
    const double s = corner_sign[point][0] / sqrt(3.0), t = corner_sign[point][1] / sqrt(3.0);
    for (int a = 0; a < 4; a++) {
        const double along_s = 0.5 * (1 + corner_sign[a][0] * s);
        const double along_t = 0.5 * (1 + corner_sign[a][1] * t);
        shape.N[a] = along_s * along_t;
        shape.ds[a] = 0.5 * corner_sign[a][0] * along_t;
        shape.dt[a] = 0.5 * corner_sign[a][1] * along_s;
    }
    return shape;
}

static void add_quad_areas(const struct mesh *mesh, const double *u, const int quad[4],
                           double *area_mm2)
{
    for (int point = 0; point < 4; point++) {
        const struct quad_shape shape = quad_shape_at(point);
        double ds[2] = {0, 0}, dt[2] = {0, 0};
        for (int a = 0; a < 4; a++) {
            for (int d = 0; d < 2; d++) {
                const double x = mesh->X_mm[quad[a]][d] + u[3 * (size_t)quad[a] + (size_t)d];
                ds[d] += shape.ds[a] * x;
                dt[d] += shape.dt[a] * x;
            }
        }
        const double down = fmax(0, ds[1] * dt[0] - ds[0] * dt[1]);
        for (int a = 0; a < 4; a++) area_mm2[quad[a]] += shape.N[a] * down;
    }
}

static double peak_pressure_MPa(const struct mesh *mesh, const double *force_N,
                                const double *area_mm2)
{
    double peak = 0;
    for (int q = 0; q < mesh->outer_skin_quad_count; q++) {
        for (int a = 0; a < 4; a++) {
            const int n = mesh->seat_quad[q][a];
            if (force_N[n] > 0 && area_mm2[n] > 0) peak = fmax(peak, force_N[n] / area_mm2[n]);
        }
    }
    return peak;
}

enum ischia_code seat_pressure(const struct mesh *mesh, const struct seat_state *state,
                               struct ischia_seat *ret_seat, struct ischia_error *err)
{
    double *area_mm2 = calloc((size_t)mesh->node_count, sizeof *area_mm2);
    double contact_mm2 = 0, force_N = 0;
    CHECK(area_mm2 != NULL, err, ISCHIA_E_MEMORY, "out of memory for the contact area");
    for (int q = 0; q < mesh->seat_quad_count; q++)
        add_quad_areas(mesh, state->displacement_mm, mesh->seat_quad[q], area_mm2);
    for (int n = 0; n < mesh->node_count; n++) {
        if (!(state->normal_force_N[n] > 0)) continue;
        contact_mm2 += area_mm2[n];
        force_N += state->normal_force_N[n];
    }
    ret_seat->contact_area_mm2 = side_extent(contact_mm2);
    ret_seat->mean_pressure_kPa = contact_mm2 > 0 ? kPa_from_MPa(force_N / contact_mm2) : 0;
    ret_seat->peak_pressure_kPa =
        kPa_from_MPa(peak_pressure_MPa(mesh, state->normal_force_N, area_mm2));
    free(area_mm2);
    return ISCHIA_OK;
}
