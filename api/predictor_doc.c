/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/predictor_doc.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/case_doc.h"
#include "api/json.h"
#include "api/study_response.h"

static const struct json_limits file_limits = {PREDICTOR_FILE_BYTES_MAX, 8, 1024};
enum { TERMS_MAX = 4096 };

enum ischia_code predictor_doc_split(const char *text, size_t length,
                                     char ret_digest[PREDICTOR_DIGEST_DIGITS + 1],
                                     const char **ret_json, struct ischia_error *err)
{
    static const char start[] = "ischia emulator 2 sha256 ";
    const size_t head = sizeof start - 1 + PREDICTOR_DIGEST_DIGITS;
    CHECK(length > head && memcmp(text, start, sizeof start - 1) == 0 && text[head] == '\n', err,
          ISCHIA_E_INPUT, "it does not begin as a trained emulator does");
    memcpy(ret_digest, text + sizeof start - 1, PREDICTOR_DIGEST_DIGITS);
    ret_digest[PREDICTOR_DIGEST_DIGITS] = '\0';
    *ret_json = text + head + 1;
    return ISCHIA_OK;
}

/* ---- members: ISCHIA_E_INPUT names the one that is missing or of the wrong kind ---- */

static enum ischia_code number_of(const struct json *object, const char *key, double *ret,
                                  struct ischia_error *err)
{
    const struct json *value = json_member(object, key);
    CHECK(value != NULL && json_type_of(value) == JSON_NUMBER, err, ISCHIA_E_INPUT,
          "%s is missing, or is no number", key);
    *ret = json_number(value);
    return ISCHIA_OK;
}

static enum ischia_code text_of(const struct json *object, const char *key, const char **ret,
                                struct ischia_error *err)
{
    const struct json *value = json_member(object, key);
    CHECK(value != NULL && json_type_of(value) == JSON_STRING, err, ISCHIA_E_INPUT,
          "%s is missing, or is no text", key);
    *ret = json_string(value);
    return ISCHIA_OK;
}

static enum ischia_code flag_of(const struct json *object, const char *key, bool *ret,
                                struct ischia_error *err)
{
    const struct json *value = json_member(object, key);
    CHECK(value != NULL && json_type_of(value) == JSON_BOOL, err, ISCHIA_E_INPUT,
          "%s is missing, or neither true nor false", key);
    *ret = json_bool(value);
    return ISCHIA_OK;
}

static enum ischia_code check_model(const struct json *root, struct ischia_error *err)
{
    const struct json *model = json_member(root, "model");
    const char *name = "";
    double version = 0;
    TRY(text_of(model, "name", &name, err));
    TRY(number_of(model, "version", &version, err));
    CHECK(strcmp(name, ISCHIA_MODEL_NAME) == 0 && version == ISCHIA_MODEL_VERSION, err,
          ISCHIA_E_INPUT, "it was trained with %.40s version %g; this is %s version %d", name,
          version, ISCHIA_MODEL_NAME, (int)ISCHIA_MODEL_VERSION);
    return ISCHIA_OK;
}

static enum ischia_code read_inputs(const struct json *root, struct predictor *p,
                                    struct ischia_error *err)
{
    const struct json *inputs = json_member(root, "inputs");
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++) {
        const struct json *input = json_member(inputs, ischia_params[i].key);
        TRY(number_of(input, "min", &p->input[i].min, err));
        TRY(number_of(input, "max", &p->input[i].max, err));
        TRY(flag_of(input, "log", &p->input[i].log, err));
    }
    return ISCHIA_OK;
}

/* What all solves of the training had in common, in the words of a request. */
static enum ischia_code read_case(const struct json *root, struct predictor *p,
                                  struct ischia_error *err)
{
    struct ischia_request request;
    struct doc_faults faults;
    doc_faults_init(&faults);
    const struct json *object = json_member(root, "case");
    CHECK(object != NULL, err, ISCHIA_E_INPUT, "case is missing");
    case_doc_read_value(&request, object, &faults);
    for (size_t i = 0; i < faults.count; i++) /* the inputs are not given there */
        CHECK(strcmp(faults.item[i].code, "missing") == 0, err, ISCHIA_E_INPUT, "case: %s",
              faults.item[i].detail);
    memcpy(p->option, request.values.option, sizeof p->option);
    p->resolution = request.values.resolution;
    return ISCHIA_OK;
}

