/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/cds.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/fhir.h"
#include "api/fhir_date.h"
#include "api/measure.h"

#define PREFETCH "observations"

const struct cds_service_info cds_services[CDS_SERVICE_COUNT] = {
    [CDS_PATIENT_VIEW] = {"ischia-patient-view", "patient-view", "Tissue strain when sitting",
                          "Shows the last stored assessment of the tissue under the ischium."},
    [CDS_ORDER_SELECT] = {"ischia-order-select", "order-select",
                          "Tissue strain when sitting, at an order",
                          "Shows the last stored assessment while seating or a support surface is "
                          "ordered."},
};

/* ---- discovery ---- */

void cds_put_discovery(struct json_out *out)
{
    json_open_array(out, "services");
    for (int i = 0; i < CDS_SERVICE_COUNT; i++) {
        const struct cds_service_info *s = &cds_services[i];
        json_open_object(out, NULL);
        json_put_string(out, "hook", s->hook);
        json_put_string(out, "title", s->title);
        json_put_string(out, "description", s->description);
        json_put_string(out, "id", s->id);
        json_open_object(out, "prefetch");
        json_put_string(out, PREFETCH,
                        "Observation?patient={{context.patientId}}&code=" FHIR_MEASURE_SYSTEM "|");
        json_close_object(out);
        json_put_string(out, "usageRequirements",
                        "Never starts a solve. A card's uuid is the id of the assessment.");
        json_close_object(out);
    }
    json_close_array(out);
}

/* ---- reading a hook ---- */

static const char *text_of(const struct json *object, const char *key)
{
    const struct json *value = json_member(object, key);
    return value != NULL && json_type_of(value) == JSON_STRING ? json_string(value) : NULL;
}

/* A member that has to be a text; NULL with a fault when it is not. */
static const char *required(const struct json *object, const char *key, const char *pointer,
                            struct doc_faults *faults)
{
    const char *text = text_of(object, key);
    if (text == NULL || text[0] == '\0')
        doc_faults_add(faults, pointer, "missing", "%s is missing or not a text", key);
    return text;
}

static bool is_ours(const struct json *observation)
{
    const struct json *codings = json_member(json_member(observation, "code"), "coding");
    const char *type = text_of(observation, "resourceType");
    if (type == NULL || strcmp(type, "Observation") != 0 || codings == NULL) return false;
    for (const struct json *c = json_first(codings); c != NULL; c = json_next(c)) {
        const char *system = text_of(c, "system"), *code = text_of(c, "code");
        if (system == NULL || code == NULL || strcmp(system, FHIR_MEASURE_SYSTEM) != 0) continue;
        const int measure = measure_find(code);
        if (measure >= 0 && measure_is_input(measure)) return true;
    }
    return false;
}

static void read_prefetch(struct cds_request *ret, const struct json *bundle)
{
    const char *type = bundle == NULL ? NULL : text_of(bundle, "resourceType");
    if (type == NULL || strcmp(type, "Bundle") != 0) return;
    ret->has_observations = true;
    const struct json *entries = json_member(bundle, "entry");
    for (const struct json *e = json_first(entries); e != NULL; e = json_next(e)) {
        const struct json *observation = json_member(e, "resource");
        const char *time = text_of(observation, "effectiveDateTime");
        if (!is_ours(observation) || time == NULL || strlen(time) >= sizeof ret->measured_at ||
            !fhir_date_is_after(time, ret->measured_at))
            continue;
        (void)snprintf(ret->measured_at, sizeof ret->measured_at, "%s", time);
    }
}

static void read_hook(struct cds_request *ret, enum cds_service service, const struct json *root,
                      struct doc_faults *faults)
{
    const struct json *context = json_member(root, "context");
    const char *hook = required(root, "hook", "/hook", faults), *id;
    (void)required(root, "hookInstance", "/hookInstance", faults);
    (void)required(context, "userId", "/context/userId", faults);
    const char *patient = required(context, "patientId", "/context/patientId", faults);
    if (hook != NULL && strcmp(hook, cds_services[service].hook) != 0)
        doc_faults_add(faults, "/hook", "not_allowed", "this service is for the hook %s",
                       cds_services[service].hook);
    if (service == CDS_ORDER_SELECT &&
        (json_member(context, "selections") == NULL || json_member(context, "draftOrders") == NULL))
        doc_faults_add(faults, "/context", "missing", "selections or draftOrders is missing");
    if (patient == NULL) return;
    const bool whole = strchr(patient, '/') != NULL;
    if (snprintf(ret->patient, sizeof ret->patient, "%s%s", whole ? "" : "Patient/", patient) >=
            (int)sizeof ret->patient ||
        !fhir_is_local_patient(ret->patient, &id))
        doc_faults_add(faults, "/context/patientId", "malformed", "patientId is not a FHIR id");
    read_prefetch(ret, json_member(json_member(root, "prefetch"), PREFETCH));
}

