/* SPDX-License-Identifier: GPL-3.0-or-later */
/* ORU^R01 with the seven inputs: OBX by OBX into the fields that a form fills. */
#include <stdio.h>
#include <string.h>

#include "api/case_places.h"
#include "api/fhir_date.h"
#include "api/hl7.h"
#include "api/measure.h"
#include "api/ucum.h"

const char *const hl7_ack_codes[HL7_ACK_COUNT] = {"AA", "AE", "AR"};

struct reader {
    struct hl7 *m;
    struct hl7_input *input;
    struct case_places places;
    struct doc_faults *faults;
    int sequence; /* of OBX segments, from 1 */
    bool has_person, has_placer;
};

/* ---- the head ---- */

static void read_head(const struct hl7 *m, struct hl7_head *ret)
{
    (void)hl7_raw(m, 0, 3, ret->application, sizeof ret->application);
    (void)hl7_raw(m, 0, 4, ret->facility, sizeof ret->facility);
    (void)hl7_raw(m, 0, 10, ret->control_id, sizeof ret->control_id);
    (void)hl7_get(m, 0, 11, 1, ret->processing_id, sizeof ret->processing_id);
}

/* A message that is not for us: says why in a fault and returns false. */
static bool head_is_ours(const struct reader *r, const char *own_application)
{
    const struct hl7 *m = r->m;
    const struct hl7_head *head = &r->input->head;
    char type[16] = "", event[16] = "", version[16] = "", sender[HL7_FIELD_BYTES] = "";
    const bool read =
        hl7_get(m, 0, 9, 1, type, sizeof type) && hl7_get(m, 0, 9, 2, event, sizeof event) &&
        hl7_get(m, 0, 12, 1, version, sizeof version) && hl7_get(m, 0, 3, 1, sender, sizeof sender);
    if (head->control_id[0] == '\0')
        doc_faults_add(r->faults, "MSH^1^10", "missing", "MSH-10 (control id) is missing");
    else if (!read || strcmp(type, "ORU") != 0 || strcmp(event, "R01") != 0)
        doc_faults_add(r->faults, "MSH^1^9", "message_type", "only ORU^R01 is taken");
    else if (strncmp(version, "2.", 2) != 0 || version[2] < '3' || version[2] > '8')
        doc_faults_add(r->faults, "MSH^1^12", "version", "only versions 2.3 to 2.8 are taken");
    else if (strcmp(head->processing_id, "P") != 0 && strcmp(head->processing_id, "T") != 0 &&
             strcmp(head->processing_id, "D") != 0)
        doc_faults_add(r->faults, "MSH^1^11", "processing_id", "MSH-11 is not P, T or D");
    else if (strcmp(sender, own_application) == 0)
        doc_faults_add(r->faults, "MSH^1^3", "own_message",
                       "this message says that it is our own; it is not assessed again");
    else
        return true;
    return false;
}

/* ---- the person and the order ---- */

static void read_person(struct reader *r, int segment)
{
    struct origin *origin = &r->input->origin;
    if (r->has_person) doc_faults_add(r->faults, "PID", "duplicate", "there is more than one PID");
    r->has_person = true;
    if (!hl7_raw(r->m, segment, 3, origin->pid, sizeof origin->pid))
        doc_faults_add(r->faults, "PID^1^3", "malformed", "PID-3 cannot be kept as it is");
}

static void read_order(struct reader *r, int segment)
{
    struct origin *origin = &r->input->origin;
    char filler[HL7_FIELD_BYTES];
    /* A system that passes our results on under its own name must not have them solved again. */
    if (hl7_get(r->m, segment, 3, 2, filler, sizeof filler) && strcmp(filler, HL7_FILLER) == 0)
        doc_faults_add(r->faults, "OBR^1^3", "own_message", "these are results of this service");
    if (r->has_placer) return; /* other orders of the message are not ours */
    if (!hl7_raw(r->m, segment, 2, origin->placer, sizeof origin->placer))
        doc_faults_add(r->faults, "OBR^1^2", "malformed", "OBR-2 cannot be kept as it is");
}

/* ---- the numbers ---- */

