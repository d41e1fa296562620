/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/result_doc.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/fields.h"
#include "api/risk.h"
#include "api/uncertainty_doc.h"

/* What the tables below describe: the result, and what the document says beside it. */
struct view {
    struct ischia_result result;
    struct ischia_case c; /* written from, not read */
    struct result_model model;
};

#define NUMBER(type, member)                                                                       \
    {                                                                                              \
        .key = #member, .kind = FIELD_NUMBER, .offset = offsetof(struct type, member)              \
    }
#define NUMBER_OR_NULL(type, member)                                                               \
    {                                                                                              \
        .key = #member, .kind = FIELD_NUMBER_OR_NULL, .offset = offsetof(struct type, member)      \
    }
#define INTEGER(type, member)                                                                      \
    {                                                                                              \
        .key = #member, .kind = FIELD_INTEGER, .offset = offsetof(struct type, member)             \
    }
#define END                                                                                        \
    {                                                                                              \
        .key = NULL                                                                                \
    }

static const struct field strain_fields[] = {
    NUMBER(ischia_strain, eps_max),
    NUMBER(ischia_strain, eps_max_depth_mm),
    NUMBER(ischia_strain, E_shear_max),
    NUMBER(ischia_strain, E_comp_max),
    END,
};

/* ---- clusters ---- */

static const struct field cluster_fields[] = {
    NUMBER(ischia_cluster, volume_mm3),
    NUMBER(ischia_cluster, eps_max),
    NUMBER(ischia_cluster, E_shear_max),
    NUMBER(ischia_cluster, E_comp_max),
    {.key = "centroid_mm",
     .kind = FIELD_NUMBERS,
     .offset = offsetof(struct ischia_cluster, centroid_mm),
     .count = 3},
    END,
};

static bool has_largest(const void *base)
{
    return ((const struct ischia_cluster_set *)base)->has_largest;
}

static void set_has_largest(void *base, bool present)
{
    ((struct ischia_cluster_set *)base)->has_largest = present;
}

#define THRESHOLD(value)                                                                           \
    {                                                                                              \
        .key = "threshold", .kind = FIELD_CONSTANT, .constant = (value)                            \
    }
#define CLUSTER_SET_FIELDS                                                                         \
    NUMBER(ischia_cluster_set, volume_mm3), INTEGER(ischia_cluster_set, count),                    \
        {.key = "largest",                                                                         \
         .kind = FIELD_OBJECT,                                                                     \
         .offset = offsetof(struct ischia_cluster_set, largest),                                   \
         .fields = cluster_fields,                                                                 \
         .present = has_largest,                                                                   \
         .set_present = set_has_largest},                                                          \
        END

static const struct field shear_fields[] = {THRESHOLD(ISCHIA_E_SHEAR_THRESHOLD),
                                            CLUSTER_SET_FIELDS};
static const struct field compression_fields[] = {THRESHOLD(ISCHIA_E_COMP_THRESHOLD),
                                                  CLUSTER_SET_FIELDS};
static const struct field both_fields[] = {CLUSTER_SET_FIELDS};

#define CLUSTER_SET(name, criterion, table)                                                        \
    {                                                                                              \
        .key = (name), .kind = FIELD_OBJECT,                                                       \
        .offset = offsetof(struct view, result.clusters) +                                         \
                  (criterion) * sizeof(struct ischia_cluster_set),                                 \
        .fields = (table)                                                                          \
    }
static const struct field clusters_fields[] = {
    CLUSTER_SET("shear", ISCHIA_OVER_SHEAR, shear_fields),
    CLUSTER_SET("compression", ISCHIA_OVER_COMPRESSION, compression_fields),
    CLUSTER_SET("both", ISCHIA_OVER_BOTH, both_fields),
    END,
};

/* ---- seat and load path ---- */

static const struct field seat_fields[] = {
    NUMBER(ischia_seat, displacement_mm),
    NUMBER(ischia_seat, contact_area_mm2),
    NUMBER(ischia_seat, mean_pressure_kPa),
    NUMBER(ischia_seat, peak_pressure_kPa),
    END,
};

static const struct field load_point_fields[] = {
    NUMBER(ischia_load_point, F_N),        NUMBER(ischia_load_point, displacement_mm),
    NUMBER(ischia_load_point, eps_max),    NUMBER(ischia_load_point, E_shear_max),
    NUMBER(ischia_load_point, E_comp_max), END,
};

