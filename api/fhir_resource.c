/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The resources of one assessment. */
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "api/base64.h"
#include "api/case_words.h"
#include "api/fhir_write.h"
#include "api/measure.h"

const char *const fhir_type_names[FHIR_TYPE_COUNT] = {
    [FHIR_RISK_ASSESSMENT] = "RiskAssessment",
    [FHIR_OBSERVATION] = "Observation",
    [FHIR_DIAGNOSTIC_REPORT] = "DiagnosticReport",
    [FHIR_PROVENANCE] = "Provenance",
    [FHIR_DEVICE] = "Device",
    [FHIR_OPERATION_DEFINITION] = "OperationDefinition",
    [FHIR_CODE_SYSTEM] = "CodeSystem",
    [FHIR_STRUCTURE_DEFINITION] = "StructureDefinition",
};

/* Status of RiskAssessment and DiagnosticReport: both value sets have these words. */
static const char *const status_words[ASSESSMENT_STATUS_COUNT] = {
    [ASSESSMENT_QUEUED] = "registered",   [ASSESSMENT_RUNNING] = "registered",
    [ASSESSMENT_SUCCEEDED] = "final",     [ASSESSMENT_FAILED] = "cancelled",
    [ASSESSMENT_CANCELLED] = "cancelled",
};

/* ---- pieces ---- */

static void put_coding(struct json_out *out, const char *system, const char *code,
                       const char *display)
{
    json_open_object(out, NULL);
    json_put_string(out, "system", system);
    json_put_string(out, "code", code);
    if (display != NULL) json_put_string(out, "display", display);
    json_close_object(out);
}

void fhir_put_concept(struct json_out *out, const char *key, const char *system, const char *code,
                      const char *display, const char *text)
{
    json_open_object(out, key);
    json_open_array(out, "coding");
    put_coding(out, system, code, display);
    json_close_array(out);
    if (text != NULL) json_put_string(out, "text", text);
    json_close_object(out);
}

void fhir_put_reference(struct json_out *out, const char *key, enum fhir_type type, const char *id)
{
    char reference[24 + FHIR_ID_BYTES];
    (void)snprintf(reference, sizeof reference, "%s/%s", fhir_type_names[type], id);
    json_open_object(out, key);
    json_put_string(out, "reference", reference);
    json_close_object(out);
}

void fhir_put_measure_code(struct json_out *out, const char *key, int measure)
{
    const struct measure m = measure_at(measure);
    fhir_put_concept(out, key, FHIR_MEASURE_SYSTEM, m.code, m.display, m.display);
}

void fhir_open(struct json_out *out, const char *key, const char *type, const char *id)
{
    json_open_object(out, key);
    json_put_string(out, "resourceType", type);
    json_put_string(out, "id", id);
}

static void put_meta(struct json_out *out, const struct record *record)
{
    char version[24];
    (void)snprintf(version, sizeof version, "%lld", record->version);
    json_open_object(out, "meta");
    json_put_string(out, "versionId", version);
    json_put_string(out, "lastUpdated", record->updated_at);
    json_close_object(out);
}

static void put_identifier(struct json_out *out, const char *system, const char *value)
{
    json_open_object(out, "identifier");
    if (system[0] != '\0') json_put_string(out, "system", system);
    json_put_string(out, "value", value);
    json_close_object(out);
}

/* The person as the sender named them, or by the pseudonym; the element is required. */
static void put_subject(struct json_out *out, const struct record *record)
{
    const struct origin *o = &record->origin;
    char pid[ORIGIN_TEXT_BYTES];
    (void)snprintf(pid, sizeof pid, "%.*s", (int)strcspn(o->pid, "^~&"), o->pid);
    json_open_object(out, "subject");
    if (o->reference[0] != '\0') json_put_string(out, "reference", o->reference);
    if (o->identifier_value[0] != '\0')
        put_identifier(out, o->identifier_system, o->identifier_value);
    else if (pid[0] != '\0')
        put_identifier(out, "", pid);
    else if (o->reference[0] == '\0' && record->request.subject[0] != '\0')
        put_identifier(out, FHIR_SUBJECT_SYSTEM, record->request.subject);
    else if (o->reference[0] == '\0')
        json_put_string(out, "display", "The subject was not given");
    json_close_object(out);
}

