/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/queue.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/problem_doc.h"
#include "api/result_doc.h"
#include "server/digest.h"

enum { EVENTS_AGE_MS = 60 * 1000 };

/* What is to be written about a job that has ended. */
struct verdict {
    struct uuid id;
    int64_t line; /* of a study's point, whose id is the study's; 0: an assessment */
    int64_t attempt;
    enum queue_state to; /* succeeded, failed, or queued again */
    bool crashed;        /* queued again because its worker died */
    char *document;      /* result or problem */
    unsigned char *field;
    size_t field_size;
    enum pool_end end; /* for the watcher, as the two that follow */
    int64_t wall_ms;
    char detail[160];
    struct verdict *next; /* waiting for the store */
};

struct queue {
    struct store *store;
    struct events *events;
    struct pool *pool;
    atomic_int queued_max;
    int crashes_max;
    char emulator[DIGEST_HEX_BYTES]; /* that intervals are made with */
    struct queue_watcher watcher;
    atomic_bool draining;
    pthread_mutex_t lock; /* guards on_the_way */
    pthread_cond_t arrived;
    int on_the_way;                    /* requests that the store has not answered yet */
    struct verdict *owed, **last_owed; /* the pool's thread alone */
};

/* The text is canonical and holds no free words, so that nothing else in it reads like this. */
static bool asks_for_interval(const char *case_json)
{
    return strstr(case_json, "\"sd\":") != NULL;
}

void queue_case_key(const struct queue *queue, const char *case_json,
                    unsigned char ret_key[STORE_DIGEST_BYTES])
{
    enum { PARTS = 4 };
    static const unsigned char version[2] = {ISCHIA_MODEL_VERSION & 0xff,
                                             ISCHIA_MODEL_VERSION >> 8};
    const struct digest_part parts[PARTS] = {digest_text(case_json),
                                             digest_text(ISCHIA_MODEL_NAME),
                                             {version, sizeof version},
                                             digest_text(queue->emulator)};
    digest_parts(parts, asks_for_interval(case_json) ? PARTS : PARTS - 1, ret_key);
}

static void report_store_error(struct queue *queue, const struct ischia_error *err)
{
    if (queue->watcher.on_store_error != NULL)
        queue->watcher.on_store_error(queue->watcher.context, err);
}

static void publish_state(struct queue *queue, const struct uuid *id, enum queue_state state)
{
    const bool final = queue_is_final(state);
    const struct event event = {.kind = final ? EVENT_DONE : EVENT_STATE,
                                .state = state,
                                .fraction = state == QUEUE_SUCCEEDED ? 1.0 : 0.0};
    events_publish(queue->events, id, &event);
}

/* ------------------------------------------------------------------------------ verdicts */

static void verdict_finish(struct verdict *verdict)
{
    free(verdict->document);
    free(verdict->field);
}

static void announce_point(struct queue *queue, const struct verdict *verdict)
{
    if (queue->watcher.on_point != NULL)
        queue->watcher.on_point(queue->watcher.context, verdict->to, verdict->end,
                                verdict->wall_ms);
}

static void announce(struct queue *queue, const struct verdict *verdict)
{
    if (verdict->line != 0) {
        announce_point(queue, verdict);
        return;
    }
    publish_state(queue, &verdict->id, verdict->to);
    if (queue_is_final(verdict->to) && queue->watcher.on_finished != NULL)
        queue->watcher.on_finished(queue->watcher.context, &verdict->id, verdict->to, verdict->end,
                                   verdict->wall_ms, verdict->detail);
}

static enum ischia_code write_verdict(struct queue *queue, const struct verdict *v,
                                      enum store_answer *ret_answer, struct ischia_error *err)
{
    if (v->line != 0)
        return store_study_settle(queue->store, &v->id, v->line, v->attempt, v->to, v->document,
                                  v->crashed, ret_answer, err);
    switch (v->to) {
    case QUEUE_SUCCEEDED:
        return store_succeed(queue->store, &v->id, v->attempt, v->document, v->field, v->field_size,
                             ret_answer, err);
    case QUEUE_FAILED:
        return store_fail(queue->store, &v->id, v->attempt, v->document, ret_answer, err);
    default:
        return store_requeue(queue->store, &v->id, v->attempt, v->crashed, ret_answer, err);
    }
}

