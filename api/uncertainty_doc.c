/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/uncertainty_doc.h"

#include <math.h>
#include <string.h>

#include "api/fields.h"

/* What the tables below describe. */
struct view {
    struct ischia_uncertainty u;
};

#define OF(member) offsetof(struct view, u.member)

/* ---- one number for each input ---- */

static void put_by_input(struct json_out *out, const char *key, const double *value)
{
    json_open_object(out, key);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        json_put_number_or_null(out, ischia_params[i].key, value[i]);
    json_close_object(out);
}

static bool read_by_input(const struct json *object, double *ret)
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct json *value = json_member(object, ischia_params[i].key);
        if (value == NULL) return false;
        if (json_type_of(value) != JSON_NUMBER && json_type_of(value) != JSON_NULL) return false;
        ret[i] = json_type_of(value) == JSON_NULL ? (double)NAN : json_number(value);
    }
    return true;
}

#define BY_INPUT(name, member)                                                                     \
    static void put_##name(struct json_out *out, const char *key, const void *base)                \
    {                                                                                              \
        put_by_input(out, key, ((const struct view *)base)->u.member);                             \
    }                                                                                              \
    static bool read_##name(const struct json *value, void *base)                                  \
    {                                                                                              \
        return read_by_input(value, ((struct view *)base)->u.member);                              \
    }
BY_INPUT(sd, sd)
BY_INPUT(outside, outside)
BY_INPUT(first_order, first_order)
BY_INPUT(total, total)

#define INPUTS(name_, key_)                                                                        \
    {                                                                                              \
        .key = (key_), .kind = FIELD_CUSTOM, .custom_write = put_##name_,                          \
        .custom_read = read_##name_                                                                \
    }

/* ---- quantiles ---- */

static const struct place {
    const char *group, *part, *key;
} places[UNCERTAIN_COUNT] = {
    [UNCERTAIN_EPS_MAX] = {"strain", NULL, "eps_max"},
    [UNCERTAIN_E_SHEAR] = {"strain", NULL, "E_shear_max"},
    [UNCERTAIN_E_COMP] = {"strain", NULL, "E_comp_max"},
    [UNCERTAIN_VOLUME_SHEAR] = {"clusters", "shear", "volume_mm3"},
    [UNCERTAIN_VOLUME_COMPRESSION] = {"clusters", "compression", "volume_mm3"},
    [UNCERTAIN_VOLUME_BOTH] = {"clusters", "both", "volume_mm3"},
    [UNCERTAIN_FORCE_SHEAR] = {"threshold_force_N", NULL, "shear"},
    [UNCERTAIN_FORCE_COMPRESSION] = {"threshold_force_N", NULL, "compression"},
};

static void put_quantiles(struct json_out *out, const char *key, const void *base)
{
    const struct view *view = base;
    for (int q = 0; q < UNCERTAIN_COUNT; q++) {
        if (strcmp(places[q].group, key) != 0) continue;
        if (places[q].part != NULL) json_open_object(out, places[q].part);
        json_open_array(out, places[q].key);
        for (int k = 0; k < UNCERTAINTY_QUANTILES; k++)
            json_put_number_or_null(out, NULL, view->u.quantile[q][k]);
        json_close_array(out);
        if (places[q].part != NULL) json_close_object(out);
    }
}

static void put_group(struct json_out *out, const char *key, const void *base)
{
    json_open_object(out, key);
    put_quantiles(out, key, base);
    json_close_object(out);
}

static bool read_five(const struct json *list, double *ret)
{
    if (list == NULL || json_count(list) != UNCERTAINTY_QUANTILES) return false;
    for (const struct json *m = json_first(list); m != NULL; m = json_next(m)) {
        if (json_type_of(m) != JSON_NUMBER && json_type_of(m) != JSON_NULL) return false;
        *ret++ = json_type_of(m) == JSON_NULL ? (double)NAN : json_number(m);
    }
    return true;
}

static bool read_group(const char *group, const struct json *object, struct view *view)
{
    for (int q = 0; q < UNCERTAIN_COUNT; q++) {
        const struct place *p = &places[q];
        if (strcmp(p->group, group) != 0) continue;
        const struct json *parent = p->part == NULL ? object : json_member(object, p->part);
        if (!read_five(json_member(parent, p->key), view->u.quantile[q])) return false;
    }
    return true;
}

static bool read_strain(const struct json *value, void *base)
{
    return read_group("strain", value, base);
}
static bool read_clusters(const struct json *value, void *base)
{
    return read_group("clusters", value, base);
}
static bool read_forces(const struct json *value, void *base)
{
    return read_group("threshold_force_N", value, base);
}

static void put_probabilities(struct json_out *out, const char *key, const void *base)
{
    (void)base;
    json_open_array(out, key);
    for (int k = 0; k < UNCERTAINTY_QUANTILES; k++)
        json_put_number(out, NULL, uncertainty_probabilities[k]);
    json_close_array(out);
}

/* ---- the rest ---- */

static const struct field share_fields[] = {
    {.key = "shear", .kind = FIELD_NUMBER_OR_NULL, .offset = OF(share_shear)},
    {.key = "compression", .kind = FIELD_NUMBER_OR_NULL, .offset = OF(share_compression)},
    {.key = "both", .kind = FIELD_NUMBER_OR_NULL, .offset = OF(share_both)},
    {.key = NULL},
};

