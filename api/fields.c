/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/fields.h"

#include <limits.h>
#include <math.h>
#include <string.h>

static const void *at(const void *base, size_t offset) { return (const char *)base + offset; }
static void *at_mutable(void *base, size_t offset) { return (char *)base + offset; }

/* ---- writing: one function a kind ---- */

static void write_number(struct json_out *out, const struct field *f, const void *base)
{
    json_put_number(out, f->key, *(const double *)at(base, f->offset));
}

static void write_number_or_null(struct json_out *out, const struct field *f, const void *base)
{
    json_put_number_or_null(out, f->key, *(const double *)at(base, f->offset));
}

static void write_number_or_none(struct json_out *out, const struct field *f, const void *base)
{
    if (!isnan(*(const double *)at(base, f->offset))) write_number(out, f, base);
}

static void write_numbers(struct json_out *out, const struct field *f, const void *base)
{
    const double *values = at(base, f->offset);
    json_open_array(out, f->key);
    for (int i = 0; i < f->count; i++) json_put_number(out, NULL, values[i]);
    json_close_array(out);
}

static void write_constant(struct json_out *out, const struct field *f, const void *base)
{
    (void)base;
    json_put_number(out, f->key, f->constant);
}

static void write_integer(struct json_out *out, const struct field *f, const void *base)
{
    json_put_integer(out, f->key, *(const int *)at(base, f->offset));
}

static void write_bool(struct json_out *out, const struct field *f, const void *base)
{
    json_put_bool(out, f->key, *(const bool *)at(base, f->offset));
}

static void write_text(struct json_out *out, const struct field *f, const void *base)
{
    json_put_string(out, f->key, at(base, f->offset));
}

static void write_text_or_null(struct json_out *out, const struct field *f, const void *base)
{
    const char *text = at(base, f->offset);
    json_put_string(out, f->key, text[0] != '\0' ? text : NULL);
}

static void write_text_or_none(struct json_out *out, const struct field *f, const void *base)
{
    if (*(const char *)at(base, f->offset) != '\0') write_text(out, f, base);
}

static void write_word(struct json_out *out, const struct field *f, const void *base)
{
    json_put_string(out, f->key, f->words[*(const int *)at(base, f->offset)]);
}

static void write_word_or_null(struct json_out *out, const struct field *f, const void *base)
{
    const int word = *(const int *)at(base, f->offset);
    json_put_string(out, f->key, word != 0 ? f->words[word] : NULL);
}

static void write_object(struct json_out *out, const struct field *f, const void *base)
{
    if (f->present != NULL && !f->present(base)) {
        json_put_null(out, f->key);
        return;
    }
    json_open_object(out, f->key);
    fields_write(out, f->fields, at(base, f->offset));
    json_close_object(out);
}

static void write_list(struct json_out *out, const struct field *f, const void *base)
{
    const int length = *(const int *)at(base, f->length_offset);
    json_open_array(out, f->key);
    for (int i = 0; i < length; i++) {
        json_open_object(out, NULL);
        fields_write(out, f->fields, at(base, f->offset + (size_t)i * f->size));
        json_close_object(out);
    }
    json_close_array(out);
}

static void write_custom(struct json_out *out, const struct field *f, const void *base)
{
    f->custom_write(out, f->key, base);
}

/* ---- reading: false when the value is of the wrong kind ---- */

struct place { /* where faults inside a value are reported */
    const char *pointer;
    struct doc_faults *faults;
};

static bool read_number(const struct json *v, const struct field *f, void *base, struct place p)
{
    (void)p;
    if (json_type_of(v) != JSON_NUMBER || !isfinite(json_number(v))) return false;
    *(double *)at_mutable(base, f->offset) = json_number(v);
    return true;
}

static bool read_number_or_null(const struct json *v, const struct field *f, void *base,
                                struct place p)
{
    if (json_type_of(v) != JSON_NULL) return read_number(v, f, base, p);
    *(double *)at_mutable(base, f->offset) = (double)NAN;
    return true;
}

static bool read_numbers(const struct json *v, const struct field *f, void *base, struct place p)
{
    struct field element = *f;
    if (json_type_of(v) != JSON_ARRAY || json_count(v) != (size_t)f->count) return false;
    for (const struct json *m = json_first(v); m != NULL; m = json_next(m)) {
        if (!read_number(m, &element, base, p)) return false;
        element.offset += sizeof(double);
    }
    return true;
}

static bool read_nothing(const struct json *v, const struct field *f, void *base, struct place p)
{
    (void)v, (void)f, (void)base, (void)p;
    return true;
}

static bool read_integer(const struct json *v, const struct field *f, void *base, struct place p)
{
    (void)p;
    if (json_type_of(v) != JSON_NUMBER) return false;
    const double number = json_number(v);
    if (!(number >= INT_MIN && number <= INT_MAX) || number != trunc(number)) return false;
    *(int *)at_mutable(base, f->offset) = (int)number;
    return true;
}

