/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/study_plan.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/csv.h"
#include "api/json.h"

static const struct json_limits plan_limits = {STUDY_PLAN_BYTES_MAX, 16, 4096};

/* ---- small readers: each adds a fault and keeps the old value when the member is wrong ---- */

struct reader {
    const struct json *object;
    const char *pointer;
    struct doc_faults *faults;
};

static const struct json *member_of_type(const struct reader *in, const char *key,
                                         enum json_type type)
{
    char pointer[64];
    const struct json *value = json_member(in->object, key);
    if (value == NULL || json_type_of(value) == type) return value;
    doc_faults_add(in->faults, doc_pointer(pointer, sizeof pointer, in->pointer, key), "wrong_type",
                   "%s is %s; expected %s", key, json_type_names[json_type_of(value)],
                   json_type_names[type]);
    return NULL;
}

static void read_number(const struct reader *in, const char *key, double min, double max,
                        bool whole, double *ret)
{
    char pointer[64];
    const struct json *value = member_of_type(in, key, JSON_NUMBER);
    if (value == NULL) return;
    const double number = json_number(value);
    if (number >= min && number <= max && (!whole || floor(number) == number)) {
        *ret = number;
        return;
    }
    doc_faults_add(in->faults, doc_pointer(pointer, sizeof pointer, in->pointer, key),
                   "out_of_range", "%s is %.*g; accepted %s%g to %g", key, text_digits(number),
                   number, whole ? "whole numbers " : "", min, max);
}

static void refuse_unknown(const struct reader *in, const char *const *known)
{
    char pointer[64];
    for (const struct json *m = json_first(in->object); m != NULL; m = json_next(m)) {
        const char *const *k = known;
        while (*k != NULL && strcmp(*k, json_key(m)) != 0) k++;
        if (*k != NULL) continue;
        doc_faults_add(in->faults, doc_pointer(pointer, sizeof pointer, in->pointer, json_key(m)),
                       "unknown", "%s is not a key here", json_key(m));
    }
}

/* ---- factors ---- */

static void read_levels(const struct reader *in, struct design_factor *factor)
{
    const struct json *levels = member_of_type(in, "levels", JSON_ARRAY);
    const bool has_ends = json_member(in->object, "min") || json_member(in->object, "max");
    double min = (double)NAN, max = (double)NAN;
    if (levels != NULL && has_ends) return; /* which of them is meant? */
    if (levels == NULL) {
        read_number(in, "min", -1e9, 1e9, false, &min);
        read_number(in, "max", -1e9, 1e9, false, &max);
        factor->level[0] = min;
        factor->level[1] = max;
        factor->level_count = isnan(min) || isnan(max) ? 0 : 2;
        return;
    }
    for (const struct json *m = json_first(levels); m != NULL; m = json_next(m)) {
        const bool fits = factor->level_count < DESIGN_LEVELS_MAX;
        if (!fits || json_type_of(m) != JSON_NUMBER) {
            factor->level_count = 0;
            return;
        }
        factor->level[factor->level_count++] = json_number(m);
    }
}

/* "log": by ratio between the levels; "linear" (the usual): by difference. */
static void read_scale(const struct reader *in, struct design_factor *factor)
{
    const struct json *value = member_of_type(in, "scale", JSON_STRING);
    if (value == NULL || strcmp(json_string(value), "linear") == 0) return;
    factor->log = strcmp(json_string(value), "log") == 0;
    if (!factor->log || (factor->level_count > 0 && !(factor->level[0] > 0)))
        doc_faults_add(in->faults, in->pointer, "not_allowed",
                       "scale is linear, or log where every level is above 0");
}

static bool levels_rise(const struct design_factor *factor)
{
    for (int i = 1; i < factor->level_count; i++)
        if (!(factor->level[i] > factor->level[i - 1])) return false;
    return factor->level_count >= 2;
}