enum ischia_code cds_read(struct cds_request *ret, enum cds_service service, const char *json,
                          size_t length, struct doc_faults *faults, struct ischia_error *err)
{
    struct json *root;
    TRY(json_parse(&root, json, length, &json_limits_record, faults, err));
    memset(ret, 0, sizeof *ret);
    read_hook(ret, service, root, faults);
    json_destroy(root);
    return ISCHIA_OK;
}

/* ---- the card ---- */

enum { DETAIL_BYTES = 4096, SUMMARY_CHARACTERS_MAX = 140 };

__attribute__((format(printf, 3, 4))) static void add(char *text, size_t size, const char *format,
                                                      ...)
{
    va_list arguments;
    const size_t used = strlen(text);
    va_start(arguments, format);
    (void)vsnprintf(text + used, size - used, format, arguments);
    va_end(arguments);
}

static const char *site_words(const struct record *record)
{
    static const char *const words[ISCHIA_SIDE_COUNT] = {
        [ISCHIA_SIDE_NONE] = "Ischium, side not given",
        [ISCHIA_SIDE_LEFT] = "Left ischium",
        [ISCHIA_SIDE_RIGHT] = "Right ischium",
    };
    return words[record->request.side];
}

static void write_detail(char *text, size_t size, const struct record *last,
                         const struct record *other, const char *measured_at)
{
    char digits[2][TEXT_NUMBER_BYTES];
    text[0] = '\0';
    for (int i = 0; i < last->risk.reason_count; i++)
        add(text, size, "- %s\n", last->risk.reason[i]);
    add(text, size, "- eps_max (engineering shear strain on the axis): %s ± %s\n",
        record_digits(last, measure_find("eps_max"), digits[0]),
        record_digits(last, measure_find("eps_max_error"), digits[1]));
    if (other != NULL)
        add(text, size, "- %s, last assessed %.10s: %s\n", site_words(other), other->finished_at,
            risk_headline(other->risk.band));
    if (fhir_date_is_after(measured_at, last->created_at))
        add(text, size, "\n**The record has measurements of %.10s, newer than this assessment.**\n",
            measured_at);
    for (size_t i = 0; i < RISK_CAVEAT_COUNT; i++) add(text, size, "\n*%s*", risk_caveat(i));
}

static void put_link(struct json_out *out, const char *label, const char *origin, const char *id)
{
    char url[512];
    (void)snprintf(url, sizeof url, "%.400s/v1/assessments/%s/report", origin, id);
    json_open_object(out, NULL);
    json_put_string(out, "label", label);
    json_put_string(out, "url", url);
    json_put_string(out, "type", "absolute");
    json_close_object(out);
}

void cds_put_card(struct json_out *out, const struct record *last, const struct record *other,
                  const char *measured_at, const char *origin)
{
    char summary[SUMMARY_CHARACTERS_MAX + 1], detail[DETAIL_BYTES];
    const bool worst_below =
        last->risk.band == RISK_BELOW && (other == NULL || other->risk.band == RISK_BELOW);
    (void)snprintf(summary, sizeof summary, "%s, %.10s: %s", site_words(last), last->finished_at,
                   risk_headline(last->risk.band));
    write_detail(detail, sizeof detail, last, other, measured_at);
    json_open_object(out, NULL);
    json_put_string(out, "uuid", last->id);
    json_put_string(out, "summary", summary);
    json_put_string(out, "indicator", worst_below ? "info" : "warning");
    json_put_string(out, "detail", detail);
    json_open_object(out, "source");
    json_put_string(out, "label", "Ischia " ISCHIA_VERSION);
    json_put_string(out, "url", origin);
    json_close_object(out);
    json_open_array(out, "links");
    put_link(out, "Report", origin, last->id);
    if (other != NULL) put_link(out, "Report of the other side", origin, other->id);
    json_close_array(out);
    json_close_object(out);
}

