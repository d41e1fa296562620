/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "api/case_places.h"

#include <stdio.h>
#include <string.h>

void case_places_init(struct case_places *ret, struct ischia_request *request)
{
    memset(ret, 0, sizeof *ret);
    doc_faults_init(&ret->found);
    case_doc_fields_init(&ret->fields, request, &ret->found);
}

const char *case_places_find(const struct case_places *places, const char *key)
{
    for (int i = 0; i < places->count; i++)
        if (strcmp(places->place[i].key, key) == 0) return places->place[i].where;
    return NULL;
}

static int remember(struct case_places *places, const char *key, const char *where)
{
    for (int i = 0; i < places->count; i++)
        if (strcmp(places->place[i].key, key) == 0) return i;
    if (places->count == CASE_PLACES_MAX) return CASE_PLACES_MAX - 1;
    (void)snprintf(places->place[places->count].key, sizeof places->place[0].key, "%s", key);
    (void)snprintf(places->place[places->count].where, DOC_POINTER_BYTES, "%s", where);
    return places->count++;
}

void case_places_refuse(struct case_places *places, const char *key, const char *where)
{
    places->place[remember(places, key, where)].refused = true;
}

static bool was_refused(const struct case_places *places, const char *key)
{
    for (int i = 0; i < places->count; i++)
        if (strcmp(places->place[i].key, key) == 0) return places->place[i].refused;
    return false;
}

void case_places_set(struct case_places *places, const char *key, const char *value,
                     const char *where)
{
    (void)remember(places, key, where);
    const size_t before = places->found.count;
    case_doc_fields_set(&places->fields, key, value);
    for (size_t i = before; i < places->found.count; i++)
        (void)snprintf(places->found_at[i], DOC_POINTER_BYTES, "%s", where);
}

void case_places_end(struct case_places *places, struct doc_faults *faults, const char *before,
                     const char *after)
{
    char where[DOC_POINTER_BYTES];
    const size_t set_count = places->found.count; /* the rest concerns the whole */
    case_doc_fields_end(&places->fields);
    for (size_t i = 0; i < places->found.count; i++) {
        const struct ischia_fault *f = &places->found.item[i];
        const char *key = f->pointer[0] == '/' ? f->pointer + 1 : f->pointer;
        if (strcmp(f->code, "missing") == 0 && was_refused(places, key)) continue;
        const char *place = i < set_count ? places->found_at[i] : case_places_find(places, key);
        (void)snprintf(where, sizeof where, "%s%.8s%s", before, after == NULL ? "" : key,
                       after == NULL ? "" : after);
        doc_faults_add(faults, place == NULL ? where : place, f->code, "%s", f->detail);
    }
}