/* When it was measured, else when it was sent. RFC 3339 allows "t" and "z", FHIR does not. */
static void put_effective(struct json_out *out, const struct record *record)
{
    const char *measured = record->request.measured_at;
    char time[ISCHIA_MEASURED_AT_BYTES];
    (void)snprintf(time, sizeof time, "%s", measured[0] != '\0' ? measured : record->created_at);
    for (char *c = time; *c != '\0'; c++) *c = (char)toupper((unsigned char)*c);
    json_put_string(out, "effectiveDateTime", time);
}

static void put_site(struct json_out *out, const struct record *record)
{
    /* SNOMED CT expressions: the structure, refined by its laterality. */
    static const char *const expressions[ISCHIA_SIDE_COUNT] = {
        [ISCHIA_SIDE_LEFT] = FHIR_SNOMED_SITE ":272741003=7771000",
        [ISCHIA_SIDE_RIGHT] = FHIR_SNOMED_SITE ":272741003=24028007",
    };
    const char *expression = expressions[record->request.side];
    json_open_object(out, "bodySite");
    json_open_array(out, "coding");
    put_coding(out, FHIR_SNOMED_SYSTEM, FHIR_SNOMED_SITE, "Ischial tuberosity structure");
    if (expression != NULL) put_coding(out, FHIR_SNOMED_SYSTEM, expression, NULL);
    json_close_array(out);
    json_put_string(out, "text", record_site(record));
    json_close_object(out);
}

static void put_note(struct json_out *out, const char *text)
{
    json_open_object(out, NULL);
    json_put_string(out, "text", text);
    json_close_object(out);
}

void fhir_observation_id_of(const struct record *record, int measure, char ret[FHIR_ID_BYTES])
{
    char id[MEASURE_ID_BYTES];
    measure_id(measure, id);
    (void)snprintf(ret, FHIR_ID_BYTES, "%.36s-%.27s", record->id, id);
}

bool fhir_observation_id(const char *id, char ret_assessment[ASSESSMENT_ID_BYTES], int *ret_measure)
{
    const size_t length = ASSESSMENT_ID_BYTES - 1;
    char known[MEASURE_ID_BYTES];
    if (strlen(id) < length + 2 || id[length] != '-') return false;
    for (int i = 0; i < MEASURE_COUNT; i++) {
        measure_id(i, known);
        if (strcmp(known, id + length + 1) != 0) continue;
        (void)snprintf(ret_assessment, ASSESSMENT_ID_BYTES, "%s", id);
        *ret_measure = i;
        return true;
    }
    return false;
}

/* References to the record's Observations of rows [0, end); "#…" where they are contained. */
static void put_observation_references(struct json_out *out, const char *key,
                                       const struct record *record, int end, bool contained)
{
    char id[FHIR_ID_BYTES], local[MEASURE_ID_BYTES + 1] = "#", digits[TEXT_NUMBER_BYTES];
    json_open_array(out, key);
    for (int i = 0; i < end; i++) {
        if (record_digits(record, i, digits)[0] == '\0') continue;
        measure_id(i, local + 1);
        fhir_observation_id_of(record, i, id);
        if (!contained) {
            fhir_put_reference(out, NULL, FHIR_OBSERVATION, id);
            continue;
        }
        json_open_object(out, NULL);
        json_put_string(out, "reference", local);
        json_close_object(out);
    }
    json_close_array(out);
}

/* ---- Observation ---- */

static void put_quantity(struct json_out *out, const struct record *record, int measure)
{
    char digits[TEXT_NUMBER_BYTES];
    const struct measure m = measure_at(measure);
    json_open_object(out, "valueQuantity");
    json_put_raw(out, "value", record_digits(record, measure, digits));
    json_put_string(out, "unit", m.unit);
    json_put_string(out, "system", FHIR_UCUM_SYSTEM);
    json_put_string(out, "code", m.unit);
    json_close_object(out);
}

