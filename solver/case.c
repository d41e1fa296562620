/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "solver/case.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Studied ranges: the smallest and largest values of Tables 1 and 2 of Macron et al. (2020). */
const struct ischia_param_info ischia_params[ISCHIA_PARAM_COUNT] = {
    [ISCHIA_R1] = {"R1", "mm", 3, 15, 4.8, 9,
                   "Radius of curvature of the ischium at its lowest point, in the plane where it "
                   "is smallest.",
                   "Smaller bone radius"},
    [ISCHIA_R2] = {"R2", "mm", 8, 120, 15, 63.3,
                   "Radius of curvature of the ischium in the plane at right angles to that of "
                   "R1; at least R1.",
                   "Larger bone radius"},
    [ISCHIA_EM] = {"eM", "mm", 5, 60, 19, 39,
                   "Thickness of the muscle under the ischium, unloaded.", "Muscle thickness"},
    [ISCHIA_EF] = {"eF", "mm", 3, 60, 9, 35, "Thickness of the fat under the muscle, unloaded.",
                   "Fat thickness"},
    [ISCHIA_MUM] = {"muM", "kPa", 0.5, 30, 1, 8, "Shear modulus of the muscle (Ogden, alpha 5).",
                    "Muscle stiffness"},
    [ISCHIA_MUF] = {"muF", "kPa", 0.5, 30, 2.75, 8, "Shear modulus of the fat (Ogden, alpha 5).",
                    "Fat stiffness"},
    [ISCHIA_F] = {"F", "N", 1, 600, 192, 429,
                  "Vertical force that the seat carries under this one ischium: the whole side.",
                  "Force on this side"},
};

const struct ischia_option_info ischia_options[ISCHIA_OPTION_COUNT] = {
    [ISCHIA_SKIN_MU] = {"skin", "mu", "kPa", 5, 1000, 67,
                        "Shear modulus of the skin (Ogden, alpha 5)."},
    [ISCHIA_SKIN_THICKNESS] = {"skin", "thickness", "mm", 0.5, 3, 1, "Thickness of the skin."},
    [ISCHIA_L_OVER_H] = {"model", "L_over_h", "1", 1.5, 6, 2,
                         "Width of the tissue box over its height eM + eF."},
    [ISCHIA_BULK_RATIO] = {"model", "bulk_ratio", "1", 10, 20000, 2000,
                           "Bulk modulus over shear modulus, the same for every tissue."},
    [ISCHIA_FRICTION] = {"model", "friction", "1", 0, 2, 0.4,
                         "Coulomb friction coefficient between seat and skin."},
    [ISCHIA_R2_SURFACE] = {"model", "R2_surface", "1", 0, 1, 0,
                           "0: R2 is the radius of the torus' centre line; 1: of its surface."},
    [ISCHIA_EMBED_OVER_R1] = {"model", "embed_over_R1", "1", 1, 1.5, 1,
                              "Depth to which the bone is embedded in the box, over R1."},
};

const char *const ischia_resolution_names[ISCHIA_RESOLUTION_COUNT] = {
    [ISCHIA_STANDARD] = "standard",
    [ISCHIA_FINE] = "fine",
    [ISCHIA_COARSE] = "coarse",
};

const struct ischia_preset ischia_presets[] = {
    {"default",
     "The paper's local model as written, truly incompressible tissue.",
     {[ISCHIA_SKIN_MU] = 67,
      [ISCHIA_SKIN_THICKNESS] = 1,
      [ISCHIA_L_OVER_H] = 2,
      [ISCHIA_BULK_RATIO] = 2000,
      [ISCHIA_FRICTION] = 0.4,
      [ISCHIA_R2_SURFACE] = 0,
      [ISCHIA_EMBED_OVER_R1] = 1}},
    {"as-published",
     "Slightly compressible tissue (Poisson's ratio near 0.48), the reading that comes nearest to "
     "the coefficients the paper prints.",
     {[ISCHIA_SKIN_MU] = 67,
      [ISCHIA_SKIN_THICKNESS] = 1,
      [ISCHIA_L_OVER_H] = 2,
      [ISCHIA_BULK_RATIO] = 30,
      [ISCHIA_FRICTION] = 0.4,
      [ISCHIA_R2_SURFACE] = 0,
      [ISCHIA_EMBED_OVER_R1] = 1}},
};
const size_t ischia_preset_count = sizeof ischia_presets / sizeof ischia_presets[0];

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
    struct ischia_fault faults[ISCHIA_CASE_FAULTS_MAX];
    return c != NULL && (unsigned)c->resolution < ISCHIA_RESOLUTION_COUNT &&
           ischia_case_faults(c, faults) == 0;
}

