/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/measure.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/case_words.h"

/* Places in the assessment document, in the order of ischia_params. */
static const char *const input_pointers[ISCHIA_PARAM_COUNT] = {
    "/parameters/R1",  "/parameters/R2",  "/parameters/eM", "/parameters/eF",
    "/parameters/muM", "/parameters/muF", "/parameters/F",
};

static const char *const input_displays[ISCHIA_PARAM_COUNT] = {
    [ISCHIA_R1] = "Ischium, smaller radius of curvature",
    [ISCHIA_R2] = "Ischium, radius of curvature in the orthogonal plane",
    [ISCHIA_EM] = "Muscle thickness under the ischium",
    [ISCHIA_EF] = "Fat thickness under the ischium",
    [ISCHIA_MUM] = "Shear modulus of muscle",
    [ISCHIA_MUF] = "Shear modulus of fat",
    [ISCHIA_F] = "Vertical force on this side",
};

static const struct result_row {
    struct measure measure;
    size_t offset; /* of a double in struct ischia_result */
} results[MEASURE_RESULT_COUNT] = {
    {{"eps_max", "Engineering shear strain on the axis", "1",
      "Largest engineering principal shear strain in muscle on the symmetry axis.",
      "/result/strain/eps_max"},
     offsetof(struct ischia_result, strain.eps_max)},
    {{"eps_max_error", "Discretisation error of eps_max", "1",
      "Estimated absolute discretisation error of eps_max.", "/result/numerics/eps_max_error"},
     offsetof(struct ischia_result, numerics.eps_max_error)},
    {{"E_shear", "Green-Lagrange shear strain", "1",
      "Largest Green-Lagrange shear strain anywhere in muscle; threshold 0.75.",
      "/result/strain/E_shear_max"},
     offsetof(struct ischia_result, strain.E_shear_max)},
    {{"E_comp", "Green-Lagrange compressive strain", "1",
      "Largest magnitude of the Green-Lagrange compressive strain in muscle; threshold 0.45.",
      "/result/strain/E_comp_max"},
     offsetof(struct ischia_result, strain.E_comp_max)},
    {{"volume_shear", "Muscle over the shear threshold", "mm3",
      "Unloaded muscle volume of the whole side over the shear threshold.",
      "/result/clusters/shear/volume_mm3"},
     offsetof(struct ischia_result, clusters[ISCHIA_OVER_SHEAR].volume_mm3)},
    {{"volume_compression", "Muscle over the compression threshold", "mm3",
      "Unloaded muscle volume of the whole side over the compression threshold.",
      "/result/clusters/compression/volume_mm3"},
     offsetof(struct ischia_result, clusters[ISCHIA_OVER_COMPRESSION].volume_mm3)},
    {{"volume_both", "Muscle over both thresholds", "mm3",
      "Unloaded muscle volume of the whole side over both thresholds.",
      "/result/clusters/both/volume_mm3"},
     offsetof(struct ischia_result, clusters[ISCHIA_OVER_BOTH].volume_mm3)},
    {{"largest_both", "Largest connected muscle over both thresholds", "mm3",
      "Unloaded volume of the largest connected body of muscle over both thresholds.",
      "/result/clusters/both/largest/volume_mm3"},
     offsetof(struct ischia_result, clusters[ISCHIA_OVER_BOTH].largest.volume_mm3)},
    {{"seat_displacement", "Travel of the seat", "mm", "Travel of the rigid seat.",
      "/result/seat/displacement_mm"},
     offsetof(struct ischia_result, seat.displacement_mm)},
    {{"contact_area", "Contact area of the seat", "mm2",
      "Area of the skin in contact with the seat, whole side.", "/result/seat/contact_area_mm2"},
     offsetof(struct ischia_result, seat.contact_area_mm2)},
    {{"mean_pressure", "Mean pressure on the seat", "kPa", "Force over contact area.",
      "/result/seat/mean_pressure_kPa"},
     offsetof(struct ischia_result, seat.mean_pressure_kPa)},
    {{"peak_pressure", "Peak pressure on the seat", "kPa", "Largest contact pressure on the seat.",
      "/result/seat/peak_pressure_kPa"},
     offsetof(struct ischia_result, seat.peak_pressure_kPa)},
    {{"force_shear", "Force at which the shear threshold is crossed", "N",
      "Force on this side at which the load path first crosses the shear threshold.",
      "/result/threshold_force_N/shear"},
     offsetof(struct ischia_result, threshold_force_shear_N)},
    {{"force_compression", "Force at which the compression threshold is crossed", "N",
      "Force on this side at which the load path first crosses the compression threshold.",
      "/result/threshold_force_N/compression"},
     offsetof(struct ischia_result, threshold_force_compression_N)},
};

static const struct interval_row {
    struct measure measure;
    int quantile;
} intervals[MEASURE_INTERVAL_COUNT] = {
    {{"eps_max_q05", "Shear strain on the axis, 5 % quantile", "1",
      "Five in a hundred samples of the uncertain inputs have a smaller eps_max.",
      "/result/uncertainty/strain/eps_max/0"},
     0},
    {{"eps_max_q95", "Shear strain on the axis, 95 % quantile", "1",
      "Five in a hundred samples of the uncertain inputs have a larger eps_max.",
      "/result/uncertainty/strain/eps_max/4"},
     UNCERTAINTY_QUANTILES - 1},
};

struct measure measure_at(int index)
{
    assert(index >= 0 && index < MEASURE_COUNT);
    if (index >= MEASURE_FIRST_INTERVAL) return intervals[index - MEASURE_FIRST_INTERVAL].measure;
    if (!measure_is_input(index)) return results[index - ISCHIA_PARAM_COUNT].measure;
    const struct ischia_param_info *p = &ischia_params[index];
    return (struct measure){p->key, input_displays[index], p->unit,
                            words_get(LANGUAGE_EN, param_words[index].help), input_pointers[index]};
}

int measure_find(const char *code)
{
    for (int i = 0; i < MEASURE_COUNT; i++)
        if (strcmp(measure_at(i).code, code) == 0) return i;
    return -1;
}

double measure_value(int index, const struct ischia_case *c, const struct ischia_result *result,
                     const struct ischia_uncertainty *u)
{
    if (measure_is_input(index)) return c->param[index];
    if (index >= MEASURE_FIRST_INTERVAL) {
        const int quantile = intervals[index - MEASURE_FIRST_INTERVAL].quantile;
        return u == NULL ? (double)NAN : u->quantile[UNCERTAIN_EPS_MAX][quantile];
    }
    const struct result_row *row = &results[index - ISCHIA_PARAM_COUNT];
    const bool of_largest = row->offset == offsetof(struct ischia_result,
                                                    clusters[ISCHIA_OVER_BOTH].largest.volume_mm3);
    if (of_largest && !result->clusters[ISCHIA_OVER_BOTH].has_largest) return (double)NAN;
    double value;
    memcpy(&value, (const char *)result + row->offset, sizeof value);
    return value;
}

void measure_id(int index, char ret[MEASURE_ID_BYTES])
{
    (void)snprintf(ret, MEASURE_ID_BYTES, "%s", measure_at(index).code);
    for (char *c = ret; *c != '\0'; c++)
        if (*c == '_') *c = '-';
}