static const struct field threshold_force_fields[] = {
    {.key = "shear",
     .kind = FIELD_NUMBER_OR_NULL,
     .offset = offsetof(struct view, result.threshold_force_shear_N)},
    {.key = "compression",
     .kind = FIELD_NUMBER_OR_NULL,
     .offset = offsetof(struct view, result.threshold_force_compression_N)},
    END,
};

/* ---- risk: derived, never read ---- */

static void write_risk(struct json_out *out, const char *key, const void *base)
{
    const struct view *view = base;
    struct risk risk;
    if (!ischia_result_converged(&view->result)) {
        json_put_null(out, key);
        return;
    }
    risk_assess(&risk, &view->c, &view->result, LANGUAGE_EN);
    json_open_object(out, key);
    json_put_string(out, "band", risk_bands[risk.band].name);
    json_put_string(out, "headline", risk_headline(risk.band));
    json_open_array(out, "reasons");
    for (int i = 0; i < risk.reason_count; i++) json_put_string(out, NULL, risk.reason[i]);
    json_close_array(out);
    json_open_array(out, "caveats");
    for (size_t i = 0; i < RISK_CAVEAT_COUNT; i++) json_put_string(out, NULL, risk_caveat(i));
    json_close_array(out);
    json_close_object(out);
}

/* ---- numerics ---- */

static void write_converged(struct json_out *out, const char *key, const void *base)
{
    json_put_bool(out, key, ((const struct ischia_numerics *)base)->reason > 0);
}

static void write_reason(struct json_out *out, const char *key, const void *base)
{
    json_put_string(out, key, ischia_reason_name(((const struct ischia_numerics *)base)->reason));
}

static bool read_reason(const struct json *value, void *base)
{
    if (json_type_of(value) != JSON_STRING) return false;
    for (int reason = ISCHIA_CONVERGED; reason >= ISCHIA_DIVERGED_CHECKS; reason--) {
        if (strcmp(json_string(value), ischia_reason_name((enum ischia_reason)reason)) != 0)
            continue;
        ((struct ischia_numerics *)base)->reason = (enum ischia_reason)reason;
        return true;
    }
    return false;
}

static const struct field numerics_fields[] = {
    {.key = "converged", .kind = FIELD_CUSTOM, .custom_write = write_converged},
    {.key = "reason",
     .kind = FIELD_CUSTOM,
     .custom_write = write_reason,
     .custom_read = read_reason},
    INTEGER(ischia_numerics, elements),
    INTEGER(ischia_numerics, dof),
    INTEGER(ischia_numerics, load_steps),
    INTEGER(ischia_numerics, newton_iterations),
    INTEGER(ischia_numerics, factorisations),
    NUMBER_OR_NULL(ischia_numerics, force_residual),
    NUMBER_OR_NULL(ischia_numerics, energy_residual),
    NUMBER_OR_NULL(ischia_numerics, det_F_min),
    NUMBER_OR_NULL(ischia_numerics, eps_max_error),
    NUMBER(ischia_numerics, last_converged_F_N),
    NUMBER(ischia_numerics, wall_s),
    NUMBER(ischia_numerics, cpu_s),
    {.key = "detail",
     .kind = FIELD_TEXT_OR_NULL,
     .offset = offsetof(struct ischia_numerics, detail),
     .size = sizeof((struct ischia_numerics *)0)->detail},
    END,
};

/* ---- the whole ---- */

static const struct field model_fields[] = {
    {.key = "name",
     .kind = FIELD_TEXT,
     .offset = offsetof(struct result_model, name),
     .size = sizeof((struct result_model *)0)->name},
    INTEGER(result_model, version),
    END,
};

static bool converged(const void *base)
{
    return ischia_result_converged(&((const struct view *)base)->result);
}