/* [degree of each input ..., value] */
static bool read_term(const struct json *list, struct predictor_term *ret)
{
    const struct json *m = json_first(list);
    if (json_type_of(list) != JSON_ARRAY || json_count(list) != ISCHIA_PARAM_COUNT + 1)
        return false;
    for (int i = 0; i < ISCHIA_PARAM_COUNT; i++, m = json_next(m)) {
        const double degree = json_type_of(m) == JSON_NUMBER ? json_number(m) : -1;
        if (!(degree >= 0 && degree <= PREDICTOR_DEGREE_MAX) || floor(degree) != degree)
            return false;
        ret->degree[i] = (unsigned char)degree;
    }
    if (json_type_of(m) != JSON_NUMBER) return false;
    ret->value = json_number(m);
    return true;
}

static enum ischia_code read_sum(const struct json *output, const char *key,
                                 struct predictor_sum *ret, struct ischia_error *err)
{
    const struct json *list = json_member(output, key);
    const size_t count = list == NULL ? 0 : json_count(list);
    CHECK(count >= 1 && count <= TERMS_MAX, err, ISCHIA_E_INPUT,
          "%s has %zu terms; accepted 1 to %d", key, count, (int)TERMS_MAX);
    ret->term = calloc(count, sizeof *ret->term);
    CHECK(ret->term != NULL, err, ISCHIA_E_MEMORY, "out of memory for %zu terms", count);
    for (const struct json *m = json_first(list); m != NULL; m = json_next(m))
        CHECK(read_term(m, &ret->term[ret->count++]), err, ISCHIA_E_INPUT,
              "%s: term %d is no list of %d degrees and a value", key, ret->count,
              (int)ISCHIA_PARAM_COUNT);
    return ISCHIA_OK;
}

/* Exactly `count` numbers, `step` places apart. */
static bool read_numbers(const struct json *list, int count, int step, double *ret)
{
    if (list == NULL || json_type_of(list) != JSON_ARRAY || json_count(list) != (size_t)count)
        return false;
    for (const struct json *m = json_first(list); m != NULL; m = json_next(m), ret += step) {
        if (json_type_of(m) != JSON_NUMBER) return false;
        *ret = json_number(m);
    }
    return true;
}

static enum ischia_code read_groups(const struct json *root, struct predictor *p,
                                    struct ischia_error *err)
{
    const struct json *list = json_member(root, "groups");
    CHECK(list == NULL || json_count(list) <= PREDICTOR_GROUPS_MAX, err, ISCHIA_E_INPUT,
          "more than %d groups", (int)PREDICTOR_GROUPS_MAX);
    for (const struct json *m = json_first(list); m != NULL; m = json_next(m)) {
        struct predictor_group *group = &p->group[p->group_count++];
        CHECK(read_numbers(json_member(m, "powers"), ISCHIA_PARAM_COUNT, 1, group->power), err,
              ISCHIA_E_INPUT, "powers of group %d are no %d numbers", p->group_count,
              (int)ISCHIA_PARAM_COUNT);
        TRY(number_of(m, "low", &group->low, err));
        TRY(number_of(m, "high", &group->high, err));
    }
    return ISCHIA_OK;
}

/* The solves that it was trained with, by their inputs; a file may have none. */
static enum ischia_code read_centres(const struct json *root, struct predictor *p,
                                     struct ischia_error *err)
{
    const struct json *list = json_member(root, "centres");
    int j = 0;
    TRY(predictor_reserve(p, list == NULL ? 0 : (int)json_count(list), err));
    for (const struct json *m = json_first(list); m != NULL; m = json_next(m), j++) {
        double param[ISCHIA_PARAM_COUNT], coordinate[PREDICTOR_COORDINATES_MAX];
        CHECK(read_numbers(m, ISCHIA_PARAM_COUNT, 1, param), err, ISCHIA_E_INPUT,
              "centre %d is no list of %d numbers", j + 1, (int)ISCHIA_PARAM_COUNT);
        const int count = predictor_coordinates(p, param, coordinate);
        for (int i = 0; i < count; i++) p->centre[i * p->stride + j] = coordinate[i];
    }
    return ISCHIA_OK;
}