static bool named_before(const struct design *d, const struct design_factor *factor)
{
    for (int i = 0; i < d->factor_count; i++)
        if (d->factor[i].is_option == factor->is_option && d->factor[i].index == factor->index)
            return true;
    return false;
}

static void read_factor(const struct reader *in, struct design *d)
{
    static const char *const known[] = {"key", "levels", "min", "max", "scale", NULL};
    struct design_factor factor = {0};
    if (json_type_of(in->object) != JSON_OBJECT) { /* its members would have no keys */
        doc_faults_add(in->faults, in->pointer, "wrong_type",
                       "a factor is an object with \"key\" and \"levels\"");
        return;
    }
    const struct json *key = member_of_type(in, "key", JSON_STRING);
    const char *name = key != NULL ? json_string(key) : "";
    refuse_unknown(in, known);
    if (!design_factor_find(name, &factor)) {
        doc_faults_add(in->faults, in->pointer, "unknown",
                       "\"%s\" is neither an input (\"R1\") nor an option (\"model.bulk_ratio\")",
                       name);
        return;
    }
    read_levels(in, &factor);
    read_scale(in, &factor);
    if (!levels_rise(&factor)) {
        doc_faults_add(in->faults, in->pointer, "malformed",
                       "%s needs \"levels\": 2 to %d rising numbers, or \"min\" < \"max\"", name,
                       (int)DESIGN_LEVELS_MAX);
    } else if (named_before(d, &factor)) {
        doc_faults_add(in->faults, in->pointer, "duplicate", "%s is a factor already", name);
    } else {
        d->factor[d->factor_count++] = factor;
    }
}

static void read_factors(const struct reader *in, struct design *d)
{
    const struct json *list = member_of_type(in, "factors", JSON_ARRAY);
    int i = 0;
    if (list == NULL || json_count(list) == 0) {
        doc_faults_add(in->faults, "/factors", "missing", "a study needs at least one factor");
        return;
    }
    for (const struct json *m = json_first(list); m != NULL; m = json_next(m), i++) {
        char pointer[32];
        (void)snprintf(pointer, sizeof pointer, "/factors/%d", i);
        read_factor(&(struct reader){m, pointer, in->faults}, d);
    }
}

/* ---- the rule ---- */

/* One number for each of the file's factors. */
static bool read_generator(const struct json *list, size_t factors, int *ret)
{
    int f = 0;
    if (json_type_of(list) != JSON_ARRAY || json_count(list) != factors ||
        factors > DESIGN_FACTORS_MAX)
        return false;
    for (const struct json *m = json_first(list); m != NULL; m = json_next(m)) {
        if (json_type_of(m) != JSON_NUMBER) return false;
        const double number = json_number(m);
        if (!(fabs(number) < 100) || floor(number) != number) return false;
        ret[f++] = (int)number;
    }
    return true;
}

static void read_fraction(const struct reader *rule, size_t factors, struct design *d)
{
    static const char *const known[] = {"modulus", "generators", NULL};
    const struct json *object = member_of_type(rule, "fraction", JSON_OBJECT);
    if (object == NULL) return;
    const struct reader in = {object, "/design/fraction", rule->faults};
    const struct json *list = member_of_type(&in, "generators", JSON_ARRAY);
    double modulus = 0;
    refuse_unknown(&in, known);
    read_number(&in, "modulus", 2, DESIGN_LEVELS_MAX, true, &modulus);
    d->modulus = (int)modulus;
    bool good = modulus >= 2 && list != NULL && json_count(list) <= DESIGN_GENERATORS_MAX;
    const struct json *m = good ? json_first(list) : NULL;
    for (; m != NULL && good; m = json_next(m))
        good = read_generator(m, factors, d->generator[d->generator_count++]);
    if (!good)
        doc_faults_add(in.faults, in.pointer, "malformed",
                       "a fraction needs \"modulus\" and at most %d \"generators\", each a list of "
                       "whole numbers, one a factor",
                       (int)DESIGN_GENERATORS_MAX);
}

