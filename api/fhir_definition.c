/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What this server can do and what its own codes mean: made from the tables that do it. */
#include <stdio.h>
#include <string.h>

#include "api/case_words.h"
#include "api/fhir_write.h"
#include "api/measure.h"

#define DEFINED_AT "2026-12-01" /* when the definitions below were last changed */

static void put_head(struct json_out *out, const char *type, const char *id, const char *url,
                     const char *name, const char *title)
{
    json_put_string(out, "resourceType", type);
    json_put_string(out, "id", id);
    json_put_string(out, "url", url);
    json_put_string(out, "version", ISCHIA_VERSION);
    json_put_string(out, "name", name);
    json_put_string(out, "title", title);
    json_put_string(out, "status", "active");
    json_put_bool(out, "experimental", false);
    json_put_string(out, "date", DEFINED_AT);
}

/* ---- CodeSystem ---- */

static void put_concept(struct json_out *out, const char *code, const char *display,
                        const char *definition)
{
    json_open_object(out, NULL);
    json_put_string(out, "code", code);
    json_put_string(out, "display", display);
    json_put_string(out, "definition", definition);
    json_close_object(out);
}

static void put_measures(struct json_out *out)
{
    char definition[320];
    for (int i = 0; i < MEASURE_COUNT; i++) {
        const struct measure m = measure_at(i);
        size_t used =
            (size_t)snprintf(definition, sizeof definition, "%s Unit: %s.", m.definition, m.unit);
        if (measure_is_input(i))
            (void)snprintf(definition + used, sizeof definition - used,
                           " Accepted: %g to %g; studied: %g to %g.", ischia_params[i].accepted_min,
                           ischia_params[i].accepted_max, ischia_params[i].studied_min,
                           ischia_params[i].studied_max);
        put_concept(out, m.code, m.display, definition);
    }
}

static void put_bands(struct json_out *out)
{
    for (int i = 0; i < RISK_BAND_COUNT; i++)
        put_concept(out, risk_bands[i].name, risk_headline((enum risk_band)i),
                    risk_headline((enum risk_band)i));
}

static void put_assessment_code(struct json_out *out)
{
    put_concept(out, FHIR_ASSESSMENT_CODE, "Tissue strain under one ischium",
                "Strain of muscle and fat under one ischium of a sitting person, solved by the "
                "model " ISCHIA_MODEL_NAME " from seven measured numbers.");
}

static const struct code_system {
    const char *id, *url, *name, *title;
    int count;
    void (*put)(struct json_out *out);
} code_systems[] = {
    {"measure", FHIR_MEASURE_SYSTEM, "IschiaMeasure", "Numbers that go in and come out",
     MEASURE_COUNT, put_measures},
    {"band", FHIR_BAND_SYSTEM, "IschiaBand", "Which damage thresholds are crossed in muscle",
     RISK_BAND_COUNT, put_bands},
    {"assessment", FHIR_ASSESSMENT_SYSTEM, "IschiaAssessment", "What is done", 1,
     put_assessment_code},
};

static bool put_code_system(struct json_out *out, const char *id)
{
    for (size_t i = 0; i < sizeof code_systems / sizeof code_systems[0]; i++) {
        const struct code_system *s = &code_systems[i];
        if (strcmp(s->id, id) != 0) continue;
        put_head(out, "CodeSystem", s->id, s->url, s->name, s->title);
        json_put_bool(out, "caseSensitive", true);
        json_put_string(out, "content", "complete");
        json_put_integer(out, "count", s->count);
        json_open_array(out, "concept");
        s->put(out);
        json_close_array(out);
        return true;
    }
    return false;
}

/* ---- OperationDefinition ---- */

static void put_parameter(struct json_out *out, const char *name, const char *use, int min,
                          const char *type, const char *documentation)
{
    json_open_object(out, NULL);
    json_put_string(out, "name", name);
    json_put_string(out, "use", use);
    json_put_integer(out, "min", min);
    json_put_string(out, "max", "1");
    json_put_string(out, "documentation", documentation);
    json_put_string(out, "type", type);
    json_close_object(out);
}