static const struct field result_fields[] = {
    {.key = "strain",
     .kind = FIELD_OBJECT,
     .offset = offsetof(struct view, result.strain),
     .fields = strain_fields,
     .present = converged},
    {.key = "clusters", .kind = FIELD_OBJECT, .fields = clusters_fields, .present = converged},
    {.key = "muscle_volume_mm3",
     .kind = FIELD_NUMBER,
     .offset = offsetof(struct view, result.muscle_volume_mm3)},
    {.key = "seat",
     .kind = FIELD_OBJECT,
     .offset = offsetof(struct view, result.seat),
     .fields = seat_fields,
     .present = converged},
    {.key = "load_curve",
     .kind = FIELD_LIST,
     .offset = offsetof(struct view, result.load_curve),
     .size = sizeof(struct ischia_load_point),
     .count = ISCHIA_LOAD_POINTS_MAX,
     .length_offset = offsetof(struct view, result.load_curve_count),
     .fields = load_point_fields},
    {.key = "threshold_force_N",
     .kind = FIELD_OBJECT,
     .fields = threshold_force_fields,
     .present = converged},
    {.key = "risk", .kind = FIELD_CUSTOM, .custom_write = write_risk},
    {.key = "numerics",
     .kind = FIELD_OBJECT,
     .offset = offsetof(struct view, result.numerics),
     .fields = numerics_fields},
    {.key = "model",
     .kind = FIELD_OBJECT,
     .offset = offsetof(struct view, model),
     .fields = model_fields},
    END,
};

/* A converged result shows every number; ischia_result_is_valid does not look at these. */
static bool is_presentable(const struct ischia_result *r)
{
    const struct ischia_numerics *n = &r->numerics;
    if (!ischia_result_converged(r)) return true;
    return ischia_result_is_valid(r) && isfinite(n->force_residual) &&
           isfinite(n->energy_residual) && isfinite(n->det_F_min) && isfinite(n->eps_max_error);
}

void result_doc_write(struct json_out *out, const struct ischia_case *c,
                      const struct ischia_result *result)
{
    struct view view = {.result = *result,
                        .c = *c,
                        .model = {.name = ISCHIA_MODEL_NAME, .version = ISCHIA_MODEL_VERSION}};
    fields_write(out, result_fields, &view);
}

enum ischia_code
result_doc_text(char **ret_text, const struct ischia_case *c, const struct ischia_result *result,
                const struct ischia_uncertainty *uncertainty, int indent, struct ischia_error *err)
{
    struct json_out out;
    CHECK(is_presentable(result), err, ISCHIA_E_NUMERIC,
          "the solver's result has a number outside its physical range");
    json_out_init(&out, indent);
    json_open_object(&out, NULL);
    result_doc_write(&out, c, result);
    if (uncertainty != NULL) uncertainty_doc_put(&out, uncertainty);
    json_close_object(&out);
    return json_out_take(&out, ret_text, NULL, err);
}

/* null stands for "did not converge", so a converged result may not have it. */
static void refuse_nulls(const struct json *root, struct doc_faults *faults)
{
    for (const struct field *f = result_fields; f->key != NULL; f++) {
        const struct json *value = json_member(root, f->key);
        if (f->present != NULL && value != NULL && json_type_of(value) == JSON_NULL)
            doc_faults_add(faults, f->key, "wrong_type", "%s is null in a converged result",
                           f->key);
    }
}

static enum ischia_code read_view(struct view *view, const struct json *root,
                                  struct doc_faults *faults, struct ischia_error *err)
{
    CHECK(json_type_of(root) == JSON_OBJECT, err, ISCHIA_E_INPUT,
          "not a result: the document is %s", json_type_names[json_type_of(root)]);
    fields_read(root, result_fields, view, "", faults);
    if (ischia_result_converged(&view->result)) refuse_nulls(root, faults);
    CHECK(faults->count == 0, err, ISCHIA_E_INPUT, "not a result: %s: %s", faults->item[0].pointer,
          faults->item[0].detail);
    CHECK(is_presentable(&view->result), err, ISCHIA_E_INPUT,
          "not a result: a number is outside its physical range");
    return ISCHIA_OK;
}

enum ischia_code result_doc_read(struct ischia_result *ret, struct result_model *ret_model,
                                 const char *json, size_t length, const struct json_limits *limits,
                                 struct ischia_error *err)
{
    struct view view = {.result = {.load_curve_count = 0}};
    struct doc_faults faults;
    struct json *root;
    doc_faults_init(&faults);
    TRY(json_parse(&root, json, length, limits, &faults, err));
    const enum ischia_code code = read_view(&view, root, &faults, err);
    json_destroy(root);
    TRY(code);
    *ret = view.result;
    if (ret_model != NULL) *ret_model = view.model;
    return ISCHIA_OK;
}