enum { ANY_FRACTION = 1 << DESIGN_FULL | 1 << DESIGN_CENTRAL_COMPOSITE };
enum { ANY_SEQUENCE = 1 << DESIGN_SOBOL | 1 << DESIGN_HALTON };

/* The members of a rule, and the kinds of design that heed them, as bits. */
static const struct {
    const char *key;
    unsigned kinds;
} rule_members[] = {
    {"fraction", ANY_FRACTION},
    {"axial", 1 << DESIGN_CENTRAL_COMPOSITE},
    {"points", ANY_SEQUENCE},
    {"skip", ANY_SEQUENCE},
    {"seed", ANY_SEQUENCE | 1 << DESIGN_MORRIS},
    {"paths", 1 << DESIGN_MORRIS},
    {"levels", 1 << DESIGN_MORRIS},
};

/* A member that another kind heeds says that the file means something else than it gets. */
static void refuse_unheeded(const struct reader *in, enum design_kind kind)
{
    char pointer[64];
    for (size_t k = 0; k < sizeof rule_members / sizeof rule_members[0]; k++) {
        const char *key = rule_members[k].key;
        if (rule_members[k].kinds >> kind & 1 || json_member(in->object, key) == NULL) continue;
        doc_faults_add(in->faults, doc_pointer(pointer, sizeof pointer, in->pointer, key),
                       "not_allowed", "a design of kind %s has no %s", design_kind_names[kind],
                       key);
    }
}

static void read_kind(const struct reader *in, struct design *d)
{
    const struct json *value = member_of_type(in, "kind", JSON_STRING);
    for (int k = 0; value != NULL && k < DESIGN_KIND_COUNT; k++) {
        if (strcmp(json_string(value), design_kind_names[k]) != 0) continue;
        d->kind = (enum design_kind)k;
        refuse_unheeded(in, d->kind);
        return;
    }
    doc_faults_add(in->faults, "/design/kind", value == NULL ? "missing" : "not_allowed",
                   "kind is one of full, central_composite, sobol, halton, morris");
}

static size_t factors_of(const struct reader *plan)
{
    const struct json *list = json_member(plan->object, "factors");
    return list != NULL && json_type_of(list) == JSON_ARRAY ? json_count(list) : 0;
}

static void read_rule(const struct reader *plan, struct design *d)
{
    static const char *const known[] = {"kind", "fraction", "axial",  "points", "skip",
                                        "seed", "paths",    "levels", NULL};
    const struct json *object = member_of_type(plan, "design", JSON_OBJECT);
    const struct reader in = {object, "/design", plan->faults};
    double axial = 1, points = 0, skip = 0, seed = 0, paths = 0, levels = 4;
    if (object == NULL) {
        doc_faults_add(plan->faults, "/design", "missing", "a study needs \"design\"");
        return;
    }
    refuse_unknown(&in, known);
    read_kind(&in, d);
    read_fraction(&in, factors_of(plan), d);
    read_number(&in, "axial", 0.01, 10, false, &axial);
    read_number(&in, "points", 1, DESIGN_ROWS_MAX, true, &points);
    read_number(&in, "skip", 0, DESIGN_ROWS_MAX, true, &skip);
    read_number(&in, "seed", 0, 0x1p53, true, &seed);
    read_number(&in, "paths", 1, DESIGN_ROWS_MAX, true, &paths);
    read_number(&in, "levels", 2, DESIGN_LEVELS_MAX, true, &levels);
    d->axial = axial;
    d->points = (uint32_t)points;
    d->skip = (uint32_t)skip;
    d->seed = (uint64_t)seed;
    d->paths = (uint32_t)paths;
    d->path_levels = (int)levels;
}

/* ---- what is not a factor ---- */

static bool is_factor(const struct design *d, const char *pointer)
{
    for (int f = 0; f < d->factor_count; f++)
        if (!d->factor[f].is_option &&
            strcmp(pointer + 1, ischia_params[d->factor[f].index].key) == 0)
            return true;
    return false;
}