/* HL7's NM may be "+7.10", "07.1", ".5" or "7."; JSON's number may not. "" when it is neither. */
static void plain_number(const char *nm, char ret[ORIGIN_DIGITS_BYTES])
{
    const char *sign = nm[0] == '-' ? "-" : "";
    ret[0] = '\0';
    if (nm[0] == '+' || nm[0] == '-') nm++;
    while (nm[0] == '0' && nm[1] >= '0' && nm[1] <= '9') nm++;
    const size_t whole = strspn(nm, "0123456789");
    const bool point = nm[whole] == '.';
    const size_t fraction = point ? strspn(nm + whole + 1, "0123456789") : 0;
    const size_t length = whole + (point ? 1 + fraction : 0);
    if (whole + fraction == 0 || nm[length] != '\0' || length + 3 > TEXT_NUMBER_LENGTH_MAX) return;
    (void)snprintf(ret, ORIGIN_DIGITS_BYTES, "%s%s%.*s%s%.*s", sign, whole == 0 ? "0" : "",
                   (int)whole, nm, fraction > 0 ? "." : "", (int)fraction,
                   fraction > 0 ? nm + whole + 1 : "");
}

/* A fault at field `field` of the OBX under way. */
#define OBX_FAULT(r, field, code, ...)                                                             \
    do {                                                                                           \
        char where_[DOC_POINTER_BYTES];                                                            \
        (void)snprintf(where_, sizeof where_, "OBX^%d^%d", (r)->sequence, (field));                \
        doc_faults_add((r)->faults, where_, (code), __VA_ARGS__);                                  \
    } while (0)

static bool has_result(struct reader *r, int segment)
{
    char status[8];
    const bool read = hl7_get(r->m, segment, 11, 1, status, sizeof status);
    if (hl7_repeats(r->m, segment, 5)) {
        OBX_FAULT(r, 5, "duplicate", "OBX-5 repeats: one value a segment");
        return false;
    }
    if (read && strlen(status) == 1 && strchr("FCP", status[0]) != NULL) return true;
    OBX_FAULT(r, 11, "not_allowed", "OBX-11 is not F, C or P: there is no result to use");
    return false;
}

static bool read_unit(struct reader *r, int segment, char *ret, size_t size)
{
    char system[16];
    if (!hl7_get(r->m, segment, 6, 1, ret, size) || ret[0] == '\0')
        OBX_FAULT(r, 6, "missing", "units are never assumed: give OBX-6 as UCUM, such as mm^^UCUM");
    else if (!hl7_get(r->m, segment, 6, 3, system, sizeof system) ||
             (system[0] != '\0' && strcmp(system, "UCUM") != 0))
        OBX_FAULT(r, 6, "unsupported", "the coding system of OBX-6 is not UCUM");
    else
        return true;
    return false;
}

/* What an OBX that is a number says. */
struct number {
    char digits[ORIGIN_DIGITS_BYTES], unit[24];
    char converted[UCUM_DIGITS_BYTES]; /* to the unit of the input */
};

/* False with a fault. key: of the input, or of its standard deviation. */
static bool take_number(struct reader *r, int segment, int param, const char *key,
                        struct number *ret)
{
    char type[8], value[ORIGIN_DIGITS_BYTES], known[96];
    const char *unit = ischia_params[param].unit;
    if (!has_result(r, segment) || !read_unit(r, segment, ret->unit, sizeof ret->unit))
        return false;
    const bool read = hl7_get(r->m, segment, 2, 1, type, sizeof type) &&
                      hl7_get(r->m, segment, 5, 1, value, sizeof value);
    plain_number(read ? value : "", ret->digits);
    if (!read || strcmp(type, "NM") != 0 || ret->digits[0] == '\0') {
        OBX_FAULT(r, 5, "wrong_type", "%s is not a number (OBX-2 NM)", key);
        return false;
    }
    if (ucum_convert(ret->digits, ret->unit, unit, ret->converted) != UCUM_CONVERTED) {
        OBX_FAULT(r, 6, "unsupported", "%s is in '%s'; accepted %s", key, ret->unit,
                  ucum_known(unit, known, sizeof known));
        return false;
    }
    return true;
}

static bool read_number(struct reader *r, int segment, int param, const char *key,
                        struct number *ret)
{
    char where[DOC_POINTER_BYTES];
    (void)snprintf(where, sizeof where, "OBX^%d^5", r->sequence);
    const bool taken = take_number(r, segment, param, key, ret);
    if (taken)
        case_places_set(&r->places, key, ret->converted, where);
    else
        case_places_refuse(&r->places, key, where);
    return taken;
}

/* An input is given back with the digits that it came with. */
static void read_input(struct reader *r, int segment, int param)
{
    struct number number;
    if (read_number(r, segment, param, ischia_params[param].key, &number) &&
        strcmp(number.unit, ischia_params[param].unit) == 0)
        (void)snprintf(r->input->origin.digits[param], ORIGIN_DIGITS_BYTES, "%s", number.digits);
}

