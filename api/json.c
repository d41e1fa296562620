/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The only file that sees cJSON.h. json_scan has vouched for every byte before cJSON builds the
 * tree; what a grammar cannot see (duplicate keys, numbers beyond a double) is looked for in the
 * tree. cJSON_InitHooks is left alone, as it would change every user of the library in the
 * process; cJSON then uses malloc, and the one thing that can fail after the scan is memory.
 * (cJSON also notes the place of the last error in a static variable that nobody reads here.)
 */
#include "api/json.h"

#include <assert.h>
#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "api/json_scan.h"

const char *const json_type_names[JSON_TYPE_COUNT] = {
    [JSON_NULL] = "null",       [JSON_BOOL] = "true or false", [JSON_NUMBER] = "a number",
    [JSON_STRING] = "a string", [JSON_ARRAY] = "an array",     [JSON_OBJECT] = "an object",
};

const struct json_limits json_limits_request = {
    .bytes_max = 64 * 1024, .depth_max = 16, .members_max = 256};
const struct json_limits json_limits_record = {
    .bytes_max = 256 * 1024, .depth_max = 32, .members_max = 256};
const struct json_limits json_limits_stored = {
    .bytes_max = 16 * 1024 * 1024, .depth_max = 16, .members_max = 256};

/* struct json is never defined: a pointer to it is a pointer to cJSON's node. */
static const cJSON *node(const struct json *value) { return (const cJSON *)(const void *)value; }
static const struct json *opaque(const cJSON *item)
{
    return (const struct json *)(const void *)item;
}

static bool repeats(const cJSON *first, const cJSON *item)
{
    for (const cJSON *earlier = first; earlier != item; earlier = earlier->next)
        if (strcmp(earlier->string, item->string) == 0) return true;
    return false;
}

static void check_tree(const cJSON *item, const char *pointer, int members_max,
                       struct doc_faults *faults);

/* members_max also bounds the work of comparing every key with those before it. */
static void check_object(const cJSON *object, const char *pointer, int members_max,
                         struct doc_faults *faults)
{
    char path[DOC_POINTER_BYTES];
    int count = 0;
    for (const cJSON *m = object->child; m != NULL; m = m->next) {
        if (++count > members_max) {
            doc_faults_add(faults, pointer, "too_many", "an object has more than %d members",
                           members_max);
            return;
        }
        (void)doc_pointer(path, sizeof path, pointer, m->string);
        if (repeats(object->child, m))
            doc_faults_add(faults, path, "duplicate", "%s is given more than once", m->string);
        check_tree(m, path, members_max, faults);
    }
}

static void check_array(const cJSON *array, const char *pointer, int members_max,
                        struct doc_faults *faults)
{
    char path[DOC_POINTER_BYTES], index[TEXT_NUMBER_BYTES];
    int count = 0;
    for (const cJSON *m = array->child; m != NULL; m = m->next) {
        (void)text_from_number(count++, index);
        (void)doc_pointer(path, sizeof path, pointer, index);
        check_tree(m, path, members_max, faults);
    }
}

/* Recursion is bounded: json_scan has limited the depth. */
static void check_tree(const cJSON *item, const char *pointer, int members_max,
                       struct doc_faults *faults)
{
    if (cJSON_IsNumber(item) && !isfinite(item->valuedouble))
        doc_faults_add(faults, pointer, "not_finite",
                       "%s is beyond 1.8e308; accepted finite numbers",
                       item->string != NULL ? item->string : "the number");
    if (cJSON_IsObject(item)) check_object(item, pointer, members_max, faults);
    if (cJSON_IsArray(item)) check_array(item, pointer, members_max, faults);
}

/* What a tree does not show: cJSON ends a string at its first NUL. */
static void check_seen(const struct json_scan_seen *seen, int depth_max, struct doc_faults *faults)
{
    if (seen->depth > depth_max)
        doc_faults_add(faults, "", "too_many", "the document is nested more than %d deep",
                       depth_max);
    if (seen->nul)
        doc_faults_add(faults, "", "malformed", "a text%s%s holds \\u0000, which is not accepted",
                       seen->key[0] != '\0' ? " at or after " : "", seen->key);
}

