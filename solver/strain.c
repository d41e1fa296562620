/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/strain.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/kinematics.h"

/* What rounding may do to an eigenvalue of C or to a bound of it, over the trace of C. */
static const double bound_rounding = 1e-12;

double green_lagrange(double stretch) { return 0.5 * (stretch * stretch - 1); }

struct strain_measures strain_measures_of(const double stretch[3])
{
    assert(stretch[0] >= stretch[1] && stretch[1] >= stretch[2] && stretch[2] >= 0);
    /* Differences are factored so that equal stretches give exactly zero shear. */
    const double spread = stretch[0] - stretch[2];
    return (struct strain_measures){
        .green_lagrange_shear = 0.25 * spread * (stretch[0] + stretch[2]),
        .green_lagrange_compression = fmax(0.0, -green_lagrange(stretch[2])),
        .engineering_shear = 0.5 * spread,
    };
}

static struct strain_cell cell_at(const struct hex_corners *X, const struct hex_corners *u,
                                  int point)
{
    const struct hex_point p = hex_point_at(X, point);
    double F[3][3], stretch[3];
    deformation_gradient(&p, u, F);
    principal_stretches(F, stretch);
    struct strain_cell cell = {.strain = strain_measures_of(stretch), .volume_mm3 = p.volume_mm3};
    memcpy(cell.X_mm, p.X_mm, sizeof cell.X_mm);
    return cell;
}

enum ischia_code strain_field_init(struct strain_field *ret, const struct mesh *mesh,
                                   const double *displacement_mm, struct ischia_error *err)
{
    const size_t count = (size_t)mesh->element_count * HEX_CELLS;
    struct strain_cell *cell = malloc(count * sizeof *cell);
    CHECK(cell != NULL, err, ISCHIA_E_MEMORY, "out of memory for the strains of %zu points", count);
    for (int e = 0; e < mesh->element_count; e++) {
        const struct hex_corners X = hex_gather(mesh->hex[e], &mesh->X_mm[0][0]);
        const struct hex_corners u = hex_gather(mesh->hex[e], displacement_mm);
        for (int q = 0; q < HEX_CELLS; q++)
            cell[(size_t)e * HEX_CELLS + (size_t)q] = cell_at(&X, &u, q);
    }
    *ret = (struct strain_field){.cell_count = (int)count, .cell = cell};
    return ISCHIA_OK;
}

void strain_field_finish(struct strain_field *field)
{
    free(field->cell);
    *field = (struct strain_field){0};
}

/* Neither measure can be above these, by the invariants of C = F^T F alone: eigenvalues of a
 * traceless symmetric matrix of norm q are at most sqrt(2) q apart, and none is below
 * -sqrt(2/3) q. */
static struct strain_maxima bounds_of(double F[3][3])
{
    double C[3][3], trace = 0, square = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            C[i][j] = F[0][i] * F[0][j] + F[1][i] * F[1][j] + F[2][i] * F[2][j];
    for (int i = 0; i < 3; i++) trace += C[i][i];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) square += pow(C[i][j] - (i == j ? trace / 3 : 0), 2);
    const double rounding = bound_rounding * trace, q = sqrt(square);
    return (struct strain_maxima){.green_lagrange_shear = 0.25 * sqrt(2.0) * q + rounding,
                                  .green_lagrange_compression =
                                      0.5 * (1 - trace / 3 + sqrt(2.0 / 3) * q) + rounding};
}

static void raise_maxima(struct strain_maxima *largest, double F[3][3])
{
    const struct strain_maxima bound = bounds_of(F);
    double stretch[3];
    if (bound.green_lagrange_shear <= largest->green_lagrange_shear &&
        bound.green_lagrange_compression <= largest->green_lagrange_compression)
        return;
    principal_stretches(F, stretch);
    const struct strain_measures s = strain_measures_of(stretch);
    largest->green_lagrange_shear = fmax(largest->green_lagrange_shear, s.green_lagrange_shear);
    largest->green_lagrange_compression =
        fmax(largest->green_lagrange_compression, s.green_lagrange_compression);
}

/* Most points are far from the largest strain, and need no eigenvalues to show it. */
struct strain_maxima strain_muscle_maxima(const struct mesh *mesh, const double *displacement_mm)
{
    struct strain_maxima largest = {0, 0};
    for (int e = 0; e < mesh->muscle_count; e++) {
        const struct hex_corners X = hex_gather(mesh->hex[e], &mesh->X_mm[0][0]);
        const struct hex_corners u = hex_gather(mesh->hex[e], displacement_mm);
        for (int q = 0; q < HEX_CELLS; q++) {
            const struct hex_point p = hex_point_at(&X, q);
            double F[3][3];
            deformation_gradient(&p, &u, F);
            raise_maxima(&largest, F);
        }
    }
    return largest;
}

double strain_muscle_volume_mm3(const struct mesh *mesh, const struct strain_field *field)
{
    double sum = 0;
    for (int i = 0; i < mesh->muscle_count * HEX_CELLS; i++) sum += field->cell[i].volume_mm3;
    return sum;
}