static void put_input_parameters(struct json_out *out)
{
    char documentation[240];
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct ischia_param_info *p = &ischia_params[i];
        (void)snprintf(documentation, sizeof documentation,
                       "%s Accepted: %g to %g %s, in UCUM units that can be converted.",
                       words_get(LANGUAGE_EN, param_words[i].help), p->accepted_min,
                       p->accepted_max, p->unit);
        put_parameter(out, p->key, "in", 0, "Quantity", documentation);
    }
}

static void put_deviation_parameters(struct json_out *out)
{
    char documentation[120], name[16];
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        (void)snprintf(name, sizeof name, "sd.%s", ischia_params[i].key);
        (void)snprintf(documentation, sizeof documentation,
                       "Standard deviation of %s, as it was measured: the result gets an interval.",
                       ischia_params[i].key);
        put_parameter(out, name, "in", 0, "Quantity", documentation);
    }
}

static bool put_operation(struct json_out *out, const char *id)
{
    if (strcmp(id, "assess") != 0) return false;
    put_head(out, "OperationDefinition", "assess", "urn:ischia:operation:assess", "Assess",
             "Assess the tissue under one ischium");
    json_put_string(out, "kind", "operation");
    json_put_bool(out, "affectsState", true);
    json_put_string(out, "code", "assess");
    json_put_bool(out, "system", true);
    json_put_bool(out, "type", false);
    json_put_bool(out, "instance", false);
    json_open_array(out, "parameter");
    put_input_parameters(out);
    put_parameter(out, "observations", "in", 0, "Bundle",
                  "The seven inputs as Observations with codes of " FHIR_MEASURE_SYSTEM
                  ", instead of as Quantities. Such a Bundle may also be the whole body.");
    put_parameter(out, "subject", "in", 0, "Reference",
                  "The Patient, kept as given. With a relative reference Patient/ID the "
                  "pseudonymous subject of the assessment is ID, else a digest of the reference.");
    put_parameter(out, "side", "in", 0, "code", "left or right.");
    put_parameter(out, "measured_at", "in", 0, "dateTime", "When the inputs were measured.");
    put_parameter(out, "label", "in", 0, "string", "Free text of your own.");
    put_parameter(out, "resolution", "in", 0, "code", "Of the mesh: standard or fine.");
    put_parameter(out, "model", "in", 0, "code", "A named set of model options.");
    put_parameter(out, "sd", "in", 0, "code",
                  "typical: usual standard deviations of the inputs, where sd.R1 and so on do not "
                  "say others.");
    put_deviation_parameters(out);
    put_parameter(out, "return", "out", 1, "Bundle",
                  "RiskAssessment, Observations, DiagnosticReport, Provenance and Device.");
    json_close_array(out);
    return true;
}

/* ---- StructureDefinition ---- */

struct element {
    const char *id; /* path; a slice would need more                     */
    int min;        /* -1: as in the base                                */
    const char *max;
    const char *key, *value; /* a fixed or pattern element; NULL: none     */
    const char *words;       /* what it says                              */
};

