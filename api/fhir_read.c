/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * What $assess is given. Everything ends in case_doc_fields_set, as a form's values do, so that
 * limits and faults are those of the one parameter table; what is added here is where in the FHIR
 * resource a fault is.
 */
#include <stdio.h>
#include <string.h>

#include "api/case_places.h"
#include "api/fhir.h"
#include "api/fhir_date.h"
#include "api/measure.h"
#include "api/ucum.h"

struct reader {
    struct fhir_input *input;
    struct case_places places;
    struct doc_faults *faults;    /* of the document: pointers are FHIRPath  */
    enum ischia_side bundle_side; /* of the Observations' bodySite */
    bool has_subject, has_input;
    bool is_bundle; /* the body itself is one */
};

/* ---- values ---- */

static const char *text_of(const struct json *object, const char *key)
{
    const struct json *value = json_member(object, key);
    return value != NULL && json_type_of(value) == JSON_STRING ? json_string(value) : NULL;
}

static bool is_object(const struct json *value)
{
    return value != NULL && json_type_of(value) == JSON_OBJECT;
}

/* A modifier may turn the meaning round, so that what has one cannot be used. */
static bool is_modified(struct reader *r, const struct json *object, const char *where)
{
    if (json_member(object, "modifierExtension") == NULL) return false;
    doc_faults_add(r->faults, where, "unsupported",
                   "a modifierExtension that is not known here may change what this means");
    return true;
}

static bool quantity_is_plain(struct reader *r, const struct json *q, const char *where)
{
    const char *system = text_of(q, "system"), *code = text_of(q, "code");
    const struct json *value = json_member(q, "value");
    if (value == NULL || json_type_of(value) != JSON_NUMBER)
        doc_faults_add(r->faults, where, "wrong_type", "the Quantity has no numeric value");
    else if (json_member(q, "comparator") != NULL)
        doc_faults_add(r->faults, where, "unsupported",
                       "a Quantity with a comparator is a bound, not a measurement");
    else if (system == NULL || strcmp(system, FHIR_UCUM_SYSTEM) != 0 || code == NULL)
        doc_faults_add(r->faults, where, "missing",
                       "units are never assumed: give system " FHIR_UCUM_SYSTEM " and code");
    else
        return true;
    return false;
}

/* The digits of a number in the unit of an input; false with a fault. */
static bool take_quantity(struct reader *r, const struct json *q, const char *key, const char *unit,
                          const char *where, char ret[UCUM_DIGITS_BYTES])
{
    char known[96], shown[24];
    if (!is_object(q)) {
        doc_faults_add(r->faults, where, "wrong_type", "%s is not a Quantity", key);
        return false;
    }
    if (is_modified(r, q, where) || !quantity_is_plain(r, q, where)) return false;
    const char *given = json_digits(json_member(q, "value")), *code = text_of(q, "code");
    if (ucum_convert(given, code, unit, ret) != UCUM_CONVERTED) {
        doc_faults_add(r->faults, where, "unsupported", "%s is in '%s'; accepted %s", key,
                       text_printable(code, shown, sizeof shown),
                       ucum_known(unit, known, sizeof known));
        return false;
    }
    return true;
}

/* An input is given back with the digits that it came with. */
static void keep_digits(struct reader *r, const struct json *q, int param)
{
    const char *given = json_digits(json_member(q, "value"));
    if (strcmp(text_of(q, "code"), ischia_params[param].unit) == 0 &&
        strlen(given) < ORIGIN_DIGITS_BYTES)
        (void)snprintf(r->input->origin.digits[param], ORIGIN_DIGITS_BYTES, "%s", given);
}

/* key: of the input, or of its standard deviation. */
static bool read_quantity(struct reader *r, const struct json *q, int param, const char *key,
                          const char *where)
{
    char digits[UCUM_DIGITS_BYTES];
    const bool taken = take_quantity(r, q, key, ischia_params[param].unit, where, digits);
    if (taken)
        case_places_set(&r->places, key, digits, where);
    else
        case_places_refuse(&r->places, key, where);
    return taken;
}

static void read_input(struct reader *r, const struct json *q, int param, const char *where)
{
    if (read_quantity(r, q, param, ischia_params[param].key, where)) keep_digits(r, q, param);
}

/* ---- the person ---- */

