/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/blas_environment.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const struct blas_setting one_thread[] = {
    {"OPENBLAS_NUM_THREADS", "1"}, {"OMP_NUM_THREADS", "1"}, {"OMP_THREAD_LIMIT", "1"}};
static const char *const kernels = "OPENBLAS_CORETYPE";

static bool has_avx512(void)
{
#ifdef __x86_64__
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
#else
    return false;
#endif
}

size_t blas_environment(struct blas_setting ret[BLAS_SETTINGS_MAX])
{
    size_t count = sizeof one_thread / sizeof one_thread[0];
    const char *chosen = getenv(kernels);
    memcpy(ret, one_thread, sizeof one_thread);
    if (chosen != NULL)
        ret[count++] = (struct blas_setting){kernels, chosen};
    else if (has_avx512())
        ret[count++] = (struct blas_setting){kernels, "SkylakeX"};
    return count;
}

void blas_environment_ensure(const char *program, char **argv)
{
    struct blas_setting setting[BLAS_SETTINGS_MAX];
    const size_t count = blas_environment(setting);
    bool changed = false;
    for (size_t i = 0; i < count; i++) {
        const char *now = getenv(setting[i].name);
        if (now != NULL && strcmp(now, setting[i].value) == 0) continue;
        if (setenv(setting[i].name, setting[i].value, 1) != 0) return;
        changed = true;
    }
    if (!changed) return;
    (void)execv("/proc/self/exe", argv);
    (void)fprintf(stderr,
                  "%s: cannot restart with one BLAS thread (%s): set OPENBLAS_NUM_THREADS=1 and "
                  "OMP_NUM_THREADS=1 for repeatable bits\n",
                  program, strerror(errno));
}