enum ischia_code json_parse(struct json **ret, const char *text, size_t length,
                            const struct json_limits *limits, struct doc_faults *faults,
                            struct ischia_error *err)
{
    struct json_scan_seen seen;
    assert(limits->depth_max > 0 && limits->depth_max <= JSON_SCAN_DEPTH_MAX);
    CHECK(length <= limits->bytes_max, err, ISCHIA_E_LIMIT,
          "the document is larger than the accepted %zu KiB", limits->bytes_max / 1024);
    TRY(json_scan(text, length, limits->depth_max, &seen, err));
    cJSON *root = cJSON_ParseWithLength(text, length);
    CHECK(root != NULL, err, ISCHIA_E_MEMORY, "out of memory while reading a JSON document");
    check_seen(&seen, limits->depth_max, faults);
    check_tree(root, "", limits->members_max, faults);
    *ret = (struct json *)(void *)root;
    return ISCHIA_OK;
}

void json_destroy(struct json *root) { cJSON_Delete((cJSON *)(void *)root); }

/* The next number in a text that json_scan has passed, from *at on; its length, 0 at the end. */
static size_t next_number(const char *text, size_t length, size_t *at)
{
    for (bool quoted = false; *at < length; (*at)++) {
        const char c = text[*at];
        if (c == '"') quoted = !quoted;
        if (quoted && c == '\\') (*at)++; /* what is escaped is no closing quote */
        if (quoted || c == '\0' || strchr("-0123456789", c) == NULL) continue;
        size_t end = *at;
        while (end < length && text[end] != '\0' && strchr("+-.0123456789eE", text[end]) != NULL)
            end++;
        return end - *at;
    }
    return 0;
}

struct digits_walk {
    const char *text;
    size_t length, at;
};

/* cJSON leaves valuestring NULL for numbers, and frees it with the node. Tree and text have the
 * numbers in the same order. */
static bool keep_digits(cJSON *item, struct digits_walk *walk)
{
    for (cJSON *m = item->child; m != NULL; m = m->next)
        if (!keep_digits(m, walk)) return false;
    if (!cJSON_IsNumber(item)) return true;
    const size_t size = next_number(walk->text, walk->length, &walk->at);
    item->valuestring = strndup(walk->text + walk->at, size);
    walk->at += size;
    return item->valuestring != NULL;
}

enum ischia_code json_keep_digits(struct json *root, const char *text, size_t length,
                                  struct ischia_error *err)
{
    struct digits_walk walk = {text, length, 0};
    CHECK(keep_digits((cJSON *)(void *)root, &walk), err, ISCHIA_E_MEMORY,
          "out of memory while reading a JSON document");
    return ISCHIA_OK;
}

const char *json_digits(const struct json *value)
{
    return cJSON_IsNumber(node(value)) ? node(value)->valuestring : NULL;
}

enum json_type json_type_of(const struct json *value)
{
    const cJSON *item = node(value);
    if (cJSON_IsBool(item)) return JSON_BOOL;
    if (cJSON_IsNumber(item)) return JSON_NUMBER;
    if (cJSON_IsString(item)) return JSON_STRING;
    if (cJSON_IsArray(item)) return JSON_ARRAY;
    return cJSON_IsObject(item) ? JSON_OBJECT : JSON_NULL;
}

bool json_bool(const struct json *value)
{
    assert(json_type_of(value) == JSON_BOOL);
    return cJSON_IsTrue(node(value)) != 0;
}

double json_number(const struct json *value)
{
    assert(json_type_of(value) == JSON_NUMBER);
    return node(value)->valuedouble;
}

const char *json_string(const struct json *value)
{
    assert(json_type_of(value) == JSON_STRING);
    return node(value)->valuestring;
}

const char *json_key(const struct json *member) { return node(member)->string; }

size_t json_count(const struct json *value)
{
    size_t count = 0;
    for (const struct json *m = json_first(value); m != NULL; m = json_next(m)) count++;
    return count;
}

const struct json *json_first(const struct json *value)
{
    return value == NULL ? NULL : opaque(node(value)->child);
}

const struct json *json_next(const struct json *member) { return opaque(node(member)->next); }

const struct json *json_member(const struct json *object, const char *key)
{
    if (json_type_of(object) != JSON_OBJECT) return NULL;
    for (const struct json *m = json_first(object); m != NULL; m = json_next(m))
        if (strcmp(json_key(m), key) == 0) return m;
    return NULL;
}

const char *json_library_version(void) { return cJSON_Version(); }
