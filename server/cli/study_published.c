/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/study_published.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "server/cli/files.h"

static const struct json_limits published_limits = {1024 * 1024, 8, 256};

static const struct json *typed_member(const struct json *object, const char *key,
                                       enum json_type type)
{
    const struct json *value = json_member(object, key);
    return value != NULL && json_type_of(value) == type ? value : NULL;
}

static double number_or_nan(const struct json *object, const char *key)
{
    const struct json *value = typed_member(object, key, JSON_NUMBER);
    return value != NULL ? json_number(value) : (double)NAN;
}

static enum ischia_code read_term(struct study_published_degree *d, const struct json *object,
                                  const char *path, struct ischia_error *err)
{
    const struct json *name = typed_member(object, "term", JSON_STRING);
    struct study_published_term *term = &d->term[d->count];
    CHECK(d->count < STUDY_PUBLISHED_TERMS_MAX, err, ISCHIA_E_LIMIT, "%s has too many terms", path);
    CHECK(name != NULL && strlen(json_string(name)) < sizeof term->name, err, ISCHIA_E_INPUT,
          "%s: each of \"terms\" needs \"term\" and \"theta\"", path);
    (void)snprintf(term->name, sizeof term->name, "%s", json_string(name));
    term->theta = number_or_nan(object, "theta");
    term->S_percent = number_or_nan(object, "S_percent");
    CHECK(!isnan(term->theta), err, ISCHIA_E_INPUT, "%s: %s has no theta", path, term->name);
    d->count++;
    return ISCHIA_OK;
}

static enum ischia_code read_degree(struct study_published_degree *d, const struct json *object,
                                    const char *path, struct ischia_error *err)
{
    d->mean_square = object != NULL ? number_or_nan(object, "mean_squared_residuals") : (double)NAN;
    const struct json *terms = object != NULL ? typed_member(object, "terms", JSON_ARRAY) : NULL;
    const struct json *m = terms != NULL ? json_first(terms) : NULL;
    for (; m != NULL; m = json_next(m)) TRY(read_term(d, m, path, err));
    return ISCHIA_OK;
}

static enum ischia_code read_root(struct study_published *p, const struct json *root,
                                  const char *path, struct ischia_error *err)
{
    const struct json *source = typed_member(root, "source", JSON_STRING);
    if (source != NULL) (void)snprintf(p->source, sizeof p->source, "%s", json_string(source));
    TRY(read_degree(&p->degree[0], typed_member(root, "degree_1", JSON_OBJECT), path, err));
    TRY(read_degree(&p->degree[1], typed_member(root, "degree_2", JSON_OBJECT), path, err));
    CHECK(p->degree[0].count + p->degree[1].count > 0, err, ISCHIA_E_INPUT,
          "%s has neither degree_1 nor degree_2 with \"terms\"", path);
    return ISCHIA_OK;
}

enum ischia_code study_published_read(struct study_published *ret, const char *path,
                                      struct ischia_error *err)
{
    struct study_published *published = calloc(1, sizeof *published);
    struct doc_faults faults;
    struct json *root;
    char *text = NULL;
    size_t length;
    CHECK(published != NULL, err, ISCHIA_E_MEMORY, "out of memory while reading %s", path);
    doc_faults_init(&faults);
    enum ischia_code code = file_read(path, published_limits.bytes_max, &text, &length, err);
    if (code == ISCHIA_OK) code = json_parse(&root, text, length, &published_limits, &faults, err);
    if (code == ISCHIA_OK) {
        code = faults.count == 0 ? read_root(published, root, path, err)
                                 : FAIL(err, ISCHIA_E_INPUT, "%s: %s: %s", path,
                                        faults.item[0].pointer, faults.item[0].detail);
        json_destroy(root);
    }
    if (code == ISCHIA_OK) *ret = *published;
    free(text);
    free(published);
    return code;
}
