/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Accuracy for the time it takes, of two discretisations on the same nodes: bench_elements SIDE...
 * solves sides of sides.c on a family of meshes. Built twice: with the shipped 8-node elements of
 * constant pressure, and with 27-node elements of linear pressure (quadratic_body.c). CPU seconds,
 * the analysis of the sparsity left out: a process makes it once. A path that does not arrive
 * within so many factorisations is given up, as a first attempt is.
 */
#include <stdio.h>
#include <time.h>

#include "server/blas_environment.h"
#include "solver/units.h"
#include "tests/verification/sides.h"

/* Divisions are even, so that the 27-node elements fit. */
static const struct mesh_divisions family[] = {
    {.across = 4, .around = 2, .radial = 8, .fat = 2, .skin = 2},
    {.across = 6, .around = 2, .radial = 12, .fat = 4, .skin = 2},
    {.across = 8, .around = 2, .radial = 16, .fat = 4, .skin = 2},
};
static const struct variant shipped = {0.4, 0, 1};
static const struct path_effort effort = {.pace = 1, .factorisations_max = 200};

static double cpu_seconds(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static enum ischia_code measure(const struct side *side, const struct mesh_divisions *d,
                                struct ischia_error *err)
{
    const struct ischia_case c = side_case(side, ISCHIA_STANDARD);
    struct run r = {0};
    struct outcome o = {0};
    enum ischia_code code = run_init(&r, &c, d, &shipped, err);
    const double since_s = cpu_seconds();
    if (code == ISCHIA_OK)
        code = path_follow(&r.body, &r.assembly, &r.seat, quarter_force_N(c.param[ISCHIA_F]),
                           &effort, NULL, &r.state, &o.path, err);
    const double spent_s = cpu_seconds() - since_s;
    if (code == ISCHIA_OK) run_measure(&r, &o);
    if (code == ISCHIA_OK)
        printf("%-4s %6d %8.2f %7d %8.4f %8.4f %9.4f %8s\n", side->name, r.assembly.n + 1, spent_s,
               o.path.factorisations, o.strain.raw, o.strain.recovered, o.d_mm,
               is_sound(&o) ? "yes" : "no");
    (void)fflush(stdout);
    run_finish(&r);
    return code;
}

int main(int argc, char **argv)
{
    blas_environment_ensure("bench_elements", argv);
    printf("side    dof    CPU_s  factor      raw   recov.      d_mm  arrived\n");
    for (int i = 1; i < argc; i++) {
        const struct side *side = side_of(argv[i]);
        for (size_t k = 0; k < sizeof family / sizeof *family; k++) {
            struct ischia_error err = {.message = "no such side"};
            if (side != NULL && measure(side, &family[k], &err) == ISCHIA_OK) continue;
            (void)fprintf(stderr, "bench_elements: %s: %s\n", argv[i], err.message);
            return 1;
        }
    }
    return 0;
}
