/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/case.h"

#include <math.h>

/* Studied ranges: the smallest and largest values of Tables 1 and 2 of Macron et al. (2020). */
const struct ischia_param_info ischia_params[ISCHIA_PARAM_COUNT] = {
    [ISCHIA_R1] = {"R1", "mm", 3, 15, 4.8, 9},    [ISCHIA_R2] = {"R2", "mm", 8, 120, 15, 63.3},
    [ISCHIA_EM] = {"eM", "mm", 5, 60, 19, 39},    [ISCHIA_EF] = {"eF", "mm", 3, 60, 9, 35},
    [ISCHIA_MUM] = {"muM", "kPa", 0.5, 30, 1, 8}, [ISCHIA_MUF] = {"muF", "kPa", 0.5, 30, 2.75, 8},
    [ISCHIA_F] = {"F", "N", 1, 600, 192, 429},
};

const struct ischia_option_info ischia_options[ISCHIA_OPTION_COUNT] = {
    [ISCHIA_SKIN_MU] = {"skin", "mu", "kPa", 5, 1000, 67},
    [ISCHIA_SKIN_THICKNESS] = {"skin", "thickness", "mm", 0.5, 3, 1},
    [ISCHIA_L_OVER_H] = {"model", "L_over_h", "1", 1.5, 6, 2},
    [ISCHIA_BULK_RATIO] = {"model", "bulk_ratio", "1", 10, 20000, 2000},
    [ISCHIA_FRICTION] = {"model", "friction", "1", 0, 2, 0.4},
    [ISCHIA_R2_SURFACE] = {"model", "R2_surface", "1", 0, 1, 0},
    [ISCHIA_EMBED_OVER_R1] = {"model", "embed_over_R1", "1", 1, 1.5, 1},
};

const char *const ischia_resolution_names[ISCHIA_RESOLUTION_COUNT] = {
    [ISCHIA_STANDARD] = "standard",
    [ISCHIA_FINE] = "fine",
    [ISCHIA_COARSE] = "coarse",
};

const struct ischia_preset ischia_presets[ISCHIA_PRESET_COUNT] = {
    {"default",
     {[ISCHIA_SKIN_MU] = 67,
      [ISCHIA_SKIN_THICKNESS] = 1,
      [ISCHIA_L_OVER_H] = 2,
      [ISCHIA_BULK_RATIO] = 2000,
      [ISCHIA_FRICTION] = 0.4,
      [ISCHIA_R2_SURFACE] = 0,
      [ISCHIA_EMBED_OVER_R1] = 1}},
    {"as-published",
     {[ISCHIA_SKIN_MU] = 67,
      [ISCHIA_SKIN_THICKNESS] = 1,
      [ISCHIA_L_OVER_H] = 2,
      [ISCHIA_BULK_RATIO] = 100,
      [ISCHIA_FRICTION] = 0.4,
      [ISCHIA_R2_SURFACE] = 0,
      [ISCHIA_EMBED_OVER_R1] = 1}},
};

struct ischia_case ischia_case_default(void)
{
    struct ischia_case c = {.resolution = ISCHIA_STANDARD};
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) c.param[i] = (double)NAN;
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++) c.option[i] = ischia_options[i].default_value;
    return c;
}

static bool within(double value, double min, double max)
{
    return isfinite(value) && value >= min && value <= max;
}

bool ischia_case_is_valid(const struct ischia_case *c)
{
    struct ischia_case_fault faults[ISCHIA_CASE_FAULTS_MAX];
    return c != NULL && (unsigned)c->resolution < ISCHIA_RESOLUTION_COUNT &&
           ischia_case_faults(c, faults) == 0;
}

size_t ischia_case_faults(const struct ischia_case *c,
                          struct ischia_case_fault ret_faults[ISCHIA_CASE_FAULTS_MAX])
{
    size_t n = 0;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct ischia_param_info *info = &ischia_params[i];
        if (within(c->param[i], info->accepted_min, info->accepted_max)) continue;
        ret_faults[n++] = (struct ischia_case_fault){
            isnan(c->param[i]) ? ISCHIA_CASE_MISSING : ISCHIA_CASE_OUT_OF_RANGE, i};
    }
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++) {
        const struct ischia_option_info *info = &ischia_options[i];
        if (within(c->option[i], info->accepted_min, info->accepted_max)) continue;
        ret_faults[n++] =
            (struct ischia_case_fault){ISCHIA_CASE_OUT_OF_RANGE, ISCHIA_PARAM_COUNT + i};
    }
    if (c->param[ISCHIA_R2] < c->param[ISCHIA_R1])
        ret_faults[n++] = (struct ischia_case_fault){ISCHIA_CASE_ORDER, ISCHIA_R2};
    return n;
}

size_t ischia_case_warnings(const struct ischia_case *c,
                            struct ischia_case_fault ret_warnings[ISCHIA_PARAM_COUNT])
{
    size_t n = 0;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct ischia_param_info *info = &ischia_params[i];
        if (!within(c->param[i], info->studied_min, info->studied_max))
            ret_warnings[n++] = (struct ischia_case_fault){ISCHIA_CASE_UNSTUDIED, i};
    }
    return n;
}
