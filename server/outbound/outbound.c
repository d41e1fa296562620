/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/outbound/outbound.h"

#include <pthread.h>
#include <sodium.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "server/intake.h"
#include "server/log.h"
#include "server/outbound/target.h"
#include "server/outbound/web.h"

enum { LOOK_MS = 1000, PAUSE_FIRST_MS = 1000, PAUSE_DOUBLINGS_MAX = 20 };
enum { TARGET_COUNT = 3 };

static const struct target *const targets[TARGET_COUNT] = {&target_webhook, &target_fhir,
                                                           &target_hl7};

struct outbound {
    const struct config *config;
    struct store *store;
    atomic_bool stopping;
    pthread_mutex_t lock;
    pthread_cond_t woken;
    uint64_t wakes; /* guarded by lock */
    struct runner {
        struct outbound *outbound;
        const struct target *target;
        void *state;
        pthread_t thread;
        bool is_open, runs;
        int64_t seen_seq; /* of the change log                           */
        int64_t paused_until_ms;
        int failures;         /* in a row, of a target that is down          */
        struct record record; /* of the delivery under way                  */
    } runner[TARGET_COUNT];
};

static int64_t unix_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* 1 s, 2 s, 4 s … up to outbound_pause, less up to a fifth so that many do not come at once. */
static int64_t pause_ms(const struct outbound *outbound, int failures)
{
    const int64_t most = (int64_t)outbound->config->outbound_pause_s * 1000;
    const int doublings = failures < PAUSE_DOUBLINGS_MAX ? failures : PAUSE_DOUBLINGS_MAX;
    int64_t pause = (int64_t)PAUSE_FIRST_MS << doublings;
    if (pause > most) pause = most;
    return pause - (int64_t)randombytes_uniform((uint32_t)(pause / 5 + 1));
}

static void complain(const struct runner *r, const struct ischia_error *err)
{
    struct log_value quoted;
    LOG_ERROR("delivery failed", "target=%s code=%s detail=%s", r->target->name,
              ischia_code_name(err->code), log_quote(&quoted, err->message));
}

/* ------------------------------------------------------------------------- one delivery */

static enum outcome deliver(struct runner *r, const struct store_delivery *row,
                            const struct store_assessment *assessment,
                            char problem[TARGET_PROBLEM_BYTES])
{
    struct ischia_error err;
    const struct delivery delivery = {.config = r->outbound->config,
                                      .stopping = &r->outbound->stopping,
                                      .row = row,
                                      .assessment = assessment,
                                      .record = &r->record,
                                      .problem = problem};
    problem[0] = '\0';
    if (intake_record(&r->record, assessment, &err) == ISCHIA_OK)
        return r->target->deliver(r->state, &delivery);
    complain(r, &err);
    (void)snprintf(problem, TARGET_PROBLEM_BYTES, "the assessment cannot be read");
    return OUTCOME_REFUSED;
}

static void note(const struct runner *r, const struct store_delivery *row, const char *what,
                 const char *problem)
{
    char id[UUID_TEXT_BYTES];
    struct log_value quoted;
    uuid_format(&row->id, id);
    LOG_WARNING("delivery", "target=%s id=%s what=%s attempts=%d detail=%s", r->target->name, id,
                what, row->attempts + 1, log_quote(&quoted, problem));
}

static enum ischia_code settle(struct runner *r, const struct store_delivery *row,
                               enum outcome outcome, const char *problem, struct ischia_error *err)
{
    struct outbound *outbound = r->outbound;
    const int64_t now_ms = unix_ms();
    const int64_t life_ms = (int64_t)outbound->config->outbound_days * 24 * 3600 * 1000;
    if (outcome == OUTCOME_DELIVERED) {
        r->failures = 0;
        return store_outbox_done(outbound->store, row->seq, err);
    }
    if (atomic_load(&outbound->stopping)) return ISCHIA_OK; /* our own doing: not counted */
    const bool over = outcome == OUTCOME_NEVER || now_ms - row->created_ms > life_ms;
    note(r, row, over ? "given up" : "later again", problem);
    if (outcome == OUTCOME_DOWN) r->paused_until_ms = now_ms + pause_ms(outbound, r->failures++);
    return store_outbox_retry(outbound->store, row->seq, now_ms + pause_ms(outbound, row->attempts),
                              over, problem, err);
}