/* ---- feedback ---- */

static void put_texts(struct json_out *out, const struct json *object, const char *const *keys)
{
    for (; *keys != NULL; keys++)
        if (text_of(object, *keys) != NULL) json_put_string(out, *keys, text_of(object, *keys));
}

/* What the standard knows of an item, and nothing else. */
static enum ischia_code item_text(char **ret, const struct json *item, struct ischia_error *err)
{
    static const char *const plain[] = {"outcome", "outcomeTimestamp", NULL};
    static const char *const comment[] = {"userComment", NULL};
    static const char *const coding[] = {"code", "system", "display", NULL};
    static const char *const id[] = {"id", NULL};
    const struct json *override = json_member(item, "overrideReason");
    struct json_out out;
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    put_texts(&out, item, plain);
    json_open_array(&out, "acceptedSuggestions");
    const struct json *accepted = json_member(item, "acceptedSuggestions");
    for (const struct json *s = json_first(accepted); s != NULL; s = json_next(s)) {
        json_open_object(&out, NULL);
        put_texts(&out, s, id);
        json_close_object(&out);
    }
    json_close_array(&out);
    if (override != NULL) {
        json_open_object(&out, "overrideReason");
        put_texts(&out, override, comment);
        json_open_object(&out, "reason");
        put_texts(&out, json_member(override, "reason"), coding);
        json_close_object(&out);
        json_close_object(&out);
    }
    json_close_object(&out);
    return json_out_take(&out, ret, NULL, err);
}

static enum ischia_code read_item(struct cds_feedback *ret, const struct json *item,
                                  const char *pointer, struct doc_faults *faults,
                                  struct ischia_error *err)
{
    const char *card = text_of(item, "card"), *outcome = text_of(item, "outcome");
    const char *time = text_of(item, "outcomeTimestamp");
    if (card == NULL || strlen(card) != ASSESSMENT_ID_BYTES - 1)
        doc_faults_add(faults, pointer, "malformed", "card is not the uuid of a card");
    else
        (void)snprintf(ret->card, sizeof ret->card, "%s", card);
    if (outcome == NULL || (strcmp(outcome, "accepted") != 0 && strcmp(outcome, "overridden") != 0))
        doc_faults_add(faults, pointer, "not_allowed", "outcome is accepted or overridden");
    if (time == NULL || !text_is_date_or_time(time))
        doc_faults_add(faults, pointer, "malformed", "outcomeTimestamp is not a time");
    return item_text(&ret->document, item, err);
}

enum ischia_code cds_read_feedback(struct cds_feedback *ret, size_t *ret_count, const char *json,
                                   size_t length, struct doc_faults *faults,
                                   struct ischia_error *err)
{
    struct json *root;
    char pointer[DOC_POINTER_BYTES];
    enum ischia_code code = ISCHIA_OK;
    *ret_count = 0;
    TRY(json_parse(&root, json, length, &json_limits_record, faults, err));
    const struct json *list = json_member(root, "feedback");
    if (list == NULL || json_type_of(list) != JSON_ARRAY || json_count(list) == 0 ||
        json_count(list) > CDS_FEEDBACK_MAX) {
        doc_faults_add(faults, "/feedback", "missing", "feedback is not a list of 1 to %d items",
                       CDS_FEEDBACK_MAX);
        list = NULL;
    }
    for (const struct json *i = json_first(list); code == ISCHIA_OK && i != NULL;
         i = json_next(i)) {
        struct cds_feedback *item = &ret[*ret_count];
        memset(item, 0, sizeof *item);
        (void)snprintf(pointer, sizeof pointer, "/feedback/%zu", *ret_count);
        code = read_item(item, i, pointer, faults, err);
        if (code == ISCHIA_OK) ++*ret_count;
    }
    json_destroy(root);
    return code;
}

void cds_feedback_finish(struct cds_feedback *items, size_t count)
{
    for (size_t i = 0; i < count; i++) free(items[i].document);
}
