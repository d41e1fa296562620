/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/documents.h"

#include <pthread.h>
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/assessment_doc.h"
#include "api/case_doc.h"

#define SLOTS 512U

struct slot {
    struct uuid id;
    int64_t change_seq;
    struct document *document; /* NULL: empty */
};

struct documents {
    pthread_mutex_t lock;
    struct slot slot[SLOTS];
};

void documents_time(int64_t unix_ms, char ret[DOCUMENTS_TIME_BYTES])
{
    const time_t seconds = (time_t)(unix_ms / 1000);
    struct tm parts;
    char date[24];
    ret[0] = '\0';
    if (unix_ms == 0) return;
    (void)gmtime_r(&seconds, &parts);
    (void)strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", &parts);
    (void)snprintf(ret, DOCUMENTS_TIME_BYTES, "%s.%03dZ", date, (int)(unix_ms % 1000));
}

static void copy_text(char *to, size_t size, const char *text)
{
    (void)snprintf(to, size, "%s", text == NULL ? "" : text);
}

enum ischia_code documents_request(struct ischia_request *ret, const struct store_assessment *row,
                                   struct ischia_error *err)
{
    struct doc_faults faults;
    doc_faults_init(&faults);
    ischia_request_init(ret);
    TRY(case_doc_read(ret, row->case_json, strlen(row->case_json), &json_limits_stored, &faults,
                      err));
    CHECK(faults.count == 0, err, ISCHIA_E_INPUT, "a stored case is not acceptable: %s",
          faults.item[0].detail);
    copy_text(ret->subject, sizeof ret->subject, row->subject);
    copy_text(ret->label, sizeof ret->label, row->label);
    copy_text(ret->measured_at, sizeof ret->measured_at, row->measured_at);
    for (int i = 1; i < ISCHIA_SIDE_COUNT; i++)
        if (row->side != NULL && strcmp(row->side, ischia_side_names[i]) == 0)
            ret->side = (enum ischia_side)i;
    return ISCHIA_OK;
}

static const enum assessment_status status_of[QUEUE_STATE_COUNT] = {
    [QUEUE_QUEUED] = ASSESSMENT_QUEUED,       [QUEUE_RUNNING] = ASSESSMENT_RUNNING,
    [QUEUE_SUCCEEDED] = ASSESSMENT_SUCCEEDED, [QUEUE_FAILED] = ASSESSMENT_FAILED,
    [QUEUE_CANCELLED] = ASSESSMENT_CANCELLED,
};

enum ischia_code documents_write(struct json_out *out, const struct store_assessment *row,
                                 double fraction, struct ischia_error *err)
{
    struct assessment a = {.status = status_of[row->state], .progress = fraction};
    uuid_format(&row->id, a.id);
    documents_time(row->created_ms, a.created_at);
    documents_time(row->started_ms, a.started_at);
    documents_time(row->finished_ms, a.finished_at);
    TRY(documents_request(&a.request, row, err));
    if (row->state == QUEUE_SUCCEEDED) a.progress = 1;
    a.result_json = row->result_json;
    a.problem_json = row->problem_json;
    assessment_doc_write(out, &a);
    json_put_bool(out, "cached", row->cached);
    return ISCHIA_OK;
}

void document_release(void *document)
{
    struct document *d = document;
    if (d == NULL || __atomic_sub_fetch(&d->owners, 1, __ATOMIC_ACQ_REL) > 0) return;
    sodium_memzero(d->text, d->size);
    free(d);
}

enum ischia_code documents_create(struct documents **ret, struct ischia_error *err)
{
    struct documents *documents = calloc(1, sizeof *documents);
    CHECK(documents != NULL, err, ISCHIA_E_MEMORY, "no memory for the documents");
    (void)pthread_mutex_init(&documents->lock, NULL);
    *ret = documents;
    return ISCHIA_OK;
}

void documents_destroy(struct documents *documents)
{
    if (documents == NULL) return;
    for (size_t i = 0; i < SLOTS; i++) document_release(documents->slot[i].document);
    (void)pthread_mutex_destroy(&documents->lock);
    free(documents);
}

/* The last bytes of a UUIDv7 are random: no other hash is needed. */
static struct slot *slot_of(struct documents *documents, const struct uuid *id)
{
    unsigned hash = 0;
    memcpy(&hash, id->byte + UUID_BYTES - sizeof hash, sizeof hash);
    return &documents->slot[hash % SLOTS];
}

struct document *documents_find(struct documents *documents, const struct uuid *id,
                                int64_t change_seq)
{
    struct slot *slot = slot_of(documents, id);
    struct document *found = NULL;
    (void)pthread_mutex_lock(&documents->lock);
    if (slot->document != NULL && slot->change_seq == change_seq && uuid_equal(&slot->id, id)) {
        found = slot->document;
        (void)__atomic_add_fetch(&found->owners, 1, __ATOMIC_RELAXED);
    }
    (void)pthread_mutex_unlock(&documents->lock);
    return found;
}

struct document *documents_keep(struct documents *documents, const struct uuid *id,
                                int64_t change_seq, const char *text, size_t size)
{
    struct slot *slot = slot_of(documents, id);
    struct document *kept = malloc(sizeof *kept + size);
    if (kept == NULL) return NULL;
    kept->owners = 2;
    kept->size = size;
    memcpy(kept->text, text, size);
    (void)pthread_mutex_lock(&documents->lock);
    struct document *old = slot->document;
    *slot = (struct slot){*id, change_seq, kept};
    (void)pthread_mutex_unlock(&documents->lock);
    document_release(old);
    return kept;
}

void documents_forget(struct documents *documents, const struct uuid *id)
{
    struct slot *slot = slot_of(documents, id);
    struct document *old = NULL;
    (void)pthread_mutex_lock(&documents->lock);
    if (slot->document != NULL && uuid_equal(&slot->id, id)) {
        old = slot->document;
        slot->document = NULL;
    }
    (void)pthread_mutex_unlock(&documents->lock);
    document_release(old);
}