/* Delivers what is due first. *ret_again: there may be more to do at once. */
static enum ischia_code step(struct runner *r, bool *ret_again, struct ischia_error *err)
{
    struct store *store = r->outbound->store;
    struct store_delivery row = {0};
    struct store_assessment assessment;
    char problem[TARGET_PROBLEM_BYTES] = "";
    enum store_answer answer = STORE_NOT_FOUND;
    int64_t due_ms = 0;
    *ret_again = false;
    if (unix_ms() < r->paused_until_ms) return ISCHIA_OK;
    TRY(store_outbox_next(store, r->target->name, unix_ms(), &row, &due_ms, &answer, err));
    if (answer != STORE_DONE) return ISCHIA_OK;
    memset(&assessment, 0, sizeof assessment);
    TRY(store_get(store, &row.id, &assessment, &answer, err));
    *ret_again = true;
    if (answer != STORE_DONE) return store_outbox_done(store, row.seq, err); /* erased */
    const enum outcome outcome = deliver(r, &row, &assessment, problem);
    store_assessment_finish(&assessment);
    return settle(r, &row, outcome, problem, err);
}

/* ---------------------------------------------------------------------------- a target */

static bool ignore_change(void *context, const struct store_change *change)
{
    (void)context, (void)change;
    return false;
}

/* Reads the change log when it has grown. */
static enum ischia_code fill(struct runner *r, struct ischia_error *err)
{
    int64_t last = 0;
    struct store *store = r->outbound->store;
    TRY(store_changes(store, r->seen_seq, 1, ignore_change, NULL, &last, err));
    if (last == r->seen_seq) return ISCHIA_OK;
    TRY(store_outbox_fill(store, r->target->name, err));
    r->seen_seq = last;
    return ISCHIA_OK;
}

static void wait_a_while(struct outbound *outbound, uint64_t *seen_wakes)
{
    struct timespec until;
    (void)clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += LOOK_MS / 1000;
    (void)pthread_mutex_lock(&outbound->lock);
    while (outbound->wakes == *seen_wakes && !atomic_load(&outbound->stopping))
        if (pthread_cond_timedwait(&outbound->woken, &outbound->lock, &until) != 0) break;
    *seen_wakes = outbound->wakes;
    (void)pthread_mutex_unlock(&outbound->lock);
}

static void *run(void *argument)
{
    struct runner *r = argument;
    uint64_t wakes = 0;
    while (!atomic_load(&r->outbound->stopping)) {
        struct ischia_error err;
        bool again = false;
        enum ischia_code code = fill(r, &err);
        if (code == ISCHIA_OK) code = step(r, &again, &err);
        if (code != ISCHIA_OK) complain(r, &err);
        if (!again || code != ISCHIA_OK) wait_a_while(r->outbound, &wakes);
    }
    return NULL;
}

static enum ischia_code open_runner(struct runner *r, struct ischia_error *err)
{
    struct outbound *outbound = r->outbound;
    if (!r->target->is_wanted(outbound->config))
        return store_outbox_close(outbound->store, r->target->name, err);
    TRY(store_outbox_open(outbound->store, r->target->name, err));
    TRY(r->target->open(&r->state, outbound->config, err));
    r->is_open = true;
    CHECK(pthread_create(&r->thread, NULL, run, r) == 0, err, ISCHIA_E_MEMORY,
          "no thread for the target %s", r->target->name);
    r->runs = true;
    return ISCHIA_OK;
}

enum ischia_code outbound_create(struct outbound **ret, const struct config *config,
                                 struct store *store, struct ischia_error *err)
{
    TRY(web_start(err));
    struct outbound *outbound = calloc(1, sizeof *outbound);
    CHECK(outbound != NULL, err, ISCHIA_E_MEMORY, "no memory for deliveries");
    outbound->config = config;
    outbound->store = store;
    (void)pthread_mutex_init(&outbound->lock, NULL);
    (void)pthread_cond_init(&outbound->woken, NULL);
    enum ischia_code code = ISCHIA_OK;
    for (int i = 0; i < TARGET_COUNT && code == ISCHIA_OK; i++) {
        outbound->runner[i].outbound = outbound;
        outbound->runner[i].target = targets[i];
        code = open_runner(&outbound->runner[i], err);
    }
    if (code != ISCHIA_OK) {
        outbound_destroy(outbound);
        return code;
    }
    *ret = outbound;
    return ISCHIA_OK;
}

void outbound_wake(struct outbound *outbound)
{
    if (outbound == NULL) return;
    (void)pthread_mutex_lock(&outbound->lock);
    outbound->wakes++;
    (void)pthread_cond_broadcast(&outbound->woken);
    (void)pthread_mutex_unlock(&outbound->lock);
}

void outbound_destroy(struct outbound *outbound)
{
    if (outbound == NULL) return;
    atomic_store(&outbound->stopping, true);
    outbound_wake(outbound);
    for (int i = 0; i < TARGET_COUNT; i++) {
        struct runner *r = &outbound->runner[i];
        if (r->runs) (void)pthread_join(r->thread, NULL);
        if (r->is_open) r->target->close(r->state);
    }
    (void)pthread_mutex_destroy(&outbound->lock);
    (void)pthread_cond_destroy(&outbound->woken);
    free(outbound);
    web_finish();
}