/* Whoever cancelled it has told those who wait; that its solve is over is told here. */
static void announce_if_cancelled(struct queue *queue, const struct verdict *verdict)
{
    struct store_assessment a = {0};
    struct ischia_error err = {0};
    enum store_answer answer = STORE_NOT_FOUND;
    if (verdict->line != 0 || queue->watcher.on_finished == NULL) return;
    if (store_peek(queue->store, &verdict->id, &a, &answer, &err) != ISCHIA_OK)
        report_store_error(queue, &err);
    else if (answer == STORE_DONE && a.state == QUEUE_CANCELLED)
        queue->watcher.on_finished(queue->watcher.context, &verdict->id, a.state, verdict->end,
                                   verdict->wall_ms, verdict->detail);
}

/* False when the store could not take it now. STORE_CONFLICT: it was cancelled, or restored from a
 * backup, meanwhile: what the worker found is no longer wanted. */
static bool settle(struct queue *queue, const struct verdict *verdict)
{
    struct ischia_error err = {0};
    enum store_answer answer = STORE_CONFLICT;
    if (write_verdict(queue, verdict, &answer, &err) != ISCHIA_OK) {
        report_store_error(queue, &err);
        return false;
    }
    if (answer == STORE_DONE) announce(queue, verdict);
    if (answer == STORE_CONFLICT) announce_if_cancelled(queue, verdict);
    return true;
}

/* Keeps it for later. When there is not even memory for that the job stays `running` in the store
 * and is solved again after the next start. */
static void owe(struct queue *queue, struct verdict *verdict)
{
    struct verdict *copy = malloc(sizeof *copy);
    if (copy == NULL) {
        verdict_finish(verdict);
        return;
    }
    *copy = *verdict;
    copy->next = NULL;
    *queue->last_owed = copy;
    queue->last_owed = &copy->next;
}

/* False while the store takes nothing. */
static bool pay_what_is_owed(struct queue *queue)
{
    while (queue->owed != NULL) {
        struct verdict *verdict = queue->owed;
        if (!settle(queue, verdict)) return false;
        queue->owed = verdict->next;
        if (queue->owed == NULL) queue->last_owed = &queue->owed;
        verdict_finish(verdict);
        free(verdict);
    }
    return true;
}

/* Takes over what *verdict owns. */
static void settle_or_owe(struct queue *queue, struct verdict *verdict)
{
    if (settle(queue, verdict))
        verdict_finish(verdict);
    else
        owe(queue, verdict);
}

/* ------------------------------------------------------------------- judging an outcome */

static bool result_holds(const char *document)
{
    struct ischia_result result;
    struct result_model model;
    struct ischia_error err;
    return result_doc_read(&result, &model, document, strlen(document), &json_limits_stored,
                           &err) == ISCHIA_OK &&
           ischia_result_converged(&result) && ischia_result_is_valid(&result) &&
           strcmp(model.name, ISCHIA_MODEL_NAME) == 0 && model.version == ISCHIA_MODEL_VERSION;
}

static bool problem_holds(const char *document)
{
    struct problem problem;
    struct ischia_error err;
    return problem_doc_read(&problem, document, strlen(document), &err) == ISCHIA_OK;
}

/* Fails the job with a problem of our own; without memory for one it goes back into the queue. */
static void fail_with(struct verdict *verdict, enum problem_kind kind, const char *detail)
{
    struct problem problem;
    struct ischia_error err;
    problem_init(&problem, kind, "%s", detail);
    const bool written = problem_doc_text(&verdict->document, &problem, &err) == ISCHIA_OK;
    verdict->to = written ? QUEUE_FAILED : QUEUE_QUEUED;
}

