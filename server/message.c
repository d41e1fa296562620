/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/message.h"

#include <stddef.h>
#include <string.h>

#include "api/json.h"

/* ----------------------------------------------------------------- the table of messages */

enum member_kind { MEMBER_NUMBER, MEMBER_INTEGER, MEMBER_TEXT, MEMBER_CASE };

struct member {
    const char *key; /* NULL at the end */
    enum member_kind kind;
    size_t offset;
    double min, max; /* of numbers */
};

#define AT(name) offsetof(struct message, name)
#define INTEGER(name)                                                                              \
    {                                                                                              \
#name, MEMBER_INTEGER, AT(name), 0.0, 1e9                                                  \
    }
#define JOB                                                                                        \
    {                                                                                              \
        "job", MEMBER_INTEGER, AT(job), 1.0, MESSAGE_JOB_MAX                                       \
    }
#define TEXT(key, name)                                                                            \
    {                                                                                              \
        key, MEMBER_TEXT, AT(name), 0.0, 0.0                                                       \
    }
#define CASE                                                                                       \
    {                                                                                              \
        "case", MEMBER_CASE, AT(case_json), 0.0, 0.0                                               \
    }
#define END                                                                                        \
    {                                                                                              \
        0                                                                                          \
    }

enum { MEMBERS_MAX = 8 };

static const struct {
    const char *verb_key, *verb;
    struct member member[MEMBERS_MAX];
} messages[MESSAGE_KIND_COUNT] = {
    [MESSAGE_HELLO] = {"say",
                       "hello",
                       {INTEGER(protocol), INTEGER(model_version), TEXT("program", program),
                        TEXT("model", model), END}},
    [MESSAGE_PROGRESS] = {"say",
                          "progress",
                          {JOB,
                           {"fraction", MEMBER_NUMBER, AT(fraction), 0.0, 1.0},
                           INTEGER(load_step),
                           INTEGER(newton_iteration),
                           {"F_N", MEMBER_NUMBER, AT(F_N), 0.0, 1e9},
                           TEXT("message", text),
                           END}},
    [MESSAGE_RESULT] = {"say", "result", {JOB, END}},
    [MESSAGE_PROBLEM] = {"say", "problem", {JOB, END}},
    [MESSAGE_RENDERED] = {"say", "rendered", {JOB, END}},
    [MESSAGE_SOLVE] = {"op", "solve", {JOB, CASE, END}},
    [MESSAGE_RENDER] = {"op", "render", {JOB, TEXT("as", as), TEXT("lang", language), CASE, END}},
};

/* ------------------------------------------------------------------------------- writing */

static void put_member(struct json_out *out, const struct member *member,
                       const struct message *message)
{
    const char *at = (const char *)message + member->offset;
    switch (member->kind) {
    case MEMBER_NUMBER:
        json_put_number(out, member->key, *(const double *)(const void *)at);
        break;
    case MEMBER_INTEGER:
        json_put_integer(out, member->key, *(const int *)(const void *)at);
        break;
    case MEMBER_TEXT:
        json_put_string(out, member->key, at);
        break;
    case MEMBER_CASE:
        json_put_raw(out, member->key, *(char *const *)(const void *)at);
        break;
    }
}

enum ischia_code message_write(const struct message *message, char **ret_json, size_t *ret_size,
                               struct ischia_error *err)
{
    struct json_out out;
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    json_put_string(&out, messages[message->kind].verb_key, messages[message->kind].verb);
    for (const struct member *m = messages[message->kind].member; m->key != NULL; m++)
        put_member(&out, m, message);
    json_close_object(&out);
    return json_out_take(&out, ret_json, ret_size, err);
}

/* ------------------------------------------------------------------------------- reading */

static const struct json_limits limits = {
    .bytes_max = 1024 * 1024, .depth_max = 8, .members_max = 256};

static bool find_kind(const struct json *root, enum message_kind *ret)
{
    for (int k = 0; k < MESSAGE_KIND_COUNT; k++) {
        const struct json *verb = json_member(root, messages[k].verb_key);
        if (verb == NULL || json_type_of(verb) != JSON_STRING) continue;
        if (strcmp(json_string(verb), messages[k].verb) != 0) continue;
        *ret = (enum message_kind)k;
        return true;
    }
    return false;
}

