/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/assessment_doc.h"

#include <assert.h>
#include <stddef.h>
#include <stdio.h>

#include "api/case_words.h"
#include "api/fields.h"

const char *const assessment_status_names[ASSESSMENT_STATUS_COUNT] = {
    [ASSESSMENT_QUEUED] = "queued",       [ASSESSMENT_RUNNING] = "running",
    [ASSESSMENT_SUCCEEDED] = "succeeded", [ASSESSMENT_FAILED] = "failed",
    [ASSESSMENT_CANCELLED] = "cancelled",
};

static void write_parameters(struct json_out *out, const char *key, const void *base)
{
    json_open_object(out, key);
    case_doc_write_parameters(out, &((const struct assessment *)base)->request.values);
    json_close_object(out);
}

/* skin, resolution and model: three members that case_doc writes together. */
static void write_options(struct json_out *out, const char *key, const void *base)
{
    (void)key;
    case_doc_write_options(out, &((const struct assessment *)base)->request);
}

static void write_sd(struct json_out *out, const char *key, const void *base)
{
    const struct ischia_request *request = &((const struct assessment *)base)->request;
    if (request->has_sd)
        case_doc_write_sd(out, request);
    else
        json_put_null(out, key);
}

static void put_raw_or_null(struct json_out *out, const char *key, const char *json)
{
    if (json != NULL)
        json_put_raw(out, key, json);
    else
        json_put_null(out, key);
}

static void write_result(struct json_out *out, const char *key, const void *base)
{
    put_raw_or_null(out, key, ((const struct assessment *)base)->result_json);
}

static void write_problem(struct json_out *out, const char *key, const void *base)
{
    put_raw_or_null(out, key, ((const struct assessment *)base)->problem_json);
}

static void write_warnings(struct json_out *out, const char *key, const void *base)
{
    const struct ischia_case *c = &((const struct assessment *)base)->request.values;
    struct ischia_fault warnings[ISCHIA_PARAM_COUNT];
    const size_t count = case_warnings(c, LANGUAGE_EN, warnings);
    json_open_array(out, key);
    for (size_t i = 0; i < count; i++) {
        json_open_object(out, NULL);
        json_put_string(out, "code", warnings[i].code);
        json_put_string(out, "pointer", warnings[i].pointer);
        json_put_string(out, "detail", warnings[i].detail);
        json_close_object(out);
    }
    json_close_array(out);
}

static void write_links(struct json_out *out, const char *key, const void *base)
{
    static const struct {
        const char *name, *path;
        bool needs_result;
    } links[] = {
        {"self", "", false},
        {"field", "/field.vtu", true},
        {"section", "/section.svg", true},
        {"report", "/report", true},
    };
    const struct assessment *a = base;
    char url[128];
    json_open_object(out, key);
    for (size_t i = 0; i < sizeof links / sizeof links[0]; i++) {
        const bool there = !links[i].needs_result || a->status == ASSESSMENT_SUCCEEDED;
        (void)snprintf(url, sizeof url, "/v1/assessments/%s%s", a->id, links[i].path);
        json_put_string(out, links[i].name, there ? url : NULL);
    }
    json_close_object(out);
}

#define TEXT(key_, kind_, member, bytes)                                                           \
    {                                                                                              \
        .key = (key_), .kind = (kind_), .offset = offsetof(struct assessment, member),             \
        .size = (bytes)                                                                            \
    }
static const struct field assessment_fields[] = {
    TEXT("id", FIELD_TEXT, id, ASSESSMENT_ID_BYTES),
    {.key = "status",
     .kind = FIELD_WORD,
     .offset = offsetof(struct assessment, status),
     .words = assessment_status_names,
     .count = ASSESSMENT_STATUS_COUNT},
    TEXT("created_at", FIELD_TEXT, created_at, ASSESSMENT_TIME_BYTES),
    TEXT("started_at", FIELD_TEXT_OR_NULL, started_at, ASSESSMENT_TIME_BYTES),
    TEXT("finished_at", FIELD_TEXT_OR_NULL, finished_at, ASSESSMENT_TIME_BYTES),
    TEXT("subject", FIELD_TEXT_OR_NULL, request.subject, ISCHIA_SUBJECT_BYTES),
    {.key = "side",
     .kind = FIELD_WORD_OR_NULL,
     .offset = offsetof(struct assessment, request.side),
     .words = ischia_side_names,
     .count = ISCHIA_SIDE_COUNT},
    TEXT("label", FIELD_TEXT_OR_NULL, request.label, ISCHIA_LABEL_BYTES),
    TEXT("measured_at", FIELD_TEXT_OR_NULL, request.measured_at, ISCHIA_MEASURED_AT_BYTES),
    {.key = "parameters", .kind = FIELD_CUSTOM, .custom_write = write_parameters},
    {.key = "sd", .kind = FIELD_CUSTOM, .custom_write = write_sd},
    {.key = "options", .kind = FIELD_CUSTOM, .custom_write = write_options},
    {.key = "progress", .kind = FIELD_NUMBER, .offset = offsetof(struct assessment, progress)},
    {.key = "result", .kind = FIELD_CUSTOM, .custom_write = write_result},
    {.key = "problem", .kind = FIELD_CUSTOM, .custom_write = write_problem},
    {.key = "warnings", .kind = FIELD_CUSTOM, .custom_write = write_warnings},
    {.key = "links", .kind = FIELD_CUSTOM, .custom_write = write_links},
    {.key = NULL},
};

void assessment_doc_write(struct json_out *out, const struct assessment *assessment)
{
    assert(ischia_case_is_valid(&assessment->request.values));
    fields_write(out, assessment_fields, assessment);
}

enum ischia_code assessment_doc_text(char **ret_text, const struct assessment *assessment,
                                     int indent, struct ischia_error *err)
{
    struct json_out out;
    json_out_init(&out, indent);
    json_open_object(&out, NULL);
    assessment_doc_write(&out, assessment);
    json_close_object(&out);
    return json_out_take(&out, ret_text, NULL, err);
}