static void judge_crash(const struct queue *queue, const struct pool_job *job, const char *detail,
                        struct verdict *verdict)
{
    if (job->crashes < queue->crashes_max) {
        verdict->to = QUEUE_QUEUED;
        verdict->crashed = true;
        return;
    }
    char words[sizeof verdict->detail + 120];
    (void)snprintf(words, sizeof words, "the worker that solved it: %s%s", detail,
                   job->crashes > 0 ? "; the attempt before ended in the same way or alike" : "");
    fail_with(verdict, PROBLEM_WORKER_DIED, words);
}

/* A study keeps no fields. */
static bool copy_document(struct verdict *verdict, const struct pool_outcome *outcome)
{
    const size_t size = verdict->line == 0 ? outcome->field_size : 0;
    verdict->document = strdup(outcome->document);
    verdict->field = malloc(size > 0 ? size : 1);
    if (verdict->document == NULL || verdict->field == NULL) return false;
    if (size > 0) memcpy(verdict->field, outcome->field, size);
    verdict->field_size = size;
    return true;
}

static void judge_answer(const struct queue *queue, const struct pool_job *job,
                         const struct pool_outcome *outcome, struct verdict *verdict)
{
    const bool solved = outcome->end == POOL_RESULT;
    const bool holds = solved ? result_holds(outcome->document) : problem_holds(outcome->document);
    if (!holds) {
        judge_crash(queue, job, "the worker's answer did not hold what it must", verdict);
    } else if (copy_document(verdict, outcome)) {
        verdict->to = solved ? QUEUE_SUCCEEDED : QUEUE_FAILED;
    } else { /* no memory now: solve it again later */
        verdict_finish(verdict);
        verdict->document = NULL;
        verdict->field = NULL;
        verdict->to = QUEUE_QUEUED;
    }
}

static void on_outcome(void *context, const struct pool_job *job,
                       const struct pool_outcome *outcome)
{
    struct queue *queue = context;
    struct verdict verdict = {.id = job->id,
                              .line = job->line,
                              .attempt = job->attempt,
                              .to = QUEUE_QUEUED,
                              .end = outcome->end,
                              .wall_ms = outcome->wall_ms};
    (void)snprintf(verdict.detail, sizeof verdict.detail, "%.*s", (int)sizeof verdict.detail - 1,
                   outcome->detail);
    switch (outcome->end) {
    case POOL_RESULT:
    case POOL_PROBLEM:
        judge_answer(queue, job, outcome, &verdict);
        break;
    case POOL_CRASHED:
        judge_crash(queue, job, verdict.detail, &verdict);
        break;
    case POOL_DEADLINE:
        fail_with(&verdict, PROBLEM_TIME_LIMIT, verdict.detail);
        break;
    /* drained, yielded: back into the queue. Cancelled: the store refuses that, being there before
     * us. */
    default:
        break;
    }
    settle_or_owe(queue, &verdict);
}

/* --------------------------------------------------------------------------- giving jobs */

static void on_cached(void *context, const struct uuid *id)
{
    publish_state(context, id, QUEUE_SUCCEEDED);
}

/* The store failed in a claim; it may have been made all the same (the connection to a server was
 * lost in the commit). Then it is given back as soon as the store listens again. */
static void give_back(struct queue *queue, const struct uuid *id, int64_t line, int64_t attempt)
{
    struct verdict verdict = {
        .id = *id, .line = line, .attempt = attempt, .to = QUEUE_QUEUED, .end = POOL_DRAINED};
    if (attempt > 0) owe(queue, &verdict);
}

/* When nobody waits for an assessment. */
static bool next_point(struct queue *queue, struct pool_job *ret)
{
    struct store_study_claim claim = {0};
    struct ischia_error err = {0};
    enum store_answer answer = STORE_NOT_FOUND;
    if (store_study_claim_next(queue->store, &claim, &answer, &err) != ISCHIA_OK) {
        report_store_error(queue, &err);
        give_back(queue, &claim.study, claim.line, claim.attempt);
        return false;
    }
    if (answer != STORE_DONE) return false;
    *ret = (struct pool_job){.id = claim.study,
                             .line = claim.line,
                             .attempt = claim.attempt,
                             .crashes = claim.crashes,
                             .yields = true,
                             .case_json = claim.case_json};
    return true;
}