static bool read_number(const struct json *value, const struct member *member, char *at)
{
    if (json_type_of(value) != JSON_NUMBER) return false;
    const double number = json_number(value);
    if (!(number >= member->min && number <= member->max)) return false;
    if (member->kind == MEMBER_NUMBER) {
        *(double *)(void *)at = number;
        return true;
    }
    const int integer = (int)number; /* in range by the table */
    *(int *)(void *)at = integer;
    return (double)integer >= number && (double)integer <= number;
}

static bool read_text(const struct json *value, char *at)
{
    if (json_type_of(value) != JSON_STRING) return false;
    const char *text = json_string(value);
    if (strlen(text) >= MESSAGE_TEXT_BYTES) return false;
    (void)stpcpy(at, text);
    return true;
}

/* The case goes on to another reader: it is written again from what was parsed. */
static void rewrite(struct json_out *out, const char *key, const struct json *value)
{
    switch (json_type_of(value)) {
    case JSON_NULL:
        json_put_null(out, key);
        return;
    case JSON_BOOL:
        json_put_bool(out, key, json_bool(value));
        return;
    case JSON_NUMBER:
        json_put_number(out, key, json_number(value));
        return;
    case JSON_STRING:
        json_put_string(out, key, json_string(value));
        return;
    case JSON_ARRAY:
        json_open_array(out, key);
        break;
    default:
        json_open_object(out, key);
        break;
    }
    for (const struct json *m = json_first(value); m != NULL; m = json_next(m))
        rewrite(out, json_key(m), m); /* no deeper than limits.depth_max */
    if (json_type_of(value) == JSON_ARRAY)
        json_close_array(out);
    else
        json_close_object(out);
}

static bool read_case(const struct json *value, char *at)
{
    if (json_type_of(value) != JSON_OBJECT) return false;
    struct json_out out;
    char *text = NULL;
    json_out_init(&out, 0);
    rewrite(&out, NULL, value);
    if (json_out_take(&out, &text, NULL, NULL) != ISCHIA_OK) return false;
    *(char **)(void *)at = text;
    return true;
}

static bool read_member(const struct json *root, const struct member *member, struct message *ret)
{
    const struct json *value = json_member(root, member->key);
    char *at = (char *)ret + member->offset;
    if (value == NULL) return false;
    switch (member->kind) {
    case MEMBER_TEXT:
        return read_text(value, at);
    case MEMBER_CASE:
        return read_case(value, at);
    default:
        return read_number(value, member, at);
    }
}

static enum ischia_code read_message(const struct json *root, struct message *ret,
                                     struct ischia_error *err)
{
    struct message message = {0};
    CHECK(find_kind(root, &message.kind), err, ISCHIA_E_INPUT, "a message of no known kind");
    for (const struct member *m = messages[message.kind].member; m->key != NULL; m++)
        CHECK(read_member(root, m, &message), err, ISCHIA_E_INPUT,
              "a message '%s' without a good '%s'", messages[message.kind].verb, m->key);
    *ret = message;
    return ISCHIA_OK;
}

enum ischia_code message_read(const char *json, size_t size, struct message *ret,
                              struct ischia_error *err)
{
    struct json *root = NULL;
    struct doc_faults faults;
    doc_faults_init(&faults);
    const enum ischia_code parsed = json_parse(&root, json, size, &limits, &faults, err);
    if (parsed != ISCHIA_OK) return parsed == ISCHIA_E_LIMIT ? ISCHIA_E_INPUT : parsed;
    enum ischia_code code = ISCHIA_OK;
    if (faults.count > 0) code = FAIL(err, ISCHIA_E_INPUT, "a message: %s", faults.item[0].detail);
    if (code == ISCHIA_OK) code = read_message(root, ret, err);
    json_destroy(root);
    return code;
}

bool message_is_object(const char *json, size_t size)
{
    struct json *root = NULL;
    struct doc_faults faults;
    doc_faults_init(&faults);
    if (json_parse(&root, json, size, &json_limits_stored, &faults, NULL) != ISCHIA_OK)
        return false;
    const bool good = faults.count == 0 && json_type_of(root) == JSON_OBJECT;
    json_destroy(root);
    return good;
}