/* The faults of "case", but for what the factors give. */
static void add_case_faults(struct doc_faults *faults, const struct doc_faults *found,
                            const struct design *d)
{
    for (size_t i = 0; i < found->count; i++) {
        const struct ischia_fault *fault = &found->item[i];
        char pointer[64];
        (void)snprintf(pointer, sizeof pointer, "/case%s", fault->pointer);
        if (strcmp(fault->code, "missing") != 0)
            doc_faults_add(faults, pointer, fault->code, "%s", fault->detail);
        else if (!is_factor(d, fault->pointer))
            doc_faults_add(faults, pointer, "missing",
                           "%s is not a factor, so \"case\" must give it", fault->pointer + 1);
    }
}

static void read_base(const struct reader *in, const struct case_doc_defaults *defaults,
                      struct study_plan *plan)
{
    struct ischia_request request;
    struct doc_faults found;
    const struct json *object = member_of_type(in, "case", JSON_OBJECT);
    doc_faults_init(&found);
    case_doc_read_value_over(&request, defaults, object, &found);
    plan->design.base = request.values;
    memcpy(plan->preset, request.preset, sizeof plan->preset);
    add_case_faults(in->faults, &found, &plan->design);
}

static bool is_response(const struct study_plan *plan, int response)
{
    for (int i = 0; i < plan->response_count; i++)
        if (plan->response[i] == response) return true;
    return false;
}

static void read_responses(const struct reader *in, struct study_plan *plan)
{
    const struct json *list = member_of_type(in, "responses", JSON_ARRAY);
    if (list == NULL) {
        for (int i = 0; i < study_response_count; i++) plan->response[i] = i;
        plan->response_count = study_response_count;
        return;
    }
    for (const struct json *m = json_first(list); m != NULL; m = json_next(m)) {
        const char *name = json_type_of(m) == JSON_STRING ? json_string(m) : "";
        const int found = study_response_find(name);
        if (found < 0) {
            doc_faults_add(in->faults, "/responses", "unknown", "\"%s\" is not a response", name);
        } else if (is_response(plan, found)) {
            doc_faults_add(in->faults, "/responses", "duplicate", "%s is a response already", name);
        } else {
            plan->response[plan->response_count++] = found;
        }
    }
}

static void read_plan(const struct json *root, const struct case_doc_defaults *defaults,
                      struct study_plan *plan, struct doc_faults *faults)
{
    static const char *const known[] = {"name", "description", "design", "factors",
                                        "case", "responses",   NULL};
    const struct reader in = {root, "", faults};
    if (json_type_of(root) != JSON_OBJECT) {
        doc_faults_add(faults, "", "wrong_type", "a design file is an object");
        return;
    }
    refuse_unknown(&in, known);
    const struct json *name = member_of_type(&in, "name", JSON_STRING);
    (void)member_of_type(&in, "description", JSON_STRING);
    if (name == NULL || !text_is_pseudonym(json_string(name))) {
        doc_faults_add(faults, "/name", "malformed", "name is 1 to 64 of letters, digits and ._-");
    } else {
        (void)snprintf(plan->name, sizeof plan->name, "%s", json_string(name));
    }
    read_factors(&in, &plan->design);
    read_rule(&in, &plan->design);
    read_base(&in, defaults, plan);
    read_responses(&in, plan);
    if (faults->count == 0 && !design_is_valid(&plan->design))
        doc_faults_add(
            faults, "/design", "missing", "%s needs %s", design_kind_names[plan->design.kind],
            plan->design.kind == DESIGN_MORRIS ? "\"paths\" and an even \"levels\"" : "\"points\"");
}

