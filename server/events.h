/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_EVENTS_H
#define ISCHIA_SERVER_EVENTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/queue_state.h"
#include "server/uuid.h"
#include "solver/error.h"

/*
 * What happens to assessments right now, for event streams and for callers that wait. Held in
 * memory only: the store says how an assessment ended, this says that it just did.
 *
 * A topic is one assessment. It keeps its last EVENTS_RING events so that a stream that reconnects
 * with Last-Event-ID misses nothing it can still use; it goes away some time after its end when
 * nobody listens. Ids increase over all topics and over restarts of the daemon (they begin at the
 * start time in microseconds). Every function may be called from any thread.
 *
 * How to wait without a gap: subscribe first, then look into the store; if it is final there, do
 * not wait; otherwise the `done` event is still to come.
 */

enum { EVENTS_RING = 64, EVENTS_MESSAGE_BYTES = 96 };

enum event_kind { EVENT_PROGRESS, EVENT_STATE, EVENT_DONE, EVENT_KIND_COUNT };
extern const char *const event_kind_names[EVENT_KIND_COUNT]; /* "progress", "state", "done" */

struct event {
    uint64_t id; /* filled in by events_publish; never 0                                      */
    enum event_kind kind;
    enum queue_state state; /* after the event; final exactly for EVENT_DONE                   */
    int64_t at_ms;
    double fraction; /* 0 ... 1                                                                */
    int load_step, newton_iteration;
    double F_N;
    char message[EVENTS_MESSAGE_BYTES];
};

struct events;
struct events_subscription;

/* *ret_events is the caller's to destroy. */
ISCHIA_MUST_CHECK enum ischia_code events_create(struct events **ret_events,
                                                 struct ischia_error *err);
/* Every subscription must be gone. NULL allowed. */
void events_destroy(struct events *events);

/* Told that there is something new, on the publishing thread and under a lock: be quick (resume a
 * connection, set a flag), call nothing of events from it. */
typedef void events_notify(void *context);

/* Listens to one assessment, whether or not anything was published about it yet. After
 * events_unsubscribe has returned, notify is not running and will not be called. */
ISCHIA_MUST_CHECK enum ischia_code
events_subscribe(struct events *events, const struct uuid *id, events_notify *notify, void *context,
                 struct events_subscription **ret, struct ischia_error *err);
void events_unsubscribe(struct events_subscription *subscription); /* NULL allowed */

/* Copies at most `room` events of the topic with id > after, oldest first; returns how many. */
size_t events_read(struct events *events, const struct uuid *id, uint64_t after,
                   struct event *ret_events, size_t room);

/* The latest progress fraction of a running assessment; false when none is known. */
bool events_fraction(struct events *events, const struct uuid *id, double *ret_fraction);

/* Publishes one event (its id and at_ms are filled in here) and wakes who listens. A full ring
 * drops its oldest. Only an event that nobody listens to can be dropped for want of memory. */
void events_publish(struct events *events, const struct uuid *id, const struct event *event);

/* Its assessment was erased: who listens is told that it is over, as cancelled, unless it had ended
 * before. */
void events_erased(struct events *events, const struct uuid *id);

/* Forgets topics without a subscriber that ended at least `age_ms` ago, or about which nothing was
 * heard for `silent_ms`: their end may never come, when a backup without them was restored say. */
void events_sweep(struct events *events, int64_t age_ms, int64_t silent_ms);
enum { EVENTS_SILENT_MS = 24 * 3600 * 1000 };

/* How many subscriptions there are, over all topics. */
size_t events_subscriber_count(struct events *events);

#endif
