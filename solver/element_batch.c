/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/element_batch.h"

#include <stddef.h>

void element_batch_set(struct element_batch *batch, int lane, const struct element_reference *ref,
                       const struct element_material *material)
{
    const double share = material->corner_share;
    for (int g = 0; g < HEX_RULE_POINTS; g++) {
        for (int i = 0; i < 3; i++)
            for (int a = 0; a < HEX_NODES; a++) batch->dN[g][i][a][lane] = ref->dN[g][i][a];
        batch->weight[g][lane] = ref->weight[g];
    }
    batch->volume[lane] = ref->volume;
    batch->mu_MPa[POINT_GAUSS][lane] = (1 - share) * material->mu_MPa;
    batch->mu_MPa[POINT_CORNER][lane] = share * material->mu_MPa;
    batch->kappa_mean_MPa[lane] = material->kappa_MPa - material->kappa_point_MPa;
    batch->kappa_point_MPa[POINT_GAUSS][lane] = material->kappa_point_MPa;
    batch->kappa_point_MPa[POINT_CORNER][lane] = 0;
}

static bool always(void) { return true; }

#ifdef __x86_64__
static bool has_avx512(void)
{
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl");
}

static bool has_avx2(void) { return __builtin_cpu_supports("avx2"); }
#endif

/* The widest first; solver/meson.build compiles element_kernel.c for each. */
static const struct {
    const struct element_kernel *kernel;
    bool (*runs_here)(void);
} kernels[] = {
#ifdef __x86_64__
    {&element_kernel_avx512, has_avx512},
    {&element_kernel_avx2, has_avx2},
#endif
    {&element_kernel_base, always},
};

const struct element_kernel *element_kernel(int index)
{
    for (size_t k = 0; k < sizeof kernels / sizeof kernels[0]; k++)
        if (kernels[k].runs_here() && index-- == 0) return kernels[k].kernel;
    return NULL;
}