static enum ischia_code read_kernel(const struct json *object, const struct predictor *p,
                                    struct predictor_output *ret, struct ischia_error *err)
{
    const struct json *kernel = json_member(object, "kernel");
    if (kernel == NULL) return ISCHIA_OK;
    const int coordinates = ISCHIA_PARAM_COUNT + p->group_count;
    CHECK(read_numbers(json_member(kernel, "lengths"), coordinates, 1, ret->length), err,
          ISCHIA_E_INPUT, "lengths is no list of %d numbers", coordinates);
    ret->weight = calloc((size_t)p->stride + 1, sizeof *ret->weight);
    CHECK(ret->weight != NULL, err, ISCHIA_E_MEMORY, "out of memory for %d weights", p->stride);
    CHECK(read_numbers(json_member(kernel, "weights"), p->centre_count, 1, ret->weight), err,
          ISCHIA_E_INPUT, "weights is no list of %d numbers", p->centre_count);
    return ISCHIA_OK;
}

static enum ischia_code read_output(const struct json *object, const struct predictor *p,
                                    struct predictor_output *ret, struct ischia_error *err)
{
    const char *name = "";
    double power = 0;
    TRY(text_of(object, "name", &name, err));
    CHECK(study_response_find(name) >= 0, err, ISCHIA_E_INPUT, "\"%.40s\" is not a response", name);
    (void)snprintf(ret->name, sizeof ret->name, "%s", name);
    TRY(number_of(object, "power", &power, err));
    TRY(number_of(object, "reach", &ret->reach, err));
    TRY(number_of(object, "held_out_rms", &ret->held_out_rms, err));
    ret->power = power == 2 ? 2 : power == 1 ? 1 : 0;
    TRY(read_sum(object, "mean", &ret->mean, err));
    TRY(read_kernel(object, p, ret, err));
    return read_sum(object, "spread", &ret->spread, err);
}

static enum ischia_code read_outputs(const struct json *root, struct predictor *p,
                                     struct ischia_error *err)
{
    const struct json *list = json_member(root, "outputs");
    CHECK(list != NULL && json_count(list) <= PREDICTOR_OUTPUTS_MAX, err, ISCHIA_E_INPUT,
          "outputs are missing, or more than %d", (int)PREDICTOR_OUTPUTS_MAX);
    for (const struct json *m = json_first(list); m != NULL; m = json_next(m))
        TRY(read_output(m, p, &p->output[p->output_count++], err));
    return ISCHIA_OK;
}

static enum ischia_code read_all(const struct json *root, struct predictor *p,
                                 struct ischia_error *err)
{
    double rows = 0;
    TRY(check_model(root, err));
    TRY(number_of(root, "rows", &rows, err));
    TRY(flag_of(root, "trial", &p->trial, err));
    CHECK(rows >= 1 && rows <= 1e9, err, ISCHIA_E_INPUT, "rows is %g", rows);
    p->rows = (int)rows;
    TRY(read_case(root, p, err));
    TRY(read_inputs(root, p, err));
    TRY(read_groups(root, p, err));
    TRY(read_centres(root, p, err));
    TRY(read_outputs(root, p, err));
    CHECK(predictor_is_valid(p), err, ISCHIA_E_INPUT, "a number in it is out of bounds");
    return ISCHIA_OK;
}

enum ischia_code predictor_doc_read(struct predictor *ret, const char *json, size_t length,
                                    struct ischia_error *err)
{
    struct predictor p = {0};
    struct doc_faults faults;
    struct json *root;
    doc_faults_init(&faults);
    TRY(json_parse(&root, json, length, &file_limits, &faults, err));
    enum ischia_code code = faults.count == 0
                                ? read_all(root, &p, err)
                                : FAIL(err, ISCHIA_E_INPUT, "%s", faults.item[0].detail);
    json_destroy(root);
    if (code == ISCHIA_OK)
        *ret = p;
    else
        predictor_finish(&p);
    return code;
}
