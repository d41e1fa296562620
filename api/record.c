/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/record.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "api/fields.h"
#include "api/measure.h"

#define TEXT(name_, member_, bytes_)                                                               \
    {                                                                                              \
        .key = (name_), .kind = FIELD_TEXT_OR_NONE, .offset = offsetof(struct origin, member_),    \
        .size = (bytes_)                                                                           \
    }
#define DIGITS(name_, param_)                                                                      \
    {                                                                                              \
        .key = (name_), .kind = FIELD_TEXT_OR_NONE,                                                \
        .offset = offsetof(struct origin, digits) + (size_t)(param_)*ORIGIN_DIGITS_BYTES,          \
        .size = ORIGIN_DIGITS_BYTES                                                                \
    }
static const struct field origin_fields[] = {
    TEXT("reference", reference, ORIGIN_TEXT_BYTES),
    TEXT("identifier_system", identifier_system, ORIGIN_TEXT_BYTES),
    TEXT("identifier_value", identifier_value, ORIGIN_TEXT_BYTES),
    TEXT("pid", pid, ORIGIN_TEXT_BYTES),
    TEXT("placer", placer, ORIGIN_TEXT_BYTES),
    DIGITS("R1", ISCHIA_R1),
    DIGITS("R2", ISCHIA_R2),
    DIGITS("eM", ISCHIA_EM),
    DIGITS("eF", ISCHIA_EF),
    DIGITS("muM", ISCHIA_MUM),
    DIGITS("muF", ISCHIA_MUF),
    DIGITS("F", ISCHIA_F),
    {.key = NULL},
};

bool origin_is_given(const struct origin *origin)
{
    for (const struct field *f = origin_fields; f->key != NULL; f++)
        if (*((const char *)origin + f->offset) != '\0') return true;
    return false;
}

enum ischia_code origin_text(char **ret_text, const struct origin *origin, struct ischia_error *err)
{
    struct json_out out;
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    fields_write(&out, origin_fields, origin);
    json_close_object(&out);
    return json_out_take(&out, ret_text, NULL, err);
}

enum ischia_code origin_read(struct origin *ret, const char *json, struct ischia_error *err)
{
    struct origin origin;
    struct doc_faults faults;
    struct json *root;
    memset(&origin, 0, sizeof origin);
    doc_faults_init(&faults);
    TRY(json_parse(&root, json, strlen(json), &json_limits_stored, &faults, err));
    fields_read(root, origin_fields, &origin, "", &faults);
    json_destroy(root);
    CHECK(faults.count == 0, err, ISCHIA_E_INPUT, "not an origin: %s", faults.item[0].detail);
    *ret = origin;
    return ISCHIA_OK;
}

const char *record_digits(const struct record *record, int measure, char buffer[TEXT_NUMBER_BYTES])
{
    const struct ischia_case *c = &record->request.values;
    if (measure_is_input(measure)) {
        const char *digits = record->origin.digits[measure];
        /* Digits and the stored number are two copies of one value: never show two values. */
        if (digits[0] != '\0' && strtod(digits, NULL) == c->param[measure]) return digits;
    } else if (record->status != ASSESSMENT_SUCCEEDED) {
        return "";
    }
    const double value = measure_value(measure, c, &record->result,
                                       record->has_uncertainty ? &record->uncertainty : NULL);
    return isnan(value) ? "" : text_from_number(value, buffer);
}

const char *record_site(const struct record *record)
{
    static const char *const sites[ISCHIA_SIDE_COUNT] = {
        [ISCHIA_SIDE_NONE] = "ischial tuberosity",
        [ISCHIA_SIDE_LEFT] = "left ischial tuberosity",
        [ISCHIA_SIDE_RIGHT] = "right ischial tuberosity",
    };
    return sites[record->request.side];
}