static const struct field sensitivity_fields[] = {
    INPUTS(first_order, "first_order"),
    INPUTS(total, "total"),
    {.key = NULL},
};

static const struct field model_form_fields[] = {
    {.key = "eps_max", .kind = FIELD_CONSTANT, .constant = ISCHIA_MODEL_FORM_EPS_MAX},
    {.key = NULL},
};

static void put_parameters(struct json_out *out, const char *key, const void *base)
{
    put_by_input(out, key, ((const struct uncertainty_check *)base)->param);
}
static bool read_parameters(const struct json *value, void *base)
{
    return read_by_input(value, ((struct uncertainty_check *)base)->param);
}

#define OF_CHECK(name_, kind_)                                                                     \
    {                                                                                              \
        .key = #name_, .kind = (kind_), .offset = offsetof(struct uncertainty_check, name_)        \
    }
static const struct field check_fields[] = {
    {.key = "parameters",
     .kind = FIELD_CUSTOM,
     .custom_write = put_parameters,
     .custom_read = read_parameters},
    OF_CHECK(eps_max, FIELD_NUMBER_OR_NULL),
    OF_CHECK(estimate, FIELD_NUMBER),
    OF_CHECK(low, FIELD_NUMBER),
    OF_CHECK(high, FIELD_NUMBER),
    {.key = NULL},
};

static const struct field fields[] = {
    {.key = "status",
     .kind = FIELD_WORD,
     .offset = OF(status),
     .words = uncertainty_status_names,
     .count = UNCERTAINTY_STATUS_COUNT},
    {.key = "typical", .kind = FIELD_BOOL, .offset = OF(typical)},
    INPUTS(sd, "sd"),
    {.key = "trial", .kind = FIELD_BOOL, .offset = OF(trial)},
    {.key = "samples", .kind = FIELD_INTEGER, .offset = OF(samples)},
    {.key = "inside", .kind = FIELD_INTEGER, .offset = OF(inside)},
    INPUTS(outside, "outside"),
    {.key = "quantiles", .kind = FIELD_CUSTOM, .custom_write = put_probabilities},
    {.key = "strain", .kind = FIELD_CUSTOM, .custom_write = put_group, .custom_read = read_strain},
    {.key = "clusters",
     .kind = FIELD_CUSTOM,
     .custom_write = put_group,
     .custom_read = read_clusters},
    {.key = "threshold_force_N",
     .kind = FIELD_CUSTOM,
     .custom_write = put_group,
     .custom_read = read_forces},
    {.key = "share_crossing", .kind = FIELD_OBJECT, .fields = share_fields},
    {.key = "sensitivity", .kind = FIELD_OBJECT, .fields = sensitivity_fields},
    {.key = "emulator_sd", .kind = FIELD_NUMBER_OR_NULL, .offset = OF(emulator_sd)},
    {.key = "model_form_error", .kind = FIELD_OBJECT, .fields = model_form_fields},
    {.key = "checks",
     .kind = FIELD_LIST,
     .offset = OF(check),
     .size = sizeof(struct uncertainty_check),
     .count = UNCERTAINTY_CHECKS,
     .length_offset = OF(check_count),
     .fields = check_fields},
    {.key = NULL},
};

void uncertainty_doc_put(struct json_out *out, const struct ischia_uncertainty *u)
{
    const struct view view = {*u};
    json_open_object(out, "uncertainty");
    fields_write(out, fields, &view);
    json_close_object(out);
}

static enum ischia_code read_view(struct view *view, const struct json *object,
                                  struct ischia_error *err)
{
    struct doc_faults faults;
    doc_faults_init(&faults);
    fields_read(object, fields, view, "/uncertainty", &faults);
    CHECK(faults.count == 0, err, ISCHIA_E_INPUT, "not an uncertainty: %s: %s",
          faults.item[0].pointer, faults.item[0].detail);
    CHECK(uncertainty_is_valid(&view->u), err, ISCHIA_E_INPUT,
          "not an uncertainty: a number is out of bounds");
    return ISCHIA_OK;
}

enum ischia_code uncertainty_doc_read(struct ischia_uncertainty *ret, bool *ret_present,
                                      const char *result_json, size_t length,
                                      struct ischia_error *err)
{
    struct view view = {.u = {.check_count = 0}};
    struct doc_faults faults;
    struct json *root;
    doc_faults_init(&faults);
    TRY(json_parse(&root, result_json, length, &json_limits_stored, &faults, err));
    const struct json *object = json_member(root, "uncertainty");
    const bool present = object != NULL;
    const enum ischia_code code = present ? read_view(&view, object, err) : ISCHIA_OK;
    json_destroy(root);
    TRY(code);
    *ret = view.u;
    *ret_present = present;
    return ISCHIA_OK;
}

int uncertainty_order(const struct ischia_uncertainty *u,
                      enum ischia_param ret_order[ISCHIA_PARAM_COUNT])
{
    int worth = 0;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        int k = i;
        for (; k > 0 && u->total[ret_order[k - 1]] < u->total[i]; k--)
            ret_order[k] = ret_order[k - 1];
        ret_order[k] = (enum ischia_param)i;
        worth += u->total[i] >= 0.05;
    }
    return worth;
}
