/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * The writer thread and its group commit: whatever waits when a commit ends goes into the next one.
 * With n callers waiting one fsync serves all n, so that accepting gets cheaper under load.
 */
#include <semaphore.h>
#include <signal.h>
#include <string.h>
#include <time.h>

#include "server/store/engine.h"

enum { SCRUB_AGAIN_S = 1 };

const double store_latency_bound_ms[STORE_LATENCY_BUCKETS - 1] = {
    0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 250.0, 1000.0, 5000.0,
};

static double monotonic_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}

/* ------------------------------------------------------------------------- transactions */

/* One write. A code means that the whole transaction is lost; the write's own failure is in
 * write->code. */
static enum ischia_code run_one(struct store *store, struct write *write, struct ischia_error *err)
{
    struct db *db = store->writer;
    const struct engine *engine = store->engine;
    if (engine->undoes_one) TRY(engine->mark(db, err));
    write->code = write->run(store, db, write->operation, &write->err);
    const bool kept = write->code == ISCHIA_OK;
    store->audit_head.known &= kept; /* it may have been moved by what is undone */
    if (engine->undoes_one && engine->is_in_transaction(db)) return engine->keep(db, !kept, err);
    if (!kept && err != NULL) *err = write->err;
    return write->code;
}

/* Inside a transaction that has begun; ends it. */
static enum ischia_code run_batch(struct store *store, struct write *first, struct write *end,
                                  struct ischia_error *err)
{
    enum ischia_code code = ISCHIA_OK;
    store->audit_head.known = false;
    for (struct write *w = first; w != end && code == ISCHIA_OK; w = w->next)
        code = run_one(store, w, err);
    if (code == ISCHIA_OK) code = store->engine->commit(store->writer, err);
    if (code != ISCHIA_OK) store->engine->roll_back(store->writer);
    return code;
}

/* Each in a commit of its own: one that is too large for the disk must not fail its neighbours. A
 * commit on a connection that was lost may have been made or not: nobody is told that it was. */
static void run_singly(struct store *store, struct write *first, struct write *end)
{
    for (struct write *w = first; w != end; w = w->next) {
        struct ischia_error err = {0};
        enum ischia_code code = store->engine->begin(store, store->writer, &err);
        if (code == ISCHIA_OK) code = run_batch(store, w, w->next, &err);
        if (code == ISCHIA_OK) continue;
        w->code = code;
        w->err = err;
    }
}

/* ------------------------------------------------------------------------------ the thread */

static void note_latency(struct store *store, const struct write *write, double now_ms)
{
    const double took = now_ms - write->begun_ms;
    int bucket = 0;
    while (bucket < STORE_LATENCY_BUCKETS - 1 && took > store_latency_bound_ms[bucket]) bucket++;
    store->latency_count[bucket]++;
    store->latency_sum_ms += took;
    store->writes++;
    store->write_failures += write->code != ISCHIA_OK;
}

static void note_batch(struct store *store, const struct write *first, const struct write *end)
{
    const double now_ms = monotonic_ms();
    (void)pthread_mutex_lock(&store->write_lock);
    store->commits++;
    for (const struct write *w = first; w != end; w = w->next) note_latency(store, w, now_ms);
    (void)pthread_mutex_unlock(&store->write_lock);
}

static void finish_batch(struct store *store, struct write *first, struct write *end)
{
    for (struct write *w = first, *next; w != end; w = next) {
        next = w->next; /* before the owner is told: the write may be gone then */
        if (w->done != NULL)
            w->done(store, w);
        else
            (void)sem_post(w->waiter);
    }
}

/* Overwrites what was erased, where the engine leaves that to us; store->scrub stays set when it
 * could not be done now. */
static void scrub(struct store *store)
{
    if (store->scrub && store->engine->scrub != NULL)
        store->engine->scrub(store);
    else
        store->scrub = false;
}

