/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/ogden.h"

#include "solver/ogden_lanes.h"

static void terms_of(const double s[3], struct ogden_terms *ret)
{
    const lanes stretch[3] = {lanes_all(s[0]), lanes_all(s[1]), lanes_all(s[2])};
    ogden_terms_init(ret, stretch);
}

double ogden_energy(double mu_MPa, const double s[3])
{
    struct ogden_terms terms;
    terms_of(s, &terms);
    return ogden_energy_lanes(lanes_all(mu_MPa), &terms)[0];
}

void ogden_derivatives(double mu_MPa, double pressure_MPa, const double s[3],
                       struct ogden_derivatives *ret)
{
    struct ogden_terms terms;
    struct ogden_tangent tangent;
    terms_of(s, &terms);
    ogden_tangent(lanes_all(mu_MPa), lanes_all(pressure_MPa), &terms, &tangent);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        ret->gradient[k] = tangent.gradient[k][0];
        ret->normal[k][k] = tangent.normal[k][0];
        ret->normal[i][j] = ret->normal[j][i] = tangent.mixed[k][0];
        ret->even[k] = tangent.even[k][0];
        ret->odd[k] = tangent.odd[k][0];
    }
}