/* Assessments that wait. When the store cannot say, nobody is pressed. */
static int64_t pressing(void *context)
{
    struct queue *queue = context;
    struct store_stats stats;
    struct ischia_error err = {0};
    if (store_stats(queue->store, &stats, &err) == ISCHIA_OK) return stats.count[QUEUE_QUEUED];
    report_store_error(queue, &err);
    return 0;
}

static bool next_job(void *context, struct pool_job *ret)
{
    struct queue *queue = context;
    struct store_claim claim = {0};
    struct ischia_error err = {0};
    enum store_answer answer = STORE_NOT_FOUND;
    if (!pay_what_is_owed(queue)) return false; /* a solve that cannot be kept is a waste */
    if (store_claim_next(queue->store, on_cached, queue, &claim, &answer, &err) != ISCHIA_OK) {
        report_store_error(queue, &err);
        give_back(queue, &claim.id, 0, claim.attempt);
        return false;
    }
    if (answer != STORE_DONE) return next_point(queue, ret);
    publish_state(queue, &claim.id, QUEUE_RUNNING);
    *ret = (struct pool_job){.id = claim.id,
                             .attempt = claim.attempt,
                             .crashes = claim.crashes,
                             .case_json = claim.case_json};
    return true;
}

static void on_progress(void *context, const struct pool_job *job,
                        const struct pool_progress *progress)
{
    struct queue *queue = context;
    if (job->line != 0) return; /* nobody watches one point of a study */
    struct event event = {.kind = EVENT_PROGRESS,
                          .state = QUEUE_RUNNING,
                          .fraction = progress->fraction,
                          .load_step = progress->load_step,
                          .newton_iteration = progress->newton_iteration,
                          .F_N = progress->F_N};
    (void)snprintf(event.message, sizeof event.message, "%s", progress->message);
    events_publish(queue->events, &job->id, &event);
    struct store_progress told = {.fraction = progress->fraction,
                                  .load_step = progress->load_step,
                                  .newton_iteration = progress->newton_iteration,
                                  .F_N = progress->F_N};
    (void)snprintf(told.message, sizeof told.message, "%s", progress->message);
    store_tell_progress(queue->store, &job->id, &told);
}

static void on_note(void *context, const struct pool_note *note)
{
    struct queue *queue = context;
    if (queue->watcher.on_note != NULL) queue->watcher.on_note(queue->watcher.context, note);
}

static void on_tick(void *context)
{
    struct queue *queue = context;
    (void)pay_what_is_owed(queue);
    events_sweep(queue->events, EVENTS_AGE_MS, EVENTS_SILENT_MS);
}

/* ----------------------------------------------------------------- what other daemons do */

static const enum queue_state state_after[STORE_CHANGE_KIND_COUNT] = {
    [STORE_CHANGE_CREATED] = QUEUE_QUEUED,     [STORE_CHANGE_STARTED] = QUEUE_RUNNING,
    [STORE_CHANGE_REQUEUED] = QUEUE_QUEUED,    [STORE_CHANGE_SUCCEEDED] = QUEUE_SUCCEEDED,
    [STORE_CHANGE_FAILED] = QUEUE_FAILED,      [STORE_CHANGE_CANCELLED] = QUEUE_CANCELLED,
    [STORE_CHANGE_ERASED] = QUEUE_STATE_COUNT,
};

/* As if it had happened here: those who wait and watch here are told, and what runs here of it (it
 * was cancelled, or given to another) ends. */
static void on_change(void *context, const struct store_change *change)
{
    struct queue *queue = context;
    const enum queue_state state = state_after[change->kind];
    if (state == QUEUE_QUEUED) pool_wake(queue->pool);
    if (state == QUEUE_CANCELLED) pool_cancel(queue->pool, &change->id);
    if (change->kind == STORE_CHANGE_ERASED)
        events_erased(queue->events, &change->id);
    else if (change->kind != STORE_CHANGE_CREATED)
        publish_state(queue, &change->id, state);
}