static const struct element observation_elements[] = {
    {"Observation.code", 1, NULL, NULL, NULL, "A code of " FHIR_MEASURE_SYSTEM "."},
    {"Observation.subject", 1, NULL, NULL, NULL, "The person as the sender named them."},
    {"Observation.effective[x]", 1, NULL, NULL, NULL, "When the inputs were measured."},
    {"Observation.value[x]", 1, NULL, NULL, NULL, "The number, with every digit that is kept."},
    {"Observation.value[x].system", 1, NULL, "fixedUri", FHIR_UCUM_SYSTEM, "UCUM."},
    {"Observation.value[x].code", 1, NULL, NULL, NULL, "The unit of the code's definition."},
    {"Observation.bodySite", 1, NULL, NULL, NULL, "SNOMED CT 69030007 with its laterality."},
};
static const struct element risk_elements[] = {
    {"RiskAssessment.method", 1, NULL, NULL, NULL, "Name and version of the model."},
    {"RiskAssessment.performer", 1, NULL, NULL, NULL, "The Device: this software."},
    {"RiskAssessment.basis", 7, NULL, NULL, NULL, "The seven inputs."},
    {"RiskAssessment.prediction", -1, "1", NULL, NULL, "Only when the solve has converged."},
    {"RiskAssessment.prediction.probability[x]", -1, "0", NULL, NULL, "None is claimed."},
    {"RiskAssessment.prediction.qualitativeRisk", 1, NULL, NULL, NULL,
     "A code of " FHIR_BAND_SYSTEM "."},
    {"RiskAssessment.note", 1, NULL, NULL, NULL, "The caveats, which always go with it."},
};

static const struct profile {
    const char *id, *url, *name, *title, *type;
    const struct element *elements;
    size_t count;
} profiles[] = {
    {"measure-observation", "urn:ischia:profile:measure-observation", "IschiaMeasureObservation",
     "One number of an assessment", "Observation", observation_elements,
     sizeof observation_elements / sizeof observation_elements[0]},
    {"strain-risk-assessment", "urn:ischia:profile:strain-risk-assessment",
     "IschiaStrainRiskAssessment", "Tissue strain under one ischium", "RiskAssessment",
     risk_elements, sizeof risk_elements / sizeof risk_elements[0]},
};

static void put_element(struct json_out *out, const struct element *e)
{
    json_open_object(out, NULL);
    json_put_string(out, "id", e->id);
    json_put_string(out, "path", e->id);
    json_put_string(out, "short", e->words);
    if (e->min >= 0) json_put_integer(out, "min", e->min);
    if (e->max != NULL) json_put_string(out, "max", e->max);
    if (e->key != NULL) json_put_string(out, e->key, e->value);
    json_close_object(out);
}

static bool put_profile(struct json_out *out, const char *id)
{
    char base[96];
    for (size_t i = 0; i < sizeof profiles / sizeof profiles[0]; i++) {
        const struct profile *p = &profiles[i];
        if (strcmp(p->id, id) != 0) continue;
        put_head(out, "StructureDefinition", p->id, p->url, p->name, p->title);
        (void)snprintf(base, sizeof base, "http://hl7.org/fhir/StructureDefinition/%s", p->type);
        json_put_string(out, "fhirVersion", FHIR_VERSION);
        json_put_string(out, "kind", "resource");
        json_put_bool(out, "abstract", false);
        json_put_string(out, "type", p->type);
        json_put_string(out, "baseDefinition", base);
        json_put_string(out, "derivation", "constraint");
        json_open_object(out, "differential");
        json_open_array(out, "element");
        put_element(out, &(struct element){p->type, -1, NULL, NULL, NULL, p->title});
        for (size_t k = 0; k < p->count; k++) put_element(out, &p->elements[k]);
        json_close_array(out);
        json_close_object(out);
        return true;
    }
    return false;
}

/* ---- which there are ---- */

const char *fhir_definition_id(enum fhir_type type, size_t index)
{
    const size_t systems = sizeof code_systems / sizeof code_systems[0];
    const size_t structures = sizeof profiles / sizeof profiles[0];
    switch (type) {
    case FHIR_DEVICE:
        return index == 0 ? FHIR_DEVICE_ID : NULL;
    case FHIR_OPERATION_DEFINITION:
        return index == 0 ? "assess" : NULL;
    case FHIR_CODE_SYSTEM:
        return index < systems ? code_systems[index].id : NULL;
    case FHIR_STRUCTURE_DEFINITION:
        return index < structures ? profiles[index].id : NULL;
    default:
        return NULL;
    }
}