static void commit_batch(struct store *store, struct write *first, struct write *end)
{
    struct ischia_error err = {0};
    enum ischia_code code = store->engine->begin(store, store->writer, &err);
    const bool begun = code == ISCHIA_OK;
    if (begun) code = run_batch(store, first, end, &err);
    if (begun && code != ISCHIA_OK && !store->engine->is_lost(store->writer)) {
        run_singly(store, first, end);
        code = ISCHIA_OK;
    }
    for (struct write *w = first; code != ISCHIA_OK && w != end; w = w->next) {
        w->code = code;
        w->err = err;
    }
    for (struct write *w = first; w != end; w = w->next)
        store->scrub |= w->erases && w->code == ISCHIA_OK;
    scrub(store);
    note_batch(store, first, end);
    finish_batch(store, first, end);
}

/* Waits for writes; on time-out (only when something is left to scrub) returns NULL too. */
static struct write *take_waiting(struct store *store, bool *ret_closing)
{
    (void)pthread_mutex_lock(&store->write_lock);
    struct timespec until;
    (void)clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += SCRUB_AGAIN_S;
    int timed_out = 0;
    while (store->first == NULL && !store->closing && timed_out == 0) {
        if (store->scrub)
            timed_out = pthread_cond_timedwait(&store->write_ready, &store->write_lock, &until);
        else
            (void)pthread_cond_wait(&store->write_ready, &store->write_lock);
    }
    struct write *first = store->first;
    store->first = NULL;
    store->last = &store->first;
    *ret_closing = store->closing;
    (void)pthread_mutex_unlock(&store->write_lock);
    return first;
}

static struct write *batch_end(struct write *first, int most)
{
    int count = 0;
    while (first != NULL && count++ < most) first = first->next;
    return first;
}

static void *writer_main(void *argument)
{
    struct store *store = argument;
    sigset_t all; /* signals are the main thread's */
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_BLOCK, &all, NULL);
    for (bool closing = false;;) {
        struct write *first = take_waiting(store, &closing);
        if (first == NULL && closing) return NULL;
        if (first == NULL) scrub(store);
        while (first != NULL) {
            struct write *end = batch_end(first, store->engine->batch_max);
            commit_batch(store, first, end);
            first = end;
        }
    }
}

enum ischia_code writer_start(struct store *store, struct ischia_error *err)
{
    const int code = pthread_create(&store->writer_thread, NULL, writer_main, store);
    CHECK(code == 0, err, ISCHIA_E_MEMORY, "the store's thread cannot start: %s", strerror(code));
    return ISCHIA_OK;
}

void writer_stop(struct store *store)
{
    (void)pthread_mutex_lock(&store->write_lock);
    store->closing = true;
    (void)pthread_cond_signal(&store->write_ready);
    (void)pthread_mutex_unlock(&store->write_lock);
    (void)pthread_join(store->writer_thread, NULL);
}

/* -------------------------------------------------------------------------- its customers */

enum ischia_code write_later(struct store *store, struct write *write, struct ischia_error *err)
{
    write->begun_ms = monotonic_ms();
    write->next = NULL;
    (void)pthread_mutex_lock(&store->write_lock);
    const bool closing = store->closing;
    if (!closing) {
        if (store->first == NULL) (void)pthread_cond_signal(&store->write_ready);
        *store->last = write;
        store->last = &write->next;
    }
    (void)pthread_mutex_unlock(&store->write_lock);
    CHECK(!closing, err, ISCHIA_E_STATE, "the store is closing");
    return ISCHIA_OK;
}

enum ischia_code write_run(struct store *store, struct write *write, struct ischia_error *err)
{
    sem_t committed;
    (void)sem_init(&committed, 0, 0);
    write->waiter = &committed;
    enum ischia_code code = write_later(store, write, err);
    if (code == ISCHIA_OK) {
        while (sem_wait(&committed) != 0) continue; /* a signal */
        code = write->code;
        if (code != ISCHIA_OK && err != NULL) *err = write->err;
    }
    (void)sem_destroy(&committed);
    return code;
}
