/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/strain.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solver/kinematics.h"

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

struct strain_measures strain_muscle_maxima(const struct mesh *mesh,
                                            const struct strain_field *field)
{
    struct strain_measures largest = {0, 0, 0};
    for (int i = 0; i < mesh->muscle_count * HEX_CELLS; i++) {
        const struct strain_measures *s = &field->cell[i].strain;
        largest.green_lagrange_shear = fmax(largest.green_lagrange_shear, s->green_lagrange_shear);
        largest.green_lagrange_compression =
            fmax(largest.green_lagrange_compression, s->green_lagrange_compression);
        largest.engineering_shear = fmax(largest.engineering_shear, s->engineering_shear);
    }
    return largest;
}

double strain_muscle_volume_mm3(const struct mesh *mesh, const struct strain_field *field)
{
    double sum = 0;
    for (int i = 0; i < mesh->muscle_count * HEX_CELLS; i++) sum += field->cell[i].volume_mm3;
    return sum;
}