bool fhir_put_definition(struct json_out *out, enum fhir_type type, const char *id)
{
    static bool (*const put[FHIR_TYPE_COUNT])(struct json_out *, const char *) = {
        [FHIR_OPERATION_DEFINITION] = put_operation,
        [FHIR_CODE_SYSTEM] = put_code_system,
        [FHIR_STRUCTURE_DEFINITION] = put_profile,
    };
    return put[type] != NULL && put[type](out, id);
}

/* ---- CapabilityStatement ---- */

static const struct search_parameter {
    const char *name, *type, *documentation;
} search_parameters[] = {
    {"subject", "reference", "As given to $assess, or the pseudonymous subject of /v1."},
    {"patient", "reference", "The same as subject."},
    {"date", "date", "When the solve ended; prefixes eq, gt, ge, lt, le, sa, eb."},
    {"_lastUpdated", "date", "When it last changed; the same prefixes."},
    {"status", "token", "registered, final or cancelled."},
    {"_id", "token", "The id of the assessment."},
};

static void put_interaction(struct json_out *out, const char *code)
{
    json_open_object(out, NULL);
    json_put_string(out, "code", code);
    json_close_object(out);
}

static void put_resource(struct json_out *out, enum fhir_type type)
{
    const bool searched = type == FHIR_RISK_ASSESSMENT || type == FHIR_DIAGNOSTIC_REPORT;
    json_open_object(out, NULL);
    json_put_string(out, "type", fhir_type_names[type]);
    json_open_array(out, "interaction");
    put_interaction(out, "read");
    if (searched) put_interaction(out, "search-type");
    json_close_array(out);
    /* a definition has no meta.versionId */
    json_put_string(out, "versioning", type < FHIR_DEVICE ? "versioned" : "no-version");
    if (searched) {
        json_open_array(out, "searchParam");
        for (size_t i = 0; i < sizeof search_parameters / sizeof search_parameters[0]; i++) {
            json_open_object(out, NULL);
            json_put_string(out, "name", search_parameters[i].name);
            json_put_string(out, "type", search_parameters[i].type);
            json_put_string(out, "documentation", search_parameters[i].documentation);
            json_close_object(out);
        }
        json_close_array(out);
    }
    json_close_object(out);
}

static void put_rest(struct json_out *out)
{
    json_open_object(out, NULL);
    json_put_string(out, "mode", "server");
    json_put_string(out, "documentation",
                    "Access tokens as everywhere in this service: Authorization: Bearer.");
    json_open_array(out, "resource");
    for (int i = 0; i < FHIR_TYPE_COUNT; i++) put_resource(out, (enum fhir_type)i);
    json_close_array(out);
    json_open_array(out, "operation");
    json_open_object(out, NULL);
    json_put_string(out, "name", "assess");
    json_put_string(out, "definition", "urn:ischia:operation:assess");
    json_close_object(out);
    json_close_array(out);
    json_close_object(out);
}

void fhir_put_capability_statement(struct json_out *out, const char *base)
{
    json_put_string(out, "resourceType", "CapabilityStatement");
    json_put_string(out, "status", "active");
    json_put_string(out, "date", DEFINED_AT);
    json_put_string(out, "kind", "instance");
    json_open_object(out, "software");
    json_put_string(out, "name", "Ischia");
    json_put_string(out, "version", ISCHIA_VERSION);
    json_close_object(out);
    json_open_object(out, "implementation");
    json_put_string(out, "description", "Tissue strain under the ischium from seven numbers");
    json_put_string(out, "url", base);
    json_close_object(out);
    json_put_string(out, "fhirVersion", FHIR_VERSION);
    json_open_array(out, "format");
    json_put_string(out, NULL, "json");
    json_put_string(out, NULL, FHIR_MEDIA_TYPE);
    json_close_array(out);
    json_open_array(out, "rest");
    put_rest(out);
    json_close_array(out);
}