static void put_device_reference(struct json_out *out, const char *key, bool contained)
{
    if (!contained) {
        fhir_put_reference(out, key, FHIR_DEVICE, FHIR_DEVICE_ID);
        return;
    }
    json_open_object(out, key);
    json_put_string(out, "reference", "#" FHIR_DEVICE_ID);
    json_close_object(out);
}

static void put_observation(struct json_out *out, const char *key, const struct record *record,
                            int measure, bool contained)
{
    char id[FHIR_ID_BYTES];
    const bool input = measure_is_input(measure);
    if (contained)
        measure_id(measure, id);
    else
        fhir_observation_id_of(record, measure, id);
    fhir_open(out, key, "Observation", id);
    if (!contained) put_meta(out, record);
    json_put_string(out, "status", "final");
    fhir_put_measure_code(out, "code", measure);
    put_subject(out, record);
    put_effective(out, record);
    put_quantity(out, record, measure);
    put_site(out, record);
    if (!input) {
        put_device_reference(out, "device", contained);
        if (!contained)
            put_observation_references(out, "derivedFrom", record, ISCHIA_PARAM_COUNT, false);
    }
    json_close_object(out);
}

void fhir_put_observation(struct json_out *out, const char *key, const struct record *record,
                          int measure)
{
    put_observation(out, key, record, measure, false);
}

/* ---- RiskAssessment ---- */

static void put_prediction(struct json_out *out, const struct record *record)
{
    char reasons[RISK_REASONS_MAX * (RISK_REASON_BYTES + 1) + 1] = "", outcome[80];
    const struct risk *risk = &record->risk;
    const struct risk_band_info *band = &risk_bands[risk->band];
    size_t used = 0;
    for (int i = 0; i < risk->reason_count; i++) {
        const int n = snprintf(reasons + used, sizeof reasons - used, "%s%s", i == 0 ? "" : " ",
                               risk->reason[i]);
        if (n > 0 && (size_t)n < sizeof reasons - used) used += (size_t)n;
    }
    (void)snprintf(outcome, sizeof outcome, "Muscle strain over damage thresholds, %s",
                   record_site(record));
    json_open_array(out, "prediction");
    json_open_object(out, NULL);
    json_open_object(out, "outcome");
    json_put_string(out, "text", outcome);
    json_close_object(out);
    fhir_put_concept(out, "qualitativeRisk", FHIR_BAND_SYSTEM, band->name,
                     words_get(LANGUAGE_EN, band->headline),
                     words_get(LANGUAGE_EN, band->headline));
    json_put_string(out, "rationale", reasons);
    json_close_object(out);
    json_close_array(out);
}

/* What must be read with the result: the caveats, and what lies outside what was studied. */
static void put_notes(struct json_out *out, const struct record *record)
{
    struct ischia_fault warnings[ISCHIA_PARAM_COUNT];
    const size_t count = case_warnings(&record->request.values, LANGUAGE_EN, warnings);
    json_open_array(out, "note");
    if (record->problem[0] != '\0') put_note(out, record->problem);
    for (size_t i = 0; i < RISK_CAVEAT_COUNT; i++) put_note(out, risk_caveat(i));
    for (size_t i = 0; i < count; i++) put_note(out, warnings[i].detail);
    json_close_array(out);
}

static void put_method(struct json_out *out)
{
    char text[64];
    (void)snprintf(text, sizeof text, "%s, version %d", ISCHIA_MODEL_NAME, ISCHIA_MODEL_VERSION);
    json_open_object(out, "method");
    json_put_string(out, "text", text);
    json_close_object(out);
}

static void put_code(struct json_out *out, const struct record *record)
{
    char text[80];
    (void)snprintf(text, sizeof text, "Tissue strain under the %s", record_site(record));
    fhir_put_concept(out, "code", FHIR_ASSESSMENT_SYSTEM, FHIR_ASSESSMENT_CODE,
                     "Tissue strain under one ischium", text);
}

