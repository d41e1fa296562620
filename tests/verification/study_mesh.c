/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * How eps_max converges with the mesh, and whether the shipped results say how far they are off:
 * each side on three meshes of one family, whose divisions are 2, 3 and 4 times the same. The two
 * readings of eps_max (axis.h) converge to the same value, and their bracket closes as h^p: least
 * squares over the three meshes give the observed order p. The limit is extrapolated from the
 * middles of the brackets of the finer two meshes with order two, that of the element, for the
 * middle itself need not be monotone (Roache 1998).
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

static const double standard_max = 0.01, covered_min = 5.0 / 6, element_order = 2;
static const double firm_muM_kPa = 2;
static const struct variant shipped = {0.4, 0, 1};
enum { MESHES = 3 };
static const struct mesh_divisions family[MESHES] = {
    {.across = 6, .around = 2, .radial = 22, .fat = 4, .skin = 1},
    {.across = 9, .around = 3, .radial = 33, .fat = 6, .skin = 1},
    {.across = 12, .around = 4, .radial = 44, .fat = 8, .skin = 1},
};

struct limit {
    double order, eps_max;
};

static double size_of(int mesh) { return 1.0 / family[mesh].across; }

/* Slope of log bracket over log h, by least squares. */
static double order_of(const struct axis_strain strain[MESHES])
{
    double x = 0, y = 0, xx = 0, xy = 0;
    for (int k = 0; k < MESHES; k++) {
        const double h = log(size_of(k)), b = log(fabs(strain[k].recovered - strain[k].raw));
        x += h / MESHES;
        y += b / MESHES;
        xx += h * h / MESHES;
        xy += h * b / MESHES;
    }
    return (xy - x * y) / (xx - x * x);
}

static double middle_of(const struct axis_strain *s) { return (s->recovered + s->raw) / 2; }

static struct limit limit_of(const struct axis_strain strain[MESHES])
{
    const double fine = pow(size_of(MESHES - 1), element_order);
    const double coarser = pow(size_of(MESHES - 2), element_order);
    const double eps = middle_of(&strain[MESHES - 1]), before = middle_of(&strain[MESHES - 2]);
    return (struct limit){order_of(strain), eps + (eps - before) * fine / (coarser - fine)};
}

static enum ischia_code solve_family(const struct ischia_case *c,
                                     struct axis_strain ret_strain[MESHES], bool *ret_sound,
                                     struct ischia_error *err)
{
    *ret_sound = true;
    for (int k = 0; k < MESHES; k++) {
        struct outcome outcome = {0};
        TRY(solve_on(&family[k], c, &shipped, &outcome, err));
        ret_strain[k] = outcome.strain;
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
    struct axis_strain strain[MESHES];
    bool sound;
    TRY(solve_standard(&c, &standard, err));
    TRY(solve_family(&c, strain, &sound, err));
    const struct limit limit = limit_of(strain);
    const double off = standard.strain.eps_max - limit.eps_max;
    const bool covered = fabs(off) <= standard.numerics.eps_max_error;
    printf("%-4s", side->name);
    for (int k = 0; k < MESHES; k++) printf("  %.4f %.4f", strain[k].raw, strain[k].recovered);
    printf(" %6.2f %9.4f %9.4f %9.4f %+8.2f %% %s%s\n", limit.order, limit.eps_max,
           standard.strain.eps_max, standard.numerics.eps_max_error, 100 * off / limit.eps_max,
           covered ? "yes" : "no", sound ? "" : "  a mesh has not converged");
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
    printf("      6 cells         9 cells         12 cells\n"
           "side  raw    recov.   raw    recov.   raw    recov.  order     limit  standard     "
           "error       off   covered\n");
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
