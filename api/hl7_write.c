/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "api/case_words.h"
#include "api/hl7.h"
#include "api/measure.h"

/* ---- times ---- */

void hl7_time(const char *rfc3339, char ret[HL7_TIME_BYTES])
{
    enum { FRACTION_DIGITS_MAX = 4 };
    size_t used = 0;
    const char *offset = strpbrk(rfc3339, "Zz+");
    if (offset == NULL && strlen(rfc3339) > 10) offset = strrchr(rfc3339, '-');
    const char *point = strchr(rfc3339, '.');
    for (const char *c = rfc3339; *c != '\0' && used + 6 < HL7_TIME_BYTES; c++) {
        if (c == offset && toupper((unsigned char)*c) == 'Z') break;
        if (point != NULL && offset != NULL && c > point + FRACTION_DIGITS_MAX && c < offset)
            continue;
        if (isdigit((unsigned char)*c) || *c == '.' || c == offset) ret[used++] = *c;
    }
    ret[used] = '\0';
    if (offset != NULL && toupper((unsigned char)*offset) == 'Z')
        (void)snprintf(ret + used, HL7_TIME_BYTES - used, "+0000");
}

void hl7_time_read(const char *ts, char ret[ISCHIA_MEASURED_AT_BYTES])
{
    const size_t digits = strspn(ts, "0123456789");
    const char *fraction = ts[digits] == '.' ? ts + digits : "";
    const size_t fraction_length = fraction[0] == '\0' ? 0 : 1 + strspn(fraction + 1, "0123456789");
    const char *offset = ts + digits + fraction_length;
    ret[0] = '\0';
    if (digits < 8) return;
    if (digits >= 14 && (offset[0] == '+' || offset[0] == '-') && strlen(offset) == 5)
        (void)snprintf(ret, ISCHIA_MEASURED_AT_BYTES, "%.4s-%.2s-%.2sT%.2s:%.2s:%.2s%.*s%.3s:%.2s",
                       ts, ts + 4, ts + 6, ts + 8, ts + 10, ts + 12,
                       (int)(fraction_length < 6 ? fraction_length : 6), fraction, offset,
                       offset + 3);
    else
        (void)snprintf(ret, ISCHIA_MEASURED_AT_BYTES, "%.4s-%.2s-%.2s", ts, ts + 4, ts + 6);
    if (!text_is_date_or_time(ret)) ret[0] = '\0';
}

/* ---- pieces ---- */

__attribute__((format(printf, 2, 3))) static void put(struct text_out *out, const char *format, ...)
{
    char text[2048];
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (length < 0 || (size_t)length >= sizeof text)
        out->failed = true; /* a cut segment would be another message */
    else
        text_put(out, text, (size_t)length);
}

static void put_head(struct text_out *out, const struct hl7_sender *s, const char *type,
                     const char *processing_id)
{
    put(out, "MSH|^~\\&|%s|%s|%s|%s|%s||%s|%s|%s|" HL7_VERSION "||||||UNICODE UTF-8\r",
        s->application, s->facility, s->peer_application, s->peer_facility, s->time, type,
        s->control_id, processing_id);
}

/* ---- acknowledgements ---- */

/* HL7 table 0357 for the codes of faults. */
static const struct {
    const char *fault, *code, *text;
} error_codes[] = {
    {"missing", "101", "Required field missing"},
    {"duplicate", "205", "Duplicate key identifier"},
    {"unknown", "204", "Unknown key identifier"},
    {"not_allowed", "103", "Table value not found"},
    {"unsupported", "103", "Table value not found"},
    {"message_type", "200", "Unsupported message type"},
    {"processing_id", "202", "Unsupported processing id"},
    {"version", "203", "Unsupported version id"},
    {"memory", "207", "Application internal error"},
    {"queue_full", "207", "Application internal error"},
    {"internal", "207", "Application internal error"},
    {"framing", "100", "Segment sequence error"},
    {"", "102", "Data type error"},
};

static void put_error(struct text_out *out, const struct ischia_fault *fault)
{
    size_t i = 0;
    while (error_codes[i].fault[0] != '\0' && strcmp(error_codes[i].fault, fault->code) != 0) i++;
    put(out, "ERR||%s|%s^%s^HL70357|E|%s^^" HL7_SYSTEM "|||", fault->pointer, error_codes[i].code,
        error_codes[i].text, fault->code);
    hl7_put_text(out, fault->detail);
    text_put_string(out, "\r");
}

void hl7_put_ack(struct text_out *out, const struct hl7_sender *sender, const struct hl7_head *head,
                 enum hl7_ack ack, const struct doc_faults *faults)
{
    struct hl7_sender to = *sender;
    to.peer_application = head->application;
    to.peer_facility = head->facility;
    put_head(out, &to, "ACK^R01^ACK", head->processing_id[0] == '\0' ? "P" : head->processing_id);
    put(out, "MSA|%s|%s\r", hl7_ack_codes[ack], head->control_id);
    for (size_t i = 0; faults != NULL && i < faults->count; i++) put_error(out, &faults->item[i]);
}

/* ---- results ---- */

/* PID-3 as it came, else the pseudonymous subject. */
static void put_person(struct text_out *out, const struct record *record)
{
    text_put_string(out, "PID|1||");
    if (record->origin.pid[0] != '\0')
        text_put_string(out, record->origin.pid);
    else
        hl7_put_text(out, record->request.subject);
    text_put_string(out, "\r");
}