static void put_own_identifier(struct json_out *out, const struct record *record)
{
    char urn[16 + ASSESSMENT_ID_BYTES];
    (void)snprintf(urn, sizeof urn, "urn:uuid:%s", record->id);
    json_open_array(out, "identifier");
    json_open_object(out, NULL);
    json_put_string(out, "system", "urn:ietf:rfc:3986");
    json_put_string(out, "value", urn);
    json_close_object(out);
    json_close_array(out);
}

void fhir_put_risk_assessment(struct json_out *out, const char *key, const struct record *record)
{
    fhir_open(out, key, "RiskAssessment", record->id);
    put_meta(out, record);
    put_own_identifier(out, record);
    json_put_string(out, "status", status_words[record->status]);
    put_method(out);
    put_code(out, record);
    put_subject(out, record);
    if (record->finished_at[0] != '\0')
        json_put_string(out, "occurrenceDateTime", record->finished_at);
    fhir_put_reference(out, "performer", FHIR_DEVICE, FHIR_DEVICE_ID);
    put_observation_references(out, "basis", record, ISCHIA_PARAM_COUNT, false);
    if (record->status == ASSESSMENT_SUCCEEDED) put_prediction(out, record);
    put_notes(out, record);
    json_close_object(out);
}

/* ---- DiagnosticReport ---- */

static void put_attachment(struct json_out *out, const struct record *record, const char *html)
{
    struct text_out data;
    text_out_init(&data);
    base64_put(&data, html, strlen(html));
    json_open_array(out, "presentedForm");
    json_open_object(out, NULL);
    json_put_string(out, "contentType", "text/html; charset=utf-8");
    json_put_string(out, "language", "en");
    /* Without memory the attachment would be cut: the document then fails as a whole. */
    out->text.failed = out->text.failed || data.failed;
    json_put_string(out, "data", data.text == NULL ? "" : data.text);
    json_put_integer(out, "size", (long long)strlen(html));
    json_put_string(out, "title", "Report");
    if (record->finished_at[0] != '\0') json_put_string(out, "creation", record->finished_at);
    json_close_object(out);
    json_close_array(out);
    text_out_finish(&data);
}

static void put_contained(struct json_out *out, const struct record *record)
{
    char digits[TEXT_NUMBER_BYTES];
    json_open_array(out, "contained");
    fhir_put_device(out, NULL);
    for (int i = 0; i < MEASURE_COUNT; i++)
        if (record_digits(record, i, digits)[0] != '\0')
            put_observation(out, NULL, record, i, true);
    json_close_array(out);
}

void fhir_put_diagnostic_report(struct json_out *out, const char *key, const struct record *record,
                                const char *html, bool contained)
{
    const bool done = record->status == ASSESSMENT_SUCCEEDED;
    fhir_open(out, key, "DiagnosticReport", record->id);
    if (!contained) put_meta(out, record);
    if (contained) put_contained(out, record);
    put_own_identifier(out, record);
    json_put_string(out, "status", status_words[record->status]);
    put_code(out, record);
    put_subject(out, record);
    put_effective(out, record);
    if (record->finished_at[0] != '\0') json_put_string(out, "issued", record->finished_at);
    put_observation_references(out, "result", record, MEASURE_COUNT, contained);
    if (done)
        json_put_string(out, "conclusion", risk_headline(record->risk.band));
    else if (record->problem[0] != '\0')
        json_put_string(out, "conclusion", record->problem);
    if (html[0] != '\0') put_attachment(out, record, html);
    json_close_object(out);
}

/* ---- Provenance, Device ---- */

