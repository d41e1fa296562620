/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/case_doc.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/case_keys.h"

/* ---- JSON ---- */

static const enum word type_words[JSON_TYPE_COUNT] = {
    [JSON_NULL] = WORD_DAEMON_JSON_NULL,     [JSON_BOOL] = WORD_DAEMON_JSON_BOOL,
    [JSON_NUMBER] = WORD_DAEMON_JSON_NUMBER, [JSON_STRING] = WORD_DAEMON_JSON_STRING,
    [JSON_ARRAY] = WORD_DAEMON_JSON_ARRAY,   [JSON_OBJECT] = WORD_DAEMON_JSON_OBJECT,
};

/* How a value of the wrong kind is named in a fault: "\"8.0\"", "an array", ... */
static const char *describe(enum language language, const struct json *value, char *buffer,
                            size_t size)
{
    char shown[28];
    const enum json_type type = json_type_of(value);
    if (type != JSON_STRING && type != JSON_NUMBER) return words_get(language, type_words[type]);
    if (type == JSON_NUMBER)
        (void)snprintf(buffer, size, "%g", json_number(value));
    else
        (void)snprintf(buffer, size, "\"%s\"",
                       text_printable(json_string(value), shown, sizeof shown));
    return buffer;
}

static void refuse_type(struct case_doc_fields *fields, int key, const struct json *value)
{
    char given[TEXT_NUMBER_BYTES];
    case_key_refuse(fields, key, "wrong_type",
                    describe(fields->faults->language, value, given, sizeof given));
}

static void read_number(struct case_doc_fields *fields, int key, const struct json *value)
{
    if (json_type_of(value) == JSON_NUMBER)
        case_key_set_number(fields, key, json_number(value));
    else
        refuse_type(fields, key, value);
}

/* The texts about the side may be null, as they are in the documents we write. */
static void read_text(struct case_doc_fields *fields, int key, const struct json *value)
{
    if (json_type_of(value) == JSON_STRING)
        case_key_set_text(fields, key, json_string(value));
    else if (json_type_of(value) != JSON_NULL)
        refuse_type(fields, key, value);
}

static void read_option(struct case_doc_fields *fields, const char *group,
                        const struct json *member)
{
    char name[64], pointer[DOC_POINTER_BYTES], parent[16];
    (void)snprintf(name, sizeof name, "%s.%s", group, json_key(member));
    (void)snprintf(parent, sizeof parent, "/%s", group);
    const int key = case_key_find(name);
    if (key >= KEY_FIRST_OPTION) {
        if (case_key_first_time(fields, key, name)) read_number(fields, key, member);
        return;
    }
    (void)doc_pointer(pointer, sizeof pointer, parent, json_key(member));
    case_key_unknown(fields, pointer, name);
}

static void read_group(struct case_doc_fields *fields, int key, const struct json *value)
{
    const char *group = case_key_name(key);
    for (const struct json *m = json_first(value); m != NULL; m = json_next(m)) {
        if (key == KEY_MODEL && strcmp(json_key(m), "name") == 0)
            read_text(fields, KEY_MODEL, m);
        else
            read_option(fields, group, m);
    }
}

static void read_model(struct case_doc_fields *fields, int key, const struct json *value)
{
    if (json_type_of(value) == JSON_OBJECT)
        read_group(fields, key, value);
    else if (json_type_of(value) == JSON_STRING)
        case_key_set_text(fields, key, json_string(value));
    else
        refuse_type(fields, key, value);
}

static void read_skin(struct case_doc_fields *fields, int key, const struct json *value)
{
    if (json_type_of(value) == JSON_OBJECT)
        read_group(fields, key, value);
    else
        refuse_type(fields, key, value);
}