static bool read_bool(const struct json *v, const struct field *f, void *base, struct place p)
{
    (void)p;
    if (json_type_of(v) != JSON_BOOL) return false;
    *(bool *)at_mutable(base, f->offset) = json_bool(v);
    return true;
}

static bool read_text(const struct json *v, const struct field *f, void *base, struct place p)
{
    (void)p;
    if (json_type_of(v) != JSON_STRING) return false;
    const size_t length = strlen(json_string(v));
    if (length >= f->size) return false;
    memcpy(at_mutable(base, f->offset), json_string(v), length + 1);
    return true;
}

static bool read_text_or_null(const struct json *v, const struct field *f, void *base,
                              struct place p)
{
    if (json_type_of(v) != JSON_NULL) return read_text(v, f, base, p);
    *(char *)at_mutable(base, f->offset) = '\0';
    return true;
}

static bool read_word(const struct json *v, const struct field *f, void *base, struct place p)
{
    (void)p;
    if (json_type_of(v) != JSON_STRING) return false;
    for (int i = 0; i < f->count; i++)
        if (strcmp(f->words[i], json_string(v)) == 0) {
            *(int *)at_mutable(base, f->offset) = i;
            return true;
        }
    return false;
}

static bool read_word_or_null(const struct json *v, const struct field *f, void *base,
                              struct place p)
{
    if (json_type_of(v) != JSON_NULL) return read_word(v, f, base, p);
    *(int *)at_mutable(base, f->offset) = 0;
    return true;
}

static bool read_object(const struct json *v, const struct field *f, void *base, struct place p)
{
    const bool present = json_type_of(v) != JSON_NULL;
    if (present && json_type_of(v) != JSON_OBJECT) return false;
    if (!present && f->present == NULL) return false;
    if (f->set_present != NULL) f->set_present(base, present);
    if (present) fields_read(v, f->fields, at_mutable(base, f->offset), p.pointer, p.faults);
    return true;
}

static bool read_list(const struct json *v, const struct field *f, void *base, struct place p)
{
    int length = 0;
    if (json_type_of(v) != JSON_ARRAY || json_count(v) > (size_t)f->count) return false;
    for (const struct json *m = json_first(v); m != NULL; m = json_next(m), length++) {
        void *element = at_mutable(base, f->offset + (size_t)length * f->size);
        if (json_type_of(m) != JSON_OBJECT) return false;
        fields_read(m, f->fields, element, p.pointer, p.faults);
    }
    *(int *)at_mutable(base, f->length_offset) = length;
    return true;
}

static bool read_custom(const struct json *v, const struct field *f, void *base, struct place p)
{
    (void)p;
    return f->custom_read == NULL || f->custom_read(v, base);
}

/* ---- the kinds ---- */

static const struct kind {
    void (*write)(struct json_out *out, const struct field *f, const void *base);
    bool (*read)(const struct json *v, const struct field *f, void *base, struct place p);
} kinds[] = {
    [FIELD_NUMBER] = {write_number, read_number},
    [FIELD_NUMBER_OR_NULL] = {write_number_or_null, read_number_or_null},
    [FIELD_NUMBER_OR_NONE] = {write_number_or_none, read_number},
    [FIELD_NUMBERS] = {write_numbers, read_numbers},
    [FIELD_CONSTANT] = {write_constant, read_nothing},
    [FIELD_INTEGER] = {write_integer, read_integer},
    [FIELD_BOOL] = {write_bool, read_bool},
    [FIELD_TEXT] = {write_text, read_text},
    [FIELD_TEXT_OR_NULL] = {write_text_or_null, read_text_or_null},
    [FIELD_TEXT_OR_NONE] = {write_text_or_none, read_text},
    [FIELD_WORD] = {write_word, read_word},
    [FIELD_WORD_OR_NULL] = {write_word_or_null, read_word_or_null},
    [FIELD_OBJECT] = {write_object, read_object},
    [FIELD_LIST] = {write_list, read_list},
    [FIELD_CUSTOM] = {write_custom, read_custom},
};

void fields_write(struct json_out *out, const struct field *fields, const void *base)
{
    for (const struct field *f = fields; f->key != NULL; f++) kinds[f->kind].write(out, f, base);
}

static bool may_be_missing(const struct field *f)
{
    return f->optional || f->kind == FIELD_NUMBER_OR_NONE || f->kind == FIELD_TEXT_OR_NONE;
}

void fields_read(const struct json *object, const struct field *fields, void *ret_base,
                 const char *pointer, struct doc_faults *faults)
{
    char path[DOC_POINTER_BYTES];
    for (const struct field *f = fields; f->key != NULL; f++) {
        const struct json *value = json_member(object, f->key);
        (void)doc_pointer(path, sizeof path, pointer, f->key);
        if (value == NULL) {
            if (!may_be_missing(f))
                doc_faults_add(faults, path, "missing", "%s is missing", f->key);
            continue;
        }
        if (!kinds[f->kind].read(value, f, ret_base, (struct place){path, faults}))
            doc_faults_add(faults, path, "wrong_type", "%s is not of the expected kind", f->key);
    }
}
