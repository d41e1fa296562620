/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/seat.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Stiffness of the sticking springs by unloaded area: 25 kPa of friction stretch them by 0.025 mm.
 */
static const double stick_stiffness_MPa_mm = 1;

/* A node this near the seat lies on it: it was put there by a sum that rounded. */
static const double touch_mm = 1e-12;

/* The outer skin starts resting on the seat: pressed by a force too small to matter, not zero. */
static const double resting_N = 1e-12;

static double quad_area_mm2(const struct mesh *mesh, const int quad[4])
{
    double a[3], b[3];
    for (int i = 0; i < 3; i++) {
        a[i] = mesh->X_mm[quad[2]][i] - mesh->X_mm[quad[0]][i];
        b[i] = mesh->X_mm[quad[3]][i] - mesh->X_mm[quad[1]][i];
    }
    const double n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                         a[0] * b[1] - a[1] * b[0]};
    return sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / 2;
}

static void set_stick_stiffness(struct seat *seat, const struct mesh *mesh)
{
    for (int q = 0; q < mesh->seat_quad_count; q++) {
        const double share = quad_area_mm2(mesh, mesh->seat_quad[q]) / 4;
        for (int k = 0; k < 4; k++)
            seat->stick_stiffness_N_mm[mesh->seat_quad[q][k]] += stick_stiffness_MPa_mm * share;
    }
}

enum ischia_code seat_init(struct seat *ret, const struct mesh *mesh, double friction,
                           struct ischia_error *err)
{
    const int node_count = mesh->node_count;
    struct seat s = {.friction = friction, .node_count = node_count};
    s.stick_stiffness_N_mm = calloc((size_t)node_count, sizeof *s.stick_stiffness_N_mm);
    s.anchor_mm = calloc((size_t)node_count, sizeof *s.anchor_mm);
    s.normal_N = calloc((size_t)node_count, sizeof *s.normal_N);
    if (s.anchor_mm == NULL || s.normal_N == NULL || s.stick_stiffness_N_mm == NULL) {
        seat_finish(&s);
        return FAIL(err, ISCHIA_E_MEMORY, "not enough memory for the seat");
    }
    set_stick_stiffness(&s, mesh);
    for (int n = 0; n < node_count; n++)
        if (mesh->node_flags[n] & NODE_ON_SEAT && mesh->X_mm[n][2] <= 0) s.normal_N[n] = resting_N;
    *ret = s;
    return ISCHIA_OK;
}

void seat_finish(struct seat *seat)
{
    free(seat->anchor_mm);
    free(seat->normal_N);
    free(seat->stick_stiffness_N_mm);
    *seat = (struct seat){0};
}

void seat_stop(const struct mesh *mesh, int n, double u[3])
{
    if (mesh->X_mm[n][2] + u[2] < touch_mm) u[2] = -mesh->X_mm[n][2];
}

bool seat_binds(const struct mesh *mesh, const double (*u)[3], const double (*force)[3], int n)
{
    return mesh->node_flags[n] & NODE_ON_SEAT && seat_gap_mm(mesh, u, n) <= 0 && force[n][2] > 0;
}

/* The spring of one node: its stretch, and the stretch at which it slips. */
struct spring {
    double dx, dy, r, slip_r;
};

static struct spring spring_of(const struct seat *seat, double normal_N, const double (*u)[3],
                               int n)
{
    struct spring s = {.dx = u[n][0] - seat->anchor_mm[n][0],
                       .dy = u[n][1] - seat->anchor_mm[n][1]};
    s.r = hypot(s.dx, s.dy);
    s.slip_r = normal_N > 0 ? seat->friction * normal_N / seat->stick_stiffness_N_mm[n] : 0;
    return s;
}

double seat_energy(const struct seat *seat, const double (*u)[3])
{
    double energy = 0;
    for (int n = 0; n < seat->node_count; n++) {
        if (seat->normal_N[n] <= 0) continue;
        const double k = seat->stick_stiffness_N_mm[n];
        const struct spring s = spring_of(seat, seat->normal_N[n], u, n);
        energy += s.r <= s.slip_r ? k / 2 * s.r * s.r : k * s.slip_r * (s.r - s.slip_r / 2);
    }
    return energy;
}

void seat_add_force(const struct seat *seat, const double *normal_N, const double (*u)[3],
                    double (*force)[3])
{
    for (int n = 0; n < seat->node_count; n++) {
        if (normal_N[n] <= 0) continue;
        const struct spring s = spring_of(seat, normal_N[n], u, n);
        const double k = seat->stick_stiffness_N_mm[n] * (s.r <= s.slip_r ? 1 : s.slip_r / s.r);
        force[n][0] += k * s.dx;
        force[n][1] += k * s.dy;
    }
}

void seat_spring_hessian(double stick_N_mm, double limit_N, bool slips, const double stretch_mm[2],
                         double ret[2][2])
{
    const double r = hypot(stretch_mm[0], stretch_mm[1]);
    const double stick = slips ? 0 : stick_N_mm, across = slips && r > 0 ? limit_N / r : 0;
    const double tx = r > 0 ? stretch_mm[0] / r : 0, ty = r > 0 ? stretch_mm[1] / r : 0;
    ret[0][0] = stick + across * ty * ty;
    ret[1][1] = stick + across * tx * tx;
    ret[0][1] = ret[1][0] = -across * tx * ty;
}

void seat_hessian(const struct seat *seat, const double (*u)[3], int n, double ret[2][2])
{
    const struct spring s = spring_of(seat, seat->normal_N[n], u, n);
    const double k = seat->stick_stiffness_N_mm[n];
    seat_spring_hessian(k, k * s.slip_r, s.r > s.slip_r, (double[2]){s.dx, s.dy}, ret);
}

static void add_entry(double *values, int place, double value)
{
    if (place >= 0) values[place] += value;
}

void seat_add_stiffness(const struct seat *seat, const struct assembly *a, const double (*u)[3])
{
    double *values = linear_values(a->linear);
    for (int n = 0; n < seat->node_count; n++) {
        if (seat->normal_N[n] <= 0 || a->equation[n][2] >= a->seat_first) continue;
        double hessian[2][2];
        seat_hessian(seat, u, n, hessian);
        add_entry(values, a->diagonal[n][0], hessian[0][0]);
        add_entry(values, a->diagonal[n][1], hessian[1][1]);
        add_entry(values, a->tangential[n], hessian[0][1]);
    }
}

double seat_advance(struct seat *seat, const double (*u)[3], const double *normal_before_N)
{
    double dissipated = 0;
    for (int n = 0; n < seat->node_count; n++) {
        const struct spring s = spring_of(seat, seat->normal_N[n], u, n);
        if (seat->normal_N[n] > 0 && s.r <= s.slip_r) continue;
        const double slip = s.r > 0 ? 1 - s.slip_r / s.r : 0;
        const double mean_N = (seat->normal_N[n] + normal_before_N[n]) / 2;
        seat->anchor_mm[n][0] += slip * s.dx;
        seat->anchor_mm[n][1] += slip * s.dy;
        if (seat->normal_N[n] > 0) dissipated += seat->friction * mean_N * slip * s.r;
    }
    return dissipated;
}