static void read_one_sd(struct case_doc_fields *fields, const struct json *member)
{
    char pointer[DOC_POINTER_BYTES], name[64];
    const int input = case_key_find(json_key(member));
    if (input == KEY_NONE || input >= ISCHIA_PARAM_COUNT) {
        (void)doc_pointer(pointer, sizeof pointer, "/sd", json_key(member));
        case_key_unknown(fields, pointer, json_key(member));
        return;
    }
    (void)snprintf(name, sizeof name, "sd.%s", json_key(member));
    if (case_key_first_time(fields, KEY_FIRST_SD + input, name))
        read_number(fields, KEY_FIRST_SD + input, member);
}

/* "typical", or an object with a number for each input that is not known exactly. */
static void read_sd(struct case_doc_fields *fields, int key, const struct json *value)
{
    if (json_type_of(value) != JSON_OBJECT) {
        read_text(fields, key, value);
        return;
    }
    fields->request->has_sd = true;
    for (const struct json *m = json_first(value); m != NULL; m = json_next(m))
        read_one_sd(fields, m);
}

static void (*const readers[KEY_FIRST_OPTION])(struct case_doc_fields *, int,
                                               const struct json *) = {
    [ISCHIA_R1] = read_number,     [ISCHIA_R2] = read_number,  [ISCHIA_EM] = read_number,
    [ISCHIA_EF] = read_number,     [ISCHIA_MUM] = read_number, [ISCHIA_MUF] = read_number,
    [ISCHIA_F] = read_number,      [KEY_SUBJECT] = read_text,  [KEY_SIDE] = read_text,
    [KEY_MEASURED_AT] = read_text, [KEY_LABEL] = read_text,    [KEY_RESOLUTION] = read_text,
    [KEY_MODEL] = read_model,      [KEY_SKIN] = read_skin,     [KEY_SD] = read_sd,
};

static void read_member(struct case_doc_fields *fields, const struct json *member)
{
    char pointer[DOC_POINTER_BYTES];
    const char *spelling = json_key(member);
    const int key = case_key_find(spelling);
    if (key == KEY_NONE || key >= KEY_FIRST_OPTION) { /* "skin.mu" is for forms, not for JSON */
        (void)doc_pointer(pointer, sizeof pointer, "", spelling);
        case_key_unknown(fields, pointer, spelling);
    } else if (case_key_first_time(fields, key, spelling)) {
        readers[key](fields, key, member);
    }
}

void case_doc_read_value_over(struct ischia_request *ret, const struct case_doc_defaults *defaults,
                              const struct json *value, struct doc_faults *faults)
{
    struct case_doc_fields fields;
    case_doc_fields_init(&fields, ret, faults);
    case_doc_fields_set_defaults(&fields, defaults);
    if (value != NULL && json_type_of(value) != JSON_OBJECT) {
        doc_faults_say(faults, "", "wrong_type", WORD_DAEMON_FAULT_DOCUMENT,
                       WORDS(word_text(
                           "given", words_get(faults->language, type_words[json_type_of(value)]))));
        return;
    }
    for (const struct json *m = json_first(value); m != NULL; m = json_next(m))
        read_member(&fields, m);
    case_doc_fields_end(&fields);
}

void case_doc_read_value(struct ischia_request *ret, const struct json *value,
                         struct doc_faults *faults)
{
    case_doc_read_value_over(ret, &(struct case_doc_defaults){NULL, NULL}, value, faults);
}

enum ischia_code case_doc_read(struct ischia_request *ret, const char *json, size_t length,
                               const struct json_limits *limits, struct doc_faults *faults,
                               struct ischia_error *err)
{
    struct json *root;
    ischia_request_init(ret);
    TRY(json_parse(&root, json, length, limits, faults, err));
    case_doc_read_value(ret, root, faults);
    json_destroy(root);
    return ISCHIA_OK;
}

/* ---- application/x-www-form-urlencoded ---- */