bool fhir_is_local_patient(const char *reference, const char **ret_id)
{
    static const char prefix[] = "Patient/";
    if (strncmp(reference, prefix, sizeof prefix - 1) != 0) return false;
    *ret_id = reference + sizeof prefix - 1;
    const size_t length = strlen(*ret_id);
    return length > 0 && length < FHIR_ID_BYTES &&
           strspn(*ret_id, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-.") ==
               length;
}

/* Visible ASCII without what would end it where it is quoted. */
static bool is_plain_reference(const char *text, size_t size)
{
    const size_t length = strlen(text);
    for (size_t i = 0; i < length; i++)
        if ((unsigned char)text[i] <= 0x20 || (unsigned char)text[i] >= 0x7F ||
            strchr("\"<>\\^`{|}", text[i]) != NULL)
            return false;
    return length > 0 && length < size;
}

static bool is_patient(const char *reference)
{
    const char *id, *last = strstr(reference, "/Patient/");
    return fhir_is_local_patient(reference, &id) || strncmp(reference, "urn:", 4) == 0 ||
           (strstr(reference, "://") != NULL && last != NULL && last[9] != '\0');
}

static void take_text(char ret[ORIGIN_TEXT_BYTES], const char *text)
{
    if (text != NULL) (void)snprintf(ret, ORIGIN_TEXT_BYTES, "%s", text);
}

/* Nothing of the value is repeated in a fault: it may be somebody's name. */
static void read_subject(struct reader *r, const struct json *subject, const char *where)
{
    struct origin given;
    memset(&given, 0, sizeof given);
    const struct json *identifier = json_member(subject, "identifier");
    const char *reference = text_of(subject, "reference"), *type = text_of(subject, "type");
    const char *value = text_of(identifier != NULL ? identifier : subject, "value");
    const char *system = identifier == NULL ? NULL : text_of(identifier, "system");
    const bool has_identifier = is_object(identifier) && value != NULL;
    const bool fits = (reference == NULL || (is_plain_reference(reference, ORIGIN_TEXT_BYTES) &&
                                             is_patient(reference))) &&
                      (!has_identifier || is_plain_reference(value, ORIGIN_TEXT_BYTES)) &&
                      (system == NULL || is_plain_reference(system, ORIGIN_TEXT_BYTES));
    if (!is_object(subject) || (reference == NULL && !has_identifier) || !fits ||
        (type != NULL && strcmp(type, "Patient") != 0)) {
        doc_faults_add(r->faults, where, "malformed",
                       "subject is not a Reference to a Patient, by reference or identifier");
        return;
    }
    take_text(given.reference, reference);
    if (has_identifier) take_text(given.identifier_value, value);
    if (has_identifier) take_text(given.identifier_system, system);
    struct origin *origin = &r->input->origin;
    if (r->has_subject && (strcmp(given.reference, origin->reference) != 0 ||
                           strcmp(given.identifier_value, origin->identifier_value) != 0 ||
                           strcmp(given.identifier_system, origin->identifier_system) != 0))
        doc_faults_add(r->faults, where, "inconsistent",
                       "the subject is not that of the other values: one person a request");
    take_text(origin->reference, given.reference);
    take_text(origin->identifier_value, given.identifier_value);
    take_text(origin->identifier_system, given.identifier_system);
    r->has_subject = true;
}

/* ---- Bundle of Observations ---- */

/* The code of ours among codings; NULL when there is none. */
static const char *our_code(const struct json *concept)
{
    const struct json *codings = json_member(concept, "coding");
    if (codings == NULL || json_type_of(codings) != JSON_ARRAY) return NULL;
    for (const struct json *c = json_first(codings); c != NULL; c = json_next(c)) {
        const char *system = text_of(c, "system"), *code = text_of(c, "code");
        if (system != NULL && code != NULL && strcmp(system, FHIR_MEASURE_SYSTEM) == 0) return code;
    }
    return NULL;
}

/* Laterality as SNOMED CT writes it: as the code itself, or behind a body structure. */
static enum ischia_side side_of(const struct json *site)
{
    static const struct {
        const char *code;
        enum ischia_side side;
    } codes[] = {{"7771000", ISCHIA_SIDE_LEFT}, {"24028007", ISCHIA_SIDE_RIGHT}};
    const struct json *codings = site == NULL ? NULL : json_member(site, "coding");
    if (codings == NULL || json_type_of(codings) != JSON_ARRAY) return ISCHIA_SIDE_NONE;
    for (const struct json *c = json_first(codings); c != NULL; c = json_next(c)) {
        const char *system = text_of(c, "system"), *code = text_of(c, "code");
        if (system == NULL || code == NULL || strcmp(system, FHIR_SNOMED_SYSTEM) != 0) continue;
        const char *lateral = strstr(code, "272741003=");
        const char *value = lateral == NULL ? code : lateral + strlen("272741003=");
        for (size_t i = 0; i < sizeof codes / sizeof codes[0]; i++)
            if (strcmp(value, codes[i].code) == 0) return codes[i].side;
    }
    return ISCHIA_SIDE_NONE;
}

static void take_side(struct reader *r, const struct json *observation, const char *where)
{
    const enum ischia_side side = side_of(json_member(observation, "bodySite"));
    if (side == ISCHIA_SIDE_NONE) return;
    if (r->bundle_side != ISCHIA_SIDE_NONE && r->bundle_side != side)
        doc_faults_add(r->faults, where, "inconsistent",
                       "the bodySite is not that of the other Observations: one side a request");
    r->bundle_side = side;
}

/* The latest of the times; one that is less than a date says nothing here. */
static void take_time(struct reader *r, const struct json *observation)
{
    const char *time = text_of(observation, "effectiveDateTime");
    char *known = r->input->request.measured_at;
    if (time == NULL || strlen(time) >= ISCHIA_MEASURED_AT_BYTES || !text_is_date_or_time(time))
        return;
    if (fhir_date_is_after(time, known))
        (void)snprintf(known, ISCHIA_MEASURED_AT_BYTES, "%s", time);
}

static bool has_a_value(struct reader *r, const struct json *observation, const char *where)
{
    static const char *const good[] = {"final", "amended", "corrected", "preliminary"};
    const char *status = text_of(observation, "status");
    for (size_t i = 0; status != NULL && i < sizeof good / sizeof good[0]; i++)
        if (strcmp(status, good[i]) == 0) return true;
    doc_faults_add(r->faults, where, "not_allowed",
                   "the Observation's status is not final, amended, corrected or preliminary");
    return false;
}

static void read_observation(struct reader *r, const struct json *observation, const char *where)
{
    char shown[32];
    const struct json *code_of = json_member(observation, "code");
    const char *code = code_of == NULL ? NULL : our_code(code_of);
    if (code == NULL) return; /* something else that was measured */
    const int measure = measure_find(code);
    if (measure < 0)
        doc_faults_add(r->faults, where, "unknown", "'%s' is not a code of " FHIR_MEASURE_SYSTEM,
                       text_printable(code, shown, sizeof shown));
    if (measure < 0 || !measure_is_input(measure)) return; /* results of ours are not inputs */
    r->has_input = true;
    if (is_modified(r, observation, where) || !has_a_value(r, observation, where)) return;
    take_side(r, observation, where);
    take_time(r, observation);
    if (json_member(observation, "subject") != NULL)
        read_subject(r, json_member(observation, "subject"), where);
    read_input(r, json_member(observation, "valueQuantity"), measure, where);
}

static void read_bundle(struct reader *r, const struct json *bundle, const char *root)
{
    const struct json *entries = json_member(bundle, "entry");
    char where[DOC_POINTER_BYTES];
    int index = 0;
    if (entries == NULL || json_type_of(entries) != JSON_ARRAY) {
        doc_faults_add(r->faults, root, "missing", "the Bundle has no entry");
        return;
    }
    for (const struct json *e = json_first(entries); e != NULL; e = json_next(e), index++) {
        const struct json *resource = json_member(e, "resource");
        const char *type = resource == NULL ? NULL : text_of(resource, "resourceType");
        if (type == NULL || strcmp(type, "Observation") != 0) continue;
        (void)snprintf(where, sizeof where, "Bundle.entry[%d].resource", index);
        read_observation(r, resource, where);
    }
    if (!r->has_input)
        doc_faults_add(r->faults, root, "missing",
                       "no Observation has a code of " FHIR_MEASURE_SYSTEM " that is an input");
}

/* ---- Parameters ---- */

/* Names besides the seven inputs, and the types that they may come as. */
static const struct named {
    const char *name, *values[4];
} names[] = {
    {"side", {"valueCode", "valueString"}},
    {"measured_at", {"valueDateTime", "valueDate", "valueInstant", "valueString"}},
    {"label", {"valueString"}},
    {"resolution", {"valueCode", "valueString"}},
    {"model", {"valueCode", "valueString"}},
    {"sd", {"valueCode", "valueString"}},
};

static const char sd_prefix[] = "sd."; /* standard deviation of the input behind it */

static int param_named(const char *name)
{
    const char *key = case_doc_canonical_key(name);
    for (int i = 0; key != NULL && i < ISCHIA_PARAM_COUNT; i++)
        if (strcmp(ischia_params[i].key, key) == 0) return i;
    return -1;
}

static void read_named(struct reader *r, const struct json *parameter, const struct named *named,
                       const char *where)
{
    for (size_t i = 0; i < sizeof named->values / sizeof named->values[0]; i++) {
        const char *value = named->values[i] == NULL ? NULL : text_of(parameter, named->values[i]);
        if (value == NULL) continue;
        case_places_set(&r->places, named->name, value, where);
        return;
    }
    doc_faults_add(r->faults, where, "wrong_type", "%s is not a %s", named->name, named->values[0]);
}

static void read_observations(struct reader *r, const struct json *parameter, const char *where)
{
    const struct json *bundle = json_member(parameter, "resource");
    const char *type = bundle == NULL ? NULL : text_of(bundle, "resourceType");
    if (type != NULL && strcmp(type, "Bundle") == 0)
        read_bundle(r, bundle, where);
    else
        doc_faults_add(r->faults, where, "wrong_type", "observations is not a Bundle");
}

static void read_parameter(struct reader *r, const struct json *parameter, const char *where)
{
    char shown[32], key[16];
    const char *name = text_of(parameter, "name");
    if (name == NULL) {
        doc_faults_add(r->faults, where, "missing", "a parameter has no name");
        return;
    }
    if (is_modified(r, parameter, where)) return;
    const struct json *quantity = json_member(parameter, "valueQuantity");
    const bool is_sd = strncmp(name, sd_prefix, sizeof sd_prefix - 1) == 0;
    const int param = param_named(is_sd ? name + sizeof sd_prefix - 1 : name);
    if (param >= 0 && is_sd) {
        (void)snprintf(key, sizeof key, "%s%s", sd_prefix, ischia_params[param].key);
        (void)read_quantity(r, quantity, param, key, where);
        return;
    }
    if (param >= 0) {
        read_input(r, quantity, param, where);
        return;
    }
    if (strcmp(name, "subject") == 0) {
        const struct json *reference = json_member(parameter, "valueReference");
        if (r->has_subject)
            doc_faults_add(r->faults, where, "duplicate", "subject is given more than once");
        read_subject(r, reference != NULL ? reference : parameter, where);
        return;
    }
    if (strcmp(name, "observations") == 0) {
        read_observations(r, parameter, where);
        return;
    }
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (strcmp(names[i].name, name) != 0) continue;
        read_named(r, parameter, &names[i], where);
        return;
    }
    const char *nearest = case_doc_nearest_key(name);
    doc_faults_add(r->faults, where, "unknown", "'%s' is not a parameter of $assess%s%s",
                   text_printable(name, shown, sizeof shown),
                   nearest == NULL ? "" : "; did you mean ", nearest == NULL ? "" : nearest);
}

