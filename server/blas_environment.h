/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_BLAS_ENVIRONMENT_H
#define ISCHIA_SERVER_BLAS_ENVIRONMENT_H

#include <stddef.h>

/*
 * What OpenBLAS and CHOLMOD read from the environment when they are loaded, before main.
 *
 * One thread: a BLAS with threads sums in an order that depends on them, and threads would fight
 * over the cores that other processes have. CHOLMOD asks OpenMP for four threads by number,
 * whatever OMP_NUM_THREADS says; only the limit stops that.
 *
 * The kernels: Debian's OpenBLAS takes AVX2 kernels on AMD processors that have AVX-512, where its
 * AVX-512 ones (SkylakeX) are nearly twice as fast in products of matrices (docs/decisions, 20).
 * An operator's own OPENBLAS_CORETYPE is left alone.
 */
struct blas_setting {
    const char *name, *value;
};

/* The settings for this processor and operator, at most BLAS_SETTINGS_MAX; static storage. */
enum { BLAS_SETTINGS_MAX = 4 };
size_t blas_environment(struct blas_setting ret[BLAS_SETTINGS_MAX]);

/* Starts the program once more when its environment was another; returns when it was not, or when
 * that fails, with a line on stderr that begins with the program's name. */
void blas_environment_ensure(const char *program, char **argv);

#endif
