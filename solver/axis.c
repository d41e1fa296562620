/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/axis.h"

#include <math.h>

/* How far beyond the recovered value eps_max lies, over what it is above the raw one. */
static const double beyond = 0.5;

static double largest_shear(const double stretch[3])
{
    const double most = fmax(stretch[0], fmax(stretch[1], stretch[2]));
    const double least = fmin(stretch[0], fmin(stretch[1], stretch[2]));
    return (most - least) / 2;
}

/* Slope at 0 of the odd cubic through (X1, u1) and (X2, u2). */
static double odd_cubic_slope(double X1, double u1, double X2, double u2)
{
    const double r1 = u1 / X1, r2 = u2 / X2;
    return r1 - (r2 - r1) / (X2 * X2 - X1 * X1) * X1 * X1;
}

static double recovered_shear(const struct mesh *mesh, const double (*u)[3], int level)
{
    const int *row = mesh->axis[level];
    double stretch[3];
    for (int k = 0; k < 2; k++) {
        const int a = row[1 + 2 * k], b = row[2 + 2 * k];
        stretch[k] = 1 + odd_cubic_slope(mesh->X_mm[a][k], u[a][k], mesh->X_mm[b][k], u[b][k]);
    }
    if (!(stretch[0] > 0) || !(stretch[1] > 0)) return 0;
    stretch[2] = 1 / (stretch[0] * stretch[1]);
    return largest_shear(stretch);
}

/* Mean stretches of the element between two levels of the axis, from its corner displacements:
 * on the axis' own edge in z, across it in x and y. */
static double raw_shear(const struct mesh *mesh, const double (*u)[3], int level)
{
    const int *above = mesh->axis[level], *below = mesh->axis[level + 1];
    const double dz = mesh->X_mm[above[0]][2] - mesh->X_mm[below[0]][2];
    double stretch[3];
    for (int k = 0; k < 2; k++) {
        const int a = above[1 + 2 * k], b = below[1 + 2 * k];
        stretch[k] = 1 + (u[a][k] + u[b][k]) / (mesh->X_mm[a][k] + mesh->X_mm[b][k]);
    }
    stretch[2] = 1 + (u[above[0]][2] - u[below[0]][2]) / dz;
    return largest_shear(stretch);
}

struct sample {
    double depth_mm;
    double value;
};

static struct sample peak_of(int count, const struct sample *s)
{
    int best = 0;
    for (int i = 1; i < count; i++)
        if (s[i].value > s[best].value) best = i;
    return s[best];
}

/* The line through two samples, at a depth. */
static struct sample along_line(const struct sample *a, const struct sample *b, double depth_mm)
{
    const double slope = (b->value - a->value) / (b->depth_mm - a->depth_mm);
    return (struct sample){depth_mm, b->value + slope * (depth_mm - b->depth_mm)};
}

struct axis_strain axis_strain_of(const struct mesh *mesh, const double (*u)[3])
{
    enum { LEVELS_MAX = 128 };
    struct sample recovered[LEVELS_MAX] = {{0}}, raw[LEVELS_MAX] = {{0}};
    const int count = mesh->axis_count < LEVELS_MAX ? mesh->axis_count : LEVELS_MAX;
    for (int i = 0; i < count; i++) {
        recovered[i].depth_mm = mesh->tip_z_mm - mesh->X_mm[mesh->axis[i][0]][2];
        recovered[i].value = recovered_shear(mesh, u, i);
    }
    for (int i = 0; i + 1 < count; i++) {
        raw[i].depth_mm = (recovered[i].depth_mm + recovered[i + 1].depth_mm) / 2;
        raw[i].value = raw_shear(mesh, u, i);
    }
    int raw_count = count - 1;
    if (raw_count >= 2) { /* the muscle's end, where thin layers have their maximum */
        raw[raw_count] =
            along_line(&raw[raw_count - 2], &raw[raw_count - 1], recovered[count - 1].depth_mm);
        raw_count++;
    }
    const struct sample peak = peak_of(count, recovered);
    const double below = peak_of(raw_count, raw).value;
    return (struct axis_strain){.recovered = peak.value,
                                .raw = below,
                                .eps_max = peak.value + beyond * (peak.value - below),
                                .depth_mm = peak.depth_mm};
}