static void on_progress_elsewhere(void *context, const struct uuid *id,
                                  const struct store_progress *progress)
{
    struct queue *queue = context;
    struct event event = {.kind = EVENT_PROGRESS,
                          .state = QUEUE_RUNNING,
                          .fraction = progress->fraction,
                          .load_step = progress->load_step,
                          .newton_iteration = progress->newton_iteration,
                          .F_N = progress->F_N};
    (void)snprintf(event.message, sizeof event.message, "%s", progress->message);
    events_publish(queue->events, id, &event);
}

static void on_work(void *context) { pool_wake(((struct queue *)context)->pool); }

static void on_study_cancelled(void *context, const struct uuid *id)
{
    pool_cancel(((struct queue *)context)->pool, id);
}

/* What this daemon runs may run elsewhere by now, and would be refused. */
static void on_lease_lost(void *context) { pool_cancel_all(((struct queue *)context)->pool); }

/* ----------------------------------------------------------------------- create, destroy */

static void free_queue(struct queue *queue)
{
    while (queue->owed != NULL) {
        struct verdict *verdict = queue->owed;
        queue->owed = verdict->next;
        verdict_finish(verdict);
        free(verdict);
    }
    (void)pthread_cond_destroy(&queue->arrived);
    (void)pthread_mutex_destroy(&queue->lock);
    free(queue);
}

static enum ischia_code start(struct queue *queue, const struct pool_options *options,
                              struct ischia_error *err)
{
    const struct pool_host host = {.context = queue,
                                   .next_job = next_job,
                                   .pressing = pressing,
                                   .on_progress = on_progress,
                                   .on_outcome = on_outcome,
                                   .on_note = on_note,
                                   .on_tick = on_tick};
    const struct store_watcher watcher = {.context = queue,
                                          .on_change = on_change,
                                          .on_progress = on_progress_elsewhere,
                                          .on_work = on_work,
                                          .on_study_cancelled = on_study_cancelled,
                                          .on_lease_lost = on_lease_lost};
    int requeued;
    TRY(store_recover(queue->store, &requeued, err));
    TRY(pool_create(options, &host, &queue->pool, err));
    store_watch(queue->store, &watcher);
    return ISCHIA_OK;
}

enum ischia_code queue_create(struct store *store, struct events *events,
                              const struct queue_options *options,
                              const struct queue_watcher *watcher, struct queue **ret_queue,
                              struct ischia_error *err)
{
    struct queue *queue = calloc(1, sizeof *queue);
    CHECK(queue != NULL, err, ISCHIA_E_MEMORY, "no memory for the queue");
    queue->store = store;
    queue->events = events;
    queue_set_limit(queue, options->queued_max);
    queue->crashes_max = options->crashes_max == 0 ? 1 : options->crashes_max;
    queue->last_owed = &queue->owed;
    (void)snprintf(queue->emulator, sizeof queue->emulator, "%s",
                   options->emulator == NULL ? "none" : options->emulator);
    (void)pthread_mutex_init(&queue->lock, NULL);
    (void)pthread_cond_init(&queue->arrived, NULL);
    if (watcher != NULL) queue->watcher = *watcher;
    const enum ischia_code code = start(queue, &options->pool, err);
    if (code != ISCHIA_OK) {
        free_queue(queue);
        return code;
    }
    *ret_queue = queue;
    return ISCHIA_OK;
}

/* Counts the requests whose answer will still use the queue. */
static void on_the_way(struct queue *queue, int change)
{
    (void)pthread_mutex_lock(&queue->lock);
    queue->on_the_way += change;
    (void)pthread_cond_broadcast(&queue->arrived);
    (void)pthread_mutex_unlock(&queue->lock);
}

static void wait_for_arrivals(struct queue *queue)
{
    (void)pthread_mutex_lock(&queue->lock);
    while (queue->on_the_way > 0) (void)pthread_cond_wait(&queue->arrived, &queue->lock);
    (void)pthread_mutex_unlock(&queue->lock);
}

void queue_drain(struct queue *queue)
{
    atomic_store(&queue->draining, true);
    pool_drain(queue->pool);
}