static int hex_value(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* Decodes in place; false when an escape is broken or makes a NUL, or the text is not UTF-8. */
static bool decode(char *text)
{
    char *to = text;
    for (const char *from = text; *from != '\0'; from++) {
        if (*from != '%') {
            *to++ = *from == '+' ? ' ' : *from;
            continue;
        }
        const int high = hex_value(from[1]);
        const int low = high >= 0 ? hex_value(from[2]) : -1;
        if (low < 0 || high + low == 0) return false;
        *to++ = (char)(16 * high + low);
        from += 2;
    }
    *to = '\0';
    return text_is_utf8(text, (size_t)(to - text));
}

/* One "key=value", which is cut up in place. */
static bool read_pair(struct case_doc_fields *fields, char *pair)
{
    static char nothing[1];
    char *value = strchr(pair, '=');
    if (value != NULL) *value++ = '\0';
    if (value == NULL) value = nothing;
    if (!decode(pair) || !decode(value)) return false;
    if (pair[0] != '\0') case_doc_fields_set(fields, pair, value);
    return true;
}

static enum ischia_code read_pairs(struct case_doc_fields *fields, char *body,
                                   struct ischia_error *err)
{
    int number = 0;
    for (char *pair = body, *rest; pair != NULL; pair = rest) {
        rest = strchr(pair, '&');
        if (rest != NULL) *rest++ = '\0';
        number++;
        if (!read_pair(fields, pair))
            return FAIL(err, ISCHIA_E_INPUT,
                        "not a form: field %d has a broken %%-escape or is not valid UTF-8",
                        number);
    }
    case_doc_fields_end(fields);
    return ISCHIA_OK;
}

enum ischia_code case_doc_read_form(struct ischia_request *ret, const char *body, size_t length,
                                    size_t bytes_max, struct doc_faults *faults,
                                    struct ischia_error *err)
{
    struct case_doc_fields fields;
    case_doc_fields_init(&fields, ret, faults);
    fields.typed = true;
    CHECK(length <= bytes_max, err, ISCHIA_E_LIMIT, "the form is larger than the accepted %zu KiB",
          bytes_max / 1024);
    if (length == 0) body = "";
    CHECK(memchr(body, '\0', length) == NULL, err, ISCHIA_E_INPUT,
          "not a form: it holds a NUL byte");
    char *copy = strndup(body, length);
    CHECK(copy != NULL, err, ISCHIA_E_MEMORY, "out of memory while reading a form");
    const enum ischia_code code = read_pairs(&fields, copy, err);
    free(copy);
    return code;
}

/* ---- writing ---- */

void case_doc_write_parameters(struct json_out *out, const struct ischia_case *c)
{
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        json_put_number(out, ischia_params[i].key, c->param[i]);
}

static void write_group(struct json_out *out, const char *group, const struct ischia_case *c)
{
    for (int i = 0; i < ISCHIA_OPTION_COUNT; i++)
        if (strcmp(ischia_options[i].group, group) == 0)
            json_put_number(out, ischia_options[i].key, c->option[i]);
}

void case_doc_write_options(struct json_out *out, const struct ischia_request *request)
{
    const struct ischia_case *c = &request->values;
    json_open_object(out, "skin");
    write_group(out, "skin", c);
    json_close_object(out);
    json_put_string(out, "resolution", ischia_resolution_names[c->resolution]);
    json_open_object(out, "model");
    json_put_string(out, "name", request->preset);
    write_group(out, "model", c);
    json_close_object(out);
}

/* Of an object every input, so that what is kept can be read without knowing what 0 means. */
void case_doc_write_sd(struct json_out *out, const struct ischia_request *request)
{
    if (!request->has_sd) return;
    if (request->sd_typical) {
        json_put_string(out, "sd", "typical");
        return;
    }
    json_open_object(out, "sd");
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++)
        json_put_number(out, ischia_params[i].key, request->sd[i]);
    json_close_object(out);
}

void case_doc_write(struct json_out *out, const struct ischia_request *request)
{
    const struct {
        const char *key, *value;
    } texts[] = {
        {"subject", request->subject},
        {"side", ischia_side_names[request->side]},
        {"label", request->label},
        {"measured_at", request->measured_at},
    };
    case_doc_write_parameters(out, &request->values);
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        if (texts[i].value[0] != '\0') json_put_string(out, texts[i].key, texts[i].value);
    case_doc_write_sd(out, request);
    case_doc_write_options(out, request);
}