/* The unit as it follows a number in a sentence: nothing for a dimensionless one. */
static const char *spaced_unit(const char *unit, char buffer[16])
{
    if (strcmp(unit, "1") == 0) return "";
    (void)snprintf(buffer, 16, " %s", unit);
    return buffer;
}

static void out_of_range(struct ischia_fault *ret, const char *key, double value,
                         const char *plain_unit, double min, double max)
{
    char buffer[16];
    const char *unit = spaced_unit(plain_unit, buffer);
    (void)snprintf(ret->code, sizeof ret->code, "out_of_range");
    (void)snprintf(ret->detail, sizeof ret->detail, "%s is %.6g%s; accepted %g to %g%s", key, value,
                   unit, min, max, unit);
}

static size_t param_fault(const struct ischia_case *c, int i, struct ischia_fault *ret)
{
    const struct ischia_param_info *info = &ischia_params[i];
    if (within(c->param[i], info->accepted_min, info->accepted_max)) return 0;
    (void)snprintf(ret->pointer, sizeof ret->pointer, "/%s", info->key);
    out_of_range(ret, info->key, c->param[i], info->unit, info->accepted_min, info->accepted_max);
    if (isnan(c->param[i])) {
        (void)snprintf(ret->code, sizeof ret->code, "missing");
        (void)snprintf(ret->detail, sizeof ret->detail, "%s is missing; accepted %g to %g %s",
                       info->key, info->accepted_min, info->accepted_max, info->unit);
    }
    return 1;
}

static size_t option_fault(const struct ischia_case *c, int i, struct ischia_fault *ret)
{
    const struct ischia_option_info *info = &ischia_options[i];
    char name[48];
    if (within(c->option[i], info->accepted_min, info->accepted_max)) return 0;
    (void)snprintf(name, sizeof name, "%s.%s", info->group, info->key);
    (void)snprintf(ret->pointer, sizeof ret->pointer, "/%s/%s", info->group, info->key);
    out_of_range(ret, name, c->option[i], info->unit, info->accepted_min, info->accepted_max);
    return 1;
}

size_t ischia_case_faults(const struct ischia_case *c,
                          struct ischia_fault ret_faults[ISCHIA_CASE_FAULTS_MAX])
{
    size_t n = 0;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) n += param_fault(c, i, &ret_faults[n]);
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++) n += option_fault(c, i, &ret_faults[n]);
    if (c->param[ISCHIA_R2] < c->param[ISCHIA_R1]) {
        struct ischia_fault *fault = &ret_faults[n++];
        (void)snprintf(fault->pointer, sizeof fault->pointer, "/R2");
        (void)snprintf(fault->code, sizeof fault->code, "inconsistent");
        (void)snprintf(fault->detail, sizeof fault->detail,
                       "R2 is %.6g mm and R1 is %.6g mm; accepted R2 >= R1 (swapped?)",
                       c->param[ISCHIA_R2], c->param[ISCHIA_R1]);
    }
    return n;
}

size_t ischia_case_warnings(const struct ischia_case *c,
                            struct ischia_fault ret_warnings[ISCHIA_PARAM_COUNT])
{
    size_t n = 0;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct ischia_param_info *info = &ischia_params[i];
        if (within(c->param[i], info->studied_min, info->studied_max)) continue;
        struct ischia_fault *warning = &ret_warnings[n++];
        (void)snprintf(warning->pointer, sizeof warning->pointer, "/%s", info->key);
        (void)snprintf(warning->code, sizeof warning->code, "outside_study_range");
        (void)snprintf(warning->detail, sizeof warning->detail,
                       "%s is %.6g %s; the published study covers %g to %g %s", info->key,
                       c->param[i], info->unit, info->studied_min, info->studied_max, info->unit);
    }
    return n;
}
