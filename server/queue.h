/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_QUEUE_H
#define ISCHIA_SERVER_QUEUE_H

#include "server/events.h"
#include "server/pool.h"
#include "server/queue_state.h"
#include "server/store/store.h"
#include "server/store/studies.h"

/*
 * The queue ties store, pool and events together: what is durable is in the store, what runs is in
 * the pool, what people watch is in events. It holds the rules of docs/INVARIANTS.md: nothing
 * accepted is lost, nothing ends twice, nothing stays stuck.
 *
 * A worker's death on a job is retried once and then fails the job with the reason. A job over its
 * deadline fails at once: the same case takes the same time again. When the store cannot take an
 * outcome (disk full) the queue keeps it and offers it again, and claims nothing meanwhile.
 *
 * Points of studies are solved when no assessment waits. An assessment that finds every worker busy
 * takes the place of the point that was begun last, which goes back and is solved again later.
 */

struct queue;

struct queue_options {
    struct pool_options pool;
    int queued_max;       /* more are refused with STORE_FULL; 0: no limit                       */
    int crashes_max;      /* worker deaths that a job survives; < 0: none; 0: 1                  */
    const char *emulator; /* digest of the one that the workers have, for the call; NULL: none */
};

/* For logs and metrics; called on the pool's thread, any may be NULL. None of the texts identifies
 * a person. */
struct queue_watcher {
    void *context;
    /* on_finished: also of a solve that was cancelled; not of what is cancelled while it waits. */
    void (*on_note)(void *context, const struct pool_note *note);
    void (*on_finished)(void *context, const struct uuid *id, enum queue_state state,
                        enum pool_end end, int64_t wall_ms, const char *detail);
    /* A point of a study was solved, failed, was cancelled, or goes back (QUEUE_QUEUED). */
    void (*on_point)(void *context, enum queue_state state, enum pool_end end, int64_t wall_ms);
    void (*on_store_error)(void *context, const struct ischia_error *err);
};

/* Recovers what was running when the last daemon died, starts the pool. store and events stay the
 * caller's and must outlive the queue. */
ISCHIA_MUST_CHECK enum ischia_code queue_create(struct store *store, struct events *events,
                                                const struct queue_options *options,
                                                const struct queue_watcher *watcher,
                                                struct queue **ret_queue, struct ischia_error *err);

/* The identity of a solve: equal keys give equal results. Over the canonical case text, the model's
 * name and version and, where the case asks for an interval, the emulator that it is made with. */
void queue_case_key(const struct queue *queue, const char *case_json,
                    unsigned char ret_key[STORE_DIGEST_BYTES]);

/* store_accept / store_accept_later, and the workers are woken. what->queued_max and case_key are
 * filled in here. After queue_drain: ISCHIA_E_STATE. */
ISCHIA_MUST_CHECK enum ischia_code queue_accept(struct queue *queue, const struct store_new *what,
                                                struct store_accepted *ret,
                                                struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code
queue_accept_later(struct queue *queue, const struct store_new *what, store_accept_done *done,
                   void *context, struct ischia_error *err);

/* Cancels durably, then ends the worker. STORE_CONFLICT when it has ended already (*ret_was). */
ISCHIA_MUST_CHECK enum ischia_code
queue_cancel(struct queue *queue, const struct uuid *id, enum queue_state *ret_was,
             enum store_answer *ret_answer, struct ischia_error *err);

/* store_study_accept, and the workers are woken. The case keys are to be filled in already. After
 * queue_drain: ISCHIA_E_STATE. */
ISCHIA_MUST_CHECK enum ischia_code
queue_accept_study(struct queue *queue, const struct store_study_new *what,
                   struct store_study_accepted *ret, struct ischia_error *err);

/* Cancels durably what is not over, then ends the workers that solve any of it. As
 * store_study_cancel. */
ISCHIA_MUST_CHECK enum ischia_code queue_cancel_study(struct queue *queue, const struct uuid *id,
                                                      enum store_answer *ret_answer,
                                                      struct ischia_error *err);

struct pool *queue_pool(struct queue *queue); /* for renders and stats */

/* Another queued_max, for what comes from now on. Any thread. */
void queue_set_limit(struct queue *queue, int queued_max);

/* Accepts and starts nothing more; running solves go on. Does not wait. */
void queue_drain(struct queue *queue);

/* Drains; running solves have grace_ms to end, then they go back into the queue. NULL allowed. */
void queue_destroy(struct queue *queue, int grace_ms);

#endif