static void put_order(struct text_out *out, const struct record *record)
{
    static const char *const statuses[ASSESSMENT_STATUS_COUNT] = {
        [ASSESSMENT_QUEUED] = "S", [ASSESSMENT_RUNNING] = "I",   [ASSESSMENT_SUCCEEDED] = "F",
        [ASSESSMENT_FAILED] = "X", [ASSESSMENT_CANCELLED] = "X",
    };
    char measured[HL7_TIME_BYTES], finished[HL7_TIME_BYTES];
    const char *at = record->request.measured_at;
    hl7_time(at[0] != '\0' ? at : record->created_at, measured);
    hl7_time(record->finished_at, finished);
    put(out,
        "OBR|1|%s|%s^" HL7_FILLER "|tissue-strain^Tissue strain under one ischium^" HL7_SYSTEM
        "|||%s|||||||||||||||%s|||%s\r",
        record->origin.placer, record->id, measured, finished, statuses[record->status]);
}

static void put_text_observation(struct text_out *out, int *sequence, const char *code,
                                 const char *display, const char *text)
{
    put(out, "OBX|%d|ST|%s^%s^" HL7_SYSTEM "||", ++*sequence, code, display);
    hl7_put_text(out, text);
    text_put_string(out, "||||||F\r");
}

/* time: OBX-14, when it was measured; "": not said here. */
static void put_number(struct text_out *out, int *sequence, int measure, const char *digits,
                       const char *time)
{
    const struct measure m = measure_at(measure);
    put(out, "OBX|%d|NM|%s^%s^" HL7_SYSTEM "||%s|%s^^UCUM|||||F%s%s\r", ++*sequence, m.code,
        m.display, digits, m.unit, time[0] != '\0' ? "|||" : "", time);
}

static void put_notes(struct text_out *out, const struct record *record)
{
    struct ischia_fault warnings[ISCHIA_PARAM_COUNT];
    const size_t count = case_warnings(&record->request.values, LANGUAGE_EN, warnings);
    int sequence = 0;
    for (size_t i = 0; i < RISK_CAVEAT_COUNT + count; i++) {
        put(out, "NTE|%d|L|", ++sequence);
        hl7_put_text(out, i < RISK_CAVEAT_COUNT ? risk_caveat(i)
                                                : warnings[i - RISK_CAVEAT_COUNT].detail);
        text_put_string(out, "\r");
    }
}

static void put_result(struct text_out *out, const struct record *record, int *sequence)
{
    const struct risk *risk = &record->risk;
    put_text_observation(out, sequence, "band", "Damage thresholds crossed",
                         risk_bands[risk->band].name);
    put_text_observation(out, sequence, "headline", "In words", risk_headline(risk->band));
    for (int i = 0; i < risk->reason_count; i++)
        put_text_observation(out, sequence, "reason", "Why", risk->reason[i]);
}

void hl7_put_result(struct text_out *out, const struct hl7_sender *sender,
                    const struct record *record)
{
    char digits[TEXT_NUMBER_BYTES];
    int sequence = 0;
    put_head(out, sender, "ORU^R01^ORU_R01", "P");
    put_person(out, record);
    put_order(out, record);
    put_notes(out, record);
    if (record->request.side != ISCHIA_SIDE_NONE)
        put_text_observation(out, &sequence, "side", "Side",
                             ischia_side_names[record->request.side]);
    for (int i = 0; i < MEASURE_COUNT; i++)
        if (record_digits(record, i, digits)[0] != '\0')
            put_number(out, &sequence, i, record_digits(record, i, digits), "");
    if (record->status == ASSESSMENT_SUCCEEDED)
        put_result(out, record, &sequence);
    else
        put_text_observation(out, &sequence, "problem", "Why there is no result", record->problem);
}

/* "typical", or a number for each input that is not known exactly. */
static void put_deviations(struct text_out *out, int *sequence,
                           const struct ischia_request *request)
{
    char digits[TEXT_NUMBER_BYTES];
    if (request->sd_typical)
        put_text_observation(out, sequence, "sd", "Standard deviations", "typical");
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        if (!request->sd_typical)
            put(out, "OBX|%d|NM|sd.%s^Standard deviation^" HL7_SYSTEM "||%s|%s^^UCUM|||||F\r",
                ++*sequence, ischia_params[i].key, text_from_number(request->sd[i], digits),
                ischia_params[i].unit);
}

bool hl7_carries(const struct ischia_request *request)
{
    int p = 0;
    while (p + 1 < ISCHIA_PRESET_COUNT && strcmp(request->preset, ischia_presets[p].name) != 0) p++;
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++)
        if (request->values.option[i] != ischia_presets[p].option[i]) return false;
    return true;
}

void hl7_put_request(struct text_out *out, const struct hl7_sender *sender,
                     const struct ischia_request *request)
{
    char digits[TEXT_NUMBER_BYTES], time[HL7_TIME_BYTES];
    int sequence = 0;
    const char *resolution = ischia_resolution_names[request->values.resolution];
    hl7_time(request->measured_at, time);
    put_head(out, sender, "ORU^R01^ORU_R01", "P");
    text_put_string(out, "PID|1||");
    hl7_put_text(out, request->subject);
    put(out, "\rOBR|1|||tissue-strain^Tissue strain under one ischium^" HL7_SYSTEM "|||%s\r", time);
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        put_number(out, &sequence, i, text_from_number(request->values.param[i], digits), time);
    if (request->side != ISCHIA_SIDE_NONE)
        put_text_observation(out, &sequence, "side", "Side", ischia_side_names[request->side]);
    if (request->label[0] != '\0')
        put_text_observation(out, &sequence, "label", "Label", request->label);
    put_text_observation(out, &sequence, "resolution", "Resolution", resolution);
    put_text_observation(out, &sequence, "model", "Model", request->preset);
    if (request->has_sd) put_deviations(out, &sequence, request);
}
