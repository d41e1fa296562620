/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/estimate_doc.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/case_words.h"
#include "solver/result.h"

#define no_limit 1e300 /* above every value */

/* The members of the document, in their order: "group" or "group.part", key, response. */
static const struct shown {
    const char *group, *part, *key, *response;
    double ceiling; /* no value is above it */
    bool crossing;  /* a force at which a threshold is crossed: null beyond the case's own force */
} shown[] = {
    {"strain", NULL, "eps_max", "eps_max", no_limit, false},
    {"strain", NULL, "E_shear_max", "E_shear_max", no_limit, false},
    {"strain", NULL, "E_comp_max", "E_comp_max", 0.5, false},
    {"clusters", "shear", "volume_mm3", "volume_shear_mm3", no_limit, false},
    {"clusters", "compression", "volume_mm3", "volume_compression_mm3", no_limit, false},
    {"clusters", "both", "volume_mm3", "volume_both_mm3", no_limit, false},
    {"seat", NULL, "displacement_mm", "seat_displacement_mm", no_limit, false},
    {"threshold_force_N", NULL, "shear", "force_shear_N", no_limit, true},
    {"threshold_force_N", NULL, "compression", "force_compression_N", no_limit, true},
};
enum { SHOWN_COUNT = sizeof shown / sizeof shown[0] };

/* -------------------------------------------------------------------------------- values */

/* Nothing here is negative. */
static double between(double value, double ceiling) { return fmin(fmax(value, 0), ceiling); }

static void put_estimate(struct json_out *out, const char *key, struct predictor_estimate e)
{
    json_open_object(out, key);
    json_put_number(out, "value", e.value);
    json_put_number(out, "low", e.low);
    json_put_number(out, "high", e.high);
    json_close_object(out);
}

/* False when the emulator has no such output. */
static bool find_estimate(const struct predictor *p, const struct shown *s,
                          const struct predictor_point *point, struct predictor_estimate *ret)
{
    const struct predictor_output *output = predictor_output_named(p, s->response);
    if (output == NULL) return false;
    const struct predictor_estimate e = predictor_estimate_of(p, output, point);
    *ret = (struct predictor_estimate){between(e.value, s->ceiling), between(e.low, s->ceiling),
                                       between(e.high, s->ceiling)};
    return true;
}

static void write_value(struct json_out *out, const struct shown *s, const struct predictor *p,
                        const struct predictor_point *point, double F_N)
{
    struct predictor_estimate e;
    if (find_estimate(p, s, point, &e) && !(s->crossing && e.value > F_N))
        put_estimate(out, s->key, e);
    else
        json_put_null(out, s->key);
}

void estimate_put_values(struct json_out *out, const struct predictor *p,
                         const struct ischia_case *c)
{
    struct predictor_point point;
    if (c != NULL) point = predictor_point_of(p, c);
    for (int i = 0; i < SHOWN_COUNT; i++) {
        const bool begins = i == 0 || strcmp(shown[i - 1].group, shown[i].group) != 0;
        const bool ends = i + 1 == SHOWN_COUNT || strcmp(shown[i + 1].group, shown[i].group) != 0;
        if (c == NULL) {
            if (begins) json_put_null(out, shown[i].group);
            continue;
        }
        if (begins) json_open_object(out, shown[i].group);
        if (shown[i].part != NULL) json_open_object(out, shown[i].part);
        write_value(out, &shown[i], p, &point, c->param[ISCHIA_F]);
        if (shown[i].part != NULL) json_close_object(out);
        if (ends) json_close_object(out);
    }
}

void estimate_put_forces(struct json_out *out, const char *key, const struct predictor *p,
                         const struct ischia_case *c)
{
    const struct predictor_point point = predictor_point_of(p, c);
    json_open_object(out, key);
    for (int i = 0; i < SHOWN_COUNT; i++)
        if (shown[i].crossing) write_value(out, &shown[i], p, &point, no_limit);
    json_close_object(out);
}

void estimate_put_margins(struct json_out *out, const char *key, const struct predictor *p,
                          const struct ischia_case *c)
{
    static const struct {
        const char *key;
        struct shown strain;
        double threshold;
    } margins[] = {
        {"shear", {.response = "E_shear_max", .ceiling = no_limit}, ISCHIA_E_SHEAR_THRESHOLD},
        {"compression", {.response = "E_comp_max", .ceiling = 0.5}, ISCHIA_E_COMP_THRESHOLD},
    };
    const struct predictor_point point = predictor_point_of(p, c);
    json_open_object(out, key);
    for (size_t i = 0; i < sizeof margins / sizeof margins[0]; i++) {
        struct predictor_estimate e;
        const double at = margins[i].threshold;
        if (find_estimate(p, &margins[i].strain, &point, &e))
            put_estimate(out, margins[i].key,
                         (struct predictor_estimate){at - e.value, at - e.high, at - e.low});
        else
            json_put_null(out, margins[i].key);
    }
    json_close_object(out);
}

/* ------------------------------------------------------------------------------ warnings */

static void write_warning(struct json_out *out, const char *code, const char *pointer,
                          const char *detail)
{
    json_open_object(out, NULL);
    json_put_string(out, "code", code);
    json_put_string(out, "pointer", pointer);
    json_put_string(out, "detail", detail);
    json_close_object(out);
}

static void warn_of_input(struct json_out *out, const struct predictor *p,
                          const struct ischia_case *c, enum ischia_param i)
{
    const struct ischia_param_info *info = &ischia_params[i];
    char pointer[16], detail[160];
    if (predictor_covers(p, c, i)) return;
    (void)snprintf(pointer, sizeof pointer, "/%s", info->key);
    (void)snprintf(detail, sizeof detail,
                   "%s is %.6g %s; the emulator was trained for %.6g to %.6g %s: no estimate",
                   info->key, c->param[i], info->unit, p->input[i].min, p->input[i].max,
                   info->unit);
    write_warning(out, "outside_training", pointer, detail);
}

void estimate_put_warnings(struct json_out *out, const struct predictor *p,
                           const struct ischia_case *c, enum language language)
{
    struct ischia_fault outside[ISCHIA_PARAM_COUNT];
    const size_t count = case_warnings(c, language, outside);
    json_open_array(out, "warnings");
    for (size_t i = 0; i < count; i++)
        write_warning(out, outside[i].code, outside[i].pointer, outside[i].detail);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) warn_of_input(out, p, c, (enum ischia_param)i);
    if (!predictor_same_options(p, c))
        write_warning(out, "other_model", "/model",
                      "the emulator was trained with other options of model or skin: no estimate");
    if (p->trial)
        write_warning(out, "trial_emulator", "",
                      "this emulator was made for trying out: do not rely on its numbers");
    json_close_array(out);
}

/* ------------------------------------------------------------------------------- whose */

void estimate_put_emulator(struct json_out *out, const struct estimator *estimator)
{
    const struct predictor *p = &estimator->predictor;
    json_open_object(out, "emulator");
    json_put_integer(out, "rows", p->rows);
    json_put_string(out, "resolution", ischia_resolution_names[p->resolution]);
    json_put_bool(out, "trial", p->trial);
    json_put_string(out, "sha256", estimator->digest);
    json_close_object(out);
}