static void read_parameters(struct reader *r, const struct json *root)
{
    const struct json *list = json_member(root, "parameter");
    char where[DOC_POINTER_BYTES];
    int index = 0;
    if (list == NULL || json_type_of(list) != JSON_ARRAY) {
        doc_faults_add(r->faults, "Parameters", "missing", "Parameters has no parameter");
        return;
    }
    for (const struct json *p = json_first(list); p != NULL; p = json_next(p), index++) {
        (void)snprintf(where, sizeof where, "Parameters.parameter[%d]", index);
        read_parameter(r, p, where);
    }
}

/* ---- the whole ---- */

/* The side may be said twice, but not in two ways. */
static void settle_side(struct reader *r)
{
    enum ischia_side *side = &r->input->request.side;
    if (*side == ISCHIA_SIDE_NONE) *side = r->bundle_side;
    if (r->bundle_side != ISCHIA_SIDE_NONE && *side != r->bundle_side)
        doc_faults_add(r->faults, case_places_find(&r->places, "side"), "inconsistent",
                       "side is not that of the Observations' bodySite");
}

static void read_root(struct reader *r, const struct json *root)
{
    const char *type = text_of(root, "resourceType");
    r->is_bundle = type != NULL && strcmp(type, "Bundle") == 0;
    if (r->is_bundle) {
        read_bundle(r, root, "Bundle");
    } else if (type != NULL && strcmp(type, "Parameters") == 0) {
        read_parameters(r, root);
    } else {
        doc_faults_add(r->faults, "resourceType", "unsupported",
                       "the body is neither Parameters nor a Bundle of Observations");
        return;
    }
    case_places_end(&r->places, r->faults,
                    r->is_bundle ? "Bundle.entry.resource" : "Parameters.parameter.where(name='",
                    r->is_bundle ? NULL : "')");
    settle_side(r);
}

enum ischia_code fhir_read_assess(struct fhir_input *ret, const char *json, size_t length,
                                  struct doc_faults *faults, struct ischia_error *err)
{
    struct reader r;
    struct json *root;
    TRY(json_parse(&root, json, length, &json_limits_record, faults, err));
    memset(ret, 0, sizeof *ret);
    memset(&r, 0, sizeof r);
    r.input = ret;
    r.faults = faults;
    case_places_init(&r.places, &ret->request);
    const enum ischia_code code = json_keep_digits(root, json, length, err);
    if (code == ISCHIA_OK) read_root(&r, root);
    json_destroy(root);
    return code;
}