static enum ischia_code make_points(struct study_plan *plan, size_t rows_max,
                                    struct doc_faults *faults, struct ischia_error *err)
{
    struct ischia_error why = {0};
    const enum ischia_code code = design_points_init(&plan->points, &plan->design, rows_max, &why);
    if (code == ISCHIA_OK) return ISCHIA_OK;
    if (code != ISCHIA_E_LIMIT) return FAIL(err, code, "%s", why.message);
    doc_faults_add(faults, "/design", "out_of_range", "%s", why.message);
    return ISCHIA_OK;
}

enum ischia_code study_plan_read(struct study_plan *ret, const char *json, size_t length,
                                 const struct case_doc_defaults *defaults, size_t rows_max,
                                 struct doc_faults *faults, struct ischia_error *err)
{
    struct study_plan plan = {.design = {.base = ischia_case_default()}};
    struct json *root;
    TRY(json_parse(&root, json, length, &plan_limits, faults, err));
    read_plan(root, defaults, &plan, faults);
    json_destroy(root);
    if (faults->count == 0) TRY(make_points(&plan, rows_max, faults, err));
    if (faults->count == 0) *ret = plan;
    return ISCHIA_OK;
}

void study_plan_finish(struct study_plan *plan) { design_points_finish(&plan->points); }

/* ---- rows as text ---- */

static const char *option_column(const struct design *d, int f, char buffer[DESIGN_NAME_BYTES])
{
    return d->factor[f].is_option ? design_factor_name(&d->factor[f], buffer) : NULL;
}

void study_plan_put_header(struct text_out *out, const struct study_plan *plan)
{
    char buffer[DESIGN_NAME_BYTES];
    csv_put_text(out, "row", true);
    for (int p = 0; p < ISCHIA_PARAM_COUNT; p++) csv_put_text(out, ischia_params[p].key, false);
    for (int f = 0; f < plan->design.factor_count; f++) {
        const char *name = option_column(&plan->design, f, buffer);
        if (name != NULL) csv_put_text(out, name, false);
    }
    csv_put_text(out, "status", false);
    csv_put_text(out, "reason", false);
    for (int r = 0; r < plan->response_count; r++)
        csv_put_text(out, study_responses[plan->response[r]].name, false);
    csv_end_row(out);
}

void study_plan_put_inputs(struct text_out *out, const struct study_plan *plan, size_t row)
{
    const struct ischia_case c = design_case(&plan->design, &plan->points, row);
    csv_put_integer(out, (long long)row + 1, true);
    for (int p = 0; p < ISCHIA_PARAM_COUNT; p++) csv_put_number(out, c.param[p], false);
    for (int f = 0; f < plan->design.factor_count; f++)
        if (plan->design.factor[f].is_option)
            csv_put_number(out, c.option[plan->design.factor[f].index], false);
    text_put_string(out, ",");
}

/* FNV-1a, 64 bits. */
static uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t length)
{
    const unsigned char *b = bytes;
    for (size_t i = 0; i < length; i++) hash = (hash ^ b[i]) * UINT64_C(0x100000001b3);
    return hash;
}

static uint64_t hash_text(uint64_t hash, const char *text)
{
    return hash_bytes(hash, text, strlen(text) + 1);
}

uint64_t study_plan_fingerprint(const struct study_plan *plan)
{
    const int model_version = ISCHIA_MODEL_VERSION;
    uint64_t hash = hash_text(UINT64_C(0xcbf29ce484222325), ISCHIA_MODEL_NAME " " ISCHIA_VERSION);
    hash = hash_bytes(hash, &model_version, sizeof model_version);
    for (int r = 0; r < plan->response_count; r++)
        hash = hash_text(hash, study_responses[plan->response[r]].name);
    for (size_t row = 0; row < plan->points.count; row++) {
        const struct ischia_case c = design_case(&plan->design, &plan->points, row);
        hash = hash_bytes(hash, c.param, sizeof c.param);
        hash = hash_bytes(hash, c.option, sizeof c.option);
        hash = hash_bytes(hash, &c.resolution, sizeof c.resolution);
    }
    return hash;
}