/* True for "sd.R1" and so on, which are then read. */
static bool read_deviation(struct reader *r, int segment, const char *code)
{
    static const char prefix[] = "sd.";
    struct number number;
    const size_t length = sizeof prefix - 1;
    const int param = strncmp(code, prefix, length) == 0 ? measure_find(code + length) : -1;
    if (param < 0 || !measure_is_input(param)) return false;
    (void)read_number(r, segment, param, code, &number);
    return true;
}

/* The time of the observation: the latest of those that say a day. */
static void take_time(struct reader *r, int segment)
{
    char ts[HL7_TIME_BYTES], time[ISCHIA_MEASURED_AT_BYTES];
    char *known = r->input->request.measured_at;
    if (!hl7_get(r->m, segment, 14, 1, ts, sizeof ts)) return;
    hl7_time_read(ts, time);
    if (fhir_date_is_after(time, known))
        (void)snprintf(known, ISCHIA_MEASURED_AT_BYTES, "%s", time);
}

static void read_text(struct reader *r, int segment, const char *key)
{
    char value[ISCHIA_LABEL_BYTES + 1], where[DOC_POINTER_BYTES];
    (void)snprintf(where, sizeof where, "OBX^%d^5", r->sequence);
    if (!has_result(r, segment)) return;
    if (hl7_get(r->m, segment, 5, 1, value, sizeof value))
        case_places_set(&r->places, key, value, where);
    else
        OBX_FAULT(r, 5, "malformed", "the value of %s is too long or has an unknown escape", key);
}

static void read_observation(struct reader *r, int segment)
{
    static const char *const texts[] = {"side", "label", "resolution", "model", "sd"};
    char code[24], system[16];
    r->sequence++;
    if (!hl7_get(r->m, segment, 3, 3, system, sizeof system) || strcmp(system, HL7_SYSTEM) != 0)
        return; /* something else that was measured */
    r->has_placer = true;
    if (!hl7_get(r->m, segment, 3, 1, code, sizeof code)) code[0] = '\0';
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        if (strcmp(texts[i], code) != 0) continue;
        read_text(r, segment, texts[i]);
        return;
    }
    if (read_deviation(r, segment, code)) return;
    const int measure = measure_find(code);
    if (measure < 0) {
        OBX_FAULT(r, 3, "unknown", "'%s' is not a code of " HL7_SYSTEM, code);
        return;
    }
    if (!measure_is_input(measure)) return; /* results of ours are not inputs */
    take_time(r, segment);
    read_input(r, segment, measure);
}

/* ---- the whole ---- */

static void read_segments(struct reader *r)
{
    static const struct {
        const char *name;
        void (*read)(struct reader *r, int segment);
    } readers[] = {{"PID", read_person}, {"OBR", read_order}, {"OBX", read_observation}};
    for (int s = 1; s < r->m->count; s++) {
        if (hl7_is(r->m, s, "MSH"))
            doc_faults_add(r->faults, "MSH", "duplicate", "there is more than one MSH");
        for (size_t i = 0; i < sizeof readers / sizeof readers[0]; i++)
            if (hl7_is(r->m, s, readers[i].name)) readers[i].read(r, s);
    }
    case_places_end(&r->places, r->faults, "OBX", NULL);
}

enum hl7_ack hl7_read(struct hl7_input *ret, const char *bytes, size_t length,
                      const char *own_application, struct doc_faults *faults)
{
    struct reader r;
    struct ischia_error err;
    memset(ret, 0, sizeof *ret);
    memset(&r, 0, sizeof r);
    r.input = ret;
    r.faults = faults;
    case_places_init(&r.places, &ret->request);
    const enum ischia_code code = hl7_parse(&r.m, bytes, length, &err);
    if (code != ISCHIA_OK) {
        doc_faults_add(faults, "MSH", code == ISCHIA_E_MEMORY ? "memory" : "malformed", "%s",
                       err.message);
        return HL7_REJECTED;
    }
    enum hl7_ack ack = HL7_REJECTED;
    read_head(r.m, &ret->head);
    if (head_is_ours(&r, own_application)) {
        read_segments(&r);
        ack = faults->count == 0 ? HL7_ACCEPTED : HL7_ERROR;
    }
    hl7_destroy(r.m);
    return ack;
}