void fhir_put_provenance(struct json_out *out, const char *key, const struct record *record)
{
    char id[FHIR_ID_BYTES], digits[TEXT_NUMBER_BYTES];
    fhir_open(out, key, "Provenance", record->id);
    put_meta(out, record);
    json_open_array(out, "target");
    fhir_put_reference(out, NULL, FHIR_RISK_ASSESSMENT, record->id);
    fhir_put_reference(out, NULL, FHIR_DIAGNOSTIC_REPORT, record->id);
    for (int i = ISCHIA_PARAM_COUNT; i < MEASURE_COUNT; i++) {
        if (record_digits(record, i, digits)[0] == '\0') continue;
        fhir_observation_id_of(record, i, id);
        fhir_put_reference(out, NULL, FHIR_OBSERVATION, id);
    }
    json_close_array(out);
    json_put_string(out, "recorded", record->updated_at);
    json_open_array(out, "agent");
    json_open_object(out, NULL);
    fhir_put_concept(out, "type",
                     "http://terminology.hl7.org/CodeSystem/provenance-participant-type",
                     "assembler", "Assembler", NULL);
    fhir_put_reference(out, "who", FHIR_DEVICE, FHIR_DEVICE_ID);
    json_close_object(out);
    json_close_array(out);
    json_open_array(out, "entity");
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        fhir_observation_id_of(record, i, id);
        json_open_object(out, NULL);
        json_put_string(out, "role", "source");
        fhir_put_reference(out, "what", FHIR_OBSERVATION, id);
        json_close_object(out);
    }
    json_close_array(out);
    json_close_object(out);
}

static void put_version(struct json_out *out, const char *of, const char *value)
{
    json_open_object(out, NULL);
    json_open_object(out, "type");
    json_put_string(out, "text", of);
    json_close_object(out);
    json_put_string(out, "value", value);
    json_close_object(out);
}

void fhir_put_device(struct json_out *out, const char *key)
{
    char version[16];
    (void)snprintf(version, sizeof version, "%d", ISCHIA_MODEL_VERSION);
    fhir_open(out, key, "Device", FHIR_DEVICE_ID);
    json_put_string(out, "status", "active");
    json_open_array(out, "deviceName");
    json_open_object(out, NULL);
    json_put_string(out, "name", "Ischia");
    json_put_string(out, "type", "other");
    json_close_object(out);
    json_close_array(out);
    json_open_object(out, "type");
    json_put_string(out, "text", "Software: tissue strain under the ischium");
    json_close_object(out);
    json_open_array(out, "version");
    put_version(out, "software", ISCHIA_VERSION);
    put_version(out, "model " ISCHIA_MODEL_NAME, version);
    json_close_array(out);
    json_open_array(out, "note");
    put_note(out, risk_caveat(RISK_CAVEAT_COUNT - 1));
    json_close_array(out);
    json_close_object(out);
}

/* ---- all of them ---- */

static void open_entry(struct json_out *out, const char *base, enum fhir_type type, const char *id)
{
    char url[512];
    (void)snprintf(url, sizeof url, "%s/%s/%s", base, fhir_type_names[type], id);
    json_open_object(out, NULL);
    json_put_string(out, "fullUrl", url);
}

void fhir_put_entries(struct json_out *out, const char *base, const struct record *record,
                      const char *html)
{
    char id[FHIR_ID_BYTES], digits[TEXT_NUMBER_BYTES];
    open_entry(out, base, FHIR_RISK_ASSESSMENT, record->id);
    fhir_put_risk_assessment(out, "resource", record);
    json_close_object(out);
    for (int i = 0; i < MEASURE_COUNT; i++) {
        if (record_digits(record, i, digits)[0] == '\0') continue;
        fhir_observation_id_of(record, i, id);
        open_entry(out, base, FHIR_OBSERVATION, id);
        fhir_put_observation(out, "resource", record, i);
        json_close_object(out);
    }
    open_entry(out, base, FHIR_DIAGNOSTIC_REPORT, record->id);
    fhir_put_diagnostic_report(out, "resource", record, html, false);
    json_close_object(out);
    open_entry(out, base, FHIR_PROVENANCE, record->id);
    fhir_put_provenance(out, "resource", record);
    json_close_object(out);
    open_entry(out, base, FHIR_DEVICE, FHIR_DEVICE_ID);
    fhir_put_device(out, "resource");
    json_close_object(out);
}