void queue_destroy(struct queue *queue, int grace_ms)
{
    if (queue == NULL) return;
    atomic_store(&queue->draining, true);
    store_watch(queue->store, NULL);
    wait_for_arrivals(queue);
    pool_destroy(queue->pool, grace_ms);
    (void)pay_what_is_owed(queue);
    free_queue(queue);
}

struct pool *queue_pool(struct queue *queue) { return queue->pool; }

void queue_set_limit(struct queue *queue, int queued_max)
{
    atomic_store_explicit(&queue->queued_max, queued_max, memory_order_relaxed);
}

/* ----------------------------------------------------------------------------- customers */

static enum ischia_code complete(const struct queue *queue, const struct store_new *what,
                                 struct store_new *ret, struct ischia_error *err)
{
    CHECK(!atomic_load(&queue->draining), err, ISCHIA_E_STATE, "the daemon is stopping");
    *ret = *what;
    ret->queued_max = atomic_load_explicit(&queue->queued_max, memory_order_relaxed);
    queue_case_key(queue, what->case_json, ret->case_key);
    return ISCHIA_OK;
}

enum ischia_code queue_accept(struct queue *queue, const struct store_new *what,
                              struct store_accepted *ret, struct ischia_error *err)
{
    struct store_new whole;
    TRY(complete(queue, what, &whole, err));
    TRY(store_accept(queue->store, &whole, ret, err));
    if (ret->acceptance == STORE_ACCEPTED) pool_wake(queue->pool);
    return ISCHIA_OK;
}

struct accept_later {
    struct queue *queue;
    store_accept_done *done;
    void *context;
};

static void on_accepted(void *context, enum ischia_code code, const struct store_accepted *accepted,
                        const struct ischia_error *err)
{
    struct accept_later *later = context;
    struct queue *queue = later->queue;
    if (code == ISCHIA_OK && accepted->acceptance == STORE_ACCEPTED) pool_wake(queue->pool);
    later->done(later->context, code, accepted, err);
    free(later);
    on_the_way(queue, -1);
}

enum ischia_code queue_accept_later(struct queue *queue, const struct store_new *what,
                                    store_accept_done *done, void *context,
                                    struct ischia_error *err)
{
    struct store_new whole;
    TRY(complete(queue, what, &whole, err));
    struct accept_later *later = malloc(sizeof *later);
    CHECK(later != NULL, err, ISCHIA_E_MEMORY, "no memory for a request");
    *later = (struct accept_later){queue, done, context};
    on_the_way(queue, 1);
    const enum ischia_code code = store_accept_later(queue->store, &whole, on_accepted, later, err);
    if (code == ISCHIA_OK) return ISCHIA_OK;
    free(later);
    on_the_way(queue, -1);
    return code;
}

enum ischia_code queue_cancel(struct queue *queue, const struct uuid *id, enum queue_state *ret_was,
                              enum store_answer *ret_answer, struct ischia_error *err)
{
    TRY(store_cancel(queue->store, id, ret_was, ret_answer, err));
    if (*ret_answer != STORE_DONE) return ISCHIA_OK;
    if (*ret_was == QUEUE_RUNNING) pool_cancel(queue->pool, id);
    publish_state(queue, id, QUEUE_CANCELLED);
    return ISCHIA_OK;
}

/* ------------------------------------------------------------------------------- studies */

enum ischia_code queue_accept_study(struct queue *queue, const struct store_study_new *what,
                                    struct store_study_accepted *ret, struct ischia_error *err)
{
    CHECK(!atomic_load(&queue->draining), err, ISCHIA_E_STATE, "the daemon is stopping");
    TRY(store_study_accept(queue->store, what, ret, err));
    if (ret->acceptance == STORE_ACCEPTED) pool_wake(queue->pool);
    return ISCHIA_OK;
}

enum ischia_code queue_cancel_study(struct queue *queue, const struct uuid *id,
                                    enum store_answer *ret_answer, struct ischia_error *err)
{
    TRY(store_study_cancel(queue->store, id, ret_answer, err));
    if (*ret_answer == STORE_DONE) pool_cancel(queue->pool, id);
    return ISCHIA_OK;
}
