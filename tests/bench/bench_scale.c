/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * How cost grows with the mesh: bench_scale SIDE solves a side of sides.c, by the shipped rule, on
 * five meshes of one shape, each in a process of its own, for whose peak memory it is. CPU seconds,
 * the analysis of the sparsity included.
 */
#include <stdio.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/blas_environment.h"
#include "tests/verification/sides.h"

static const struct mesh_divisions sizes[] = {
    {.across = 4, .around = 1, .radial = 11, .fat = 2, .skin = 1},
    {.across = 6, .around = 2, .radial = 16, .fat = 4, .skin = 1},
    {.across = 8, .around = 2, .radial = 22, .fat = 5, .skin = 1},
    {.across = 10, .around = 3, .radial = 28, .fat = 6, .skin = 1},
    {.across = 12, .around = 3, .radial = 33, .fat = 8, .skin = 1},
};
static const struct variant shipped = {0.4, 0, 1};

static int equations(const struct mesh_divisions *d, const struct ischia_case *c)
{
    struct run r = {0};
    struct ischia_error err;
    const int n = run_init(&r, c, d, &shipped, &err) == ISCHIA_OK ? r.assembly.n + 1 : 0;
    run_finish(&r);
    return n;
}

/* In a process of its own. */
static int measure(const struct mesh_divisions *d, const struct ischia_case *c)
{
    struct ischia_error err;
    struct outcome o = {0};
    struct rusage before, after;
    const int n = equations(d, c);
    (void)getrusage(RUSAGE_SELF, &before);
    if (solve_on(d, c, &shipped, &o, &err) != ISCHIA_OK || !is_sound(&o)) return 1;
    (void)getrusage(RUSAGE_SELF, &after);
    const double cpu_s = (double)(after.ru_utime.tv_sec - before.ru_utime.tv_sec) +
                         1e-6 * (double)(after.ru_utime.tv_usec - before.ru_utime.tv_usec);
    printf("%-6d %8.3f %7d %8.0f %9.4f\n", n, cpu_s, o.path.factorisations,
           (double)after.ru_maxrss / 1024, o.eps_max);
    return fflush(stdout) == 0 ? 0 : 1;
}

int main(int argc, char **argv)
{
    blas_environment_ensure("bench_scale", argv);
    const struct side *side = argc == 2 ? side_of(argv[1]) : NULL;
    if (side == NULL) {
        (void)fprintf(stderr, "usage: bench_scale SIDE, of 1R 7L 8L 9R 10R 12R\n");
        return 2;
    }
    const struct ischia_case c = side_case(side, ISCHIA_STANDARD);
    printf("dof       CPU_s  factor       MB   eps_max\n");
    (void)fflush(stdout);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        const pid_t pid = fork();
        int status = 0;
        if (pid == 0) _exit(measure(&sizes[i], &c));
        if (pid < 0 || waitpid(pid, &status, 0) < 0 || status != 0) {
            (void)fprintf(stderr, "bench_scale: mesh %zu has no result\n", i);
            return 1;
        }
    }
    return 0;
}
