/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * How eps_max converges with the mesh, and whether the shipped results say how far they are off:
 * each side on three meshes of one family, whose divisions are 3, 4 and 5 times the same, with
 * twice as many layers from bone to seat for their columns as `standard`. With e_k = e + C h_k^p
 * the three give the observed order p and the limit e (Roache 1998; unequal ratios, p by
 * bisection). p is confined to [order_min, order_max]: outside it the three meshes are not yet in
 * the range where the law holds, and the limit is drawn from the finer two with the nearest p.
 *
 * usage: study_mesh SIDE ...          e.g. study_mesh 1R 7L 8L 9R 10R 12R
 * Fails when a mesh does not converge, when `standard` is further than standard_max from the limit
 * (muM >= 2 kPa), or when its own error estimate covers the limit on less than nine sides in ten
 * (five of six).
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/verification/sides.h"

static const double standard_max = 0.01, covered_min = 5.0 / 6, order_min = 1, order_max = 3;
static const double firm_muM_kPa = 2;
static const struct variant shipped = {0.4, 0, 1};
enum { MESHES = 3 };
static const struct mesh_divisions family[MESHES] = {
    {.across = 6, .around = 3, .radial = 18, .fat = 6, .skin = 1},
    {.across = 8, .around = 4, .radial = 24, .fat = 8, .skin = 1},
    {.across = 10, .around = 5, .radial = 30, .fat = 10, .skin = 1},
};

struct limit {
    double order, eps_max;
};

static double size_of(int mesh) { return 1.0 / family[mesh].across; }

/* (e0 - e1) / (e1 - e2) as the order p would have it. */
static double ratio_at(double p)
{
    return (pow(size_of(0), p) - pow(size_of(1), p)) / (pow(size_of(1), p) - pow(size_of(2), p));
}

static struct limit limit_of(const double eps[MESHES])
{
    const double wanted = (eps[0] - eps[1]) / (eps[1] - eps[2]);
    double low = order_min, high = order_max;
    for (int i = 0; i < 60; i++) {
        const double middle = (low + high) / 2;
        if (ratio_at(middle) < wanted)
            low = middle;
        else
            high = middle;
    }
    const double p = (low + high) / 2, fine = pow(size_of(2), p), coarser = pow(size_of(1), p);
    return (struct limit){p, eps[2] + (eps[2] - eps[1]) * fine / (coarser - fine)};
}

static enum ischia_code solve_family(const struct ischia_case *c, double ret_eps[MESHES],
                                     bool *ret_sound, struct ischia_error *err)
{
    *ret_sound = true;
    for (int k = 0; k < MESHES; k++) {
        struct outcome outcome = {0};
        TRY(solve_on(&family[k], c, &shipped, &outcome, err));
        ret_eps[k] = outcome.eps_max;
        if (!is_sound(&outcome)) *ret_sound = false;
    }
    return ISCHIA_OK;
}

static enum ischia_code solve_standard(const struct ischia_case *c, struct ischia_result *ret,
                                       struct ischia_error *err)
{
    struct ischia_solver *solver = NULL;
    TRY(ischia_solver_create(&solver, err));
    const enum ischia_code code = ischia_solve(solver, c, NULL, ret, NULL, err);
    ischia_solver_destroy(solver);
    return code;
}

struct tally {
    int sides, covered;
    bool passed;
};

static enum ischia_code study(const struct side *side, struct tally *tally,
                              struct ischia_error *err)
{
    const struct ischia_case c = side_case(side, ISCHIA_STANDARD);
    struct ischia_result standard = {0};
    double eps[MESHES];
    bool sound;
    TRY(solve_standard(&c, &standard, err));
    TRY(solve_family(&c, eps, &sound, err));
    const struct limit limit = limit_of(eps);
    const double off = standard.strain.eps_max - limit.eps_max;
    const bool covered = fabs(off) <= standard.numerics.eps_max_error;
    printf("%-4s %9.4f %9.4f %9.4f %6.2f %9.4f %9.4f %9.4f %+8.2f %% %s%s\n", side->name, eps[0],
           eps[1], eps[2], limit.order, limit.eps_max, standard.strain.eps_max,
           standard.numerics.eps_max_error, 100 * off / limit.eps_max, covered ? "yes" : "no",
           sound ? "" : "  a mesh has not converged");
    (void)fflush(stdout);
    tally->sides++;
    tally->covered += covered;
    const bool firm = side->param[ISCHIA_MUM] >= firm_muM_kPa;
    if (!sound || !ischia_result_converged(&standard) ||
        (firm && fabs(off) > standard_max * limit.eps_max))
        tally->passed = false;
    return ISCHIA_OK;
}

int main(int argc, char **argv)
{
    struct tally tally = {.passed = argc > 1};
    printf("side    6 cells   8 cells  10 cells  order     limit  standard     error       off   "
           "covered\n");
    for (int i = 1; i < argc; i++) {
        struct ischia_error err;
        const struct side *side = side_of(argv[i]);
        if (side == NULL || study(side, &tally, &err) != ISCHIA_OK) {
            (void)fprintf(stderr, "%s: %s\n", argv[i], side == NULL ? "no such side" : err.message);
            return 1;
        }
    }
    printf("covered: %d of %d\n", tally.covered, tally.sides);
    return tally.passed && tally.covered >= covered_min * tally.sides ? 0 : 1;
}
