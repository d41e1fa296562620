/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One lock guards everything. A topic that somebody subscribes to or that had an event is in a
 * hash table by its id; its events are a ring.
 */
#include "server/events.h"

#include <assert.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { BUCKETS = 1024 };

const char *const event_kind_names[EVENT_KIND_COUNT] = {
    [EVENT_PROGRESS] = "progress", [EVENT_STATE] = "state", [EVENT_DONE] = "done"};

struct topic {
    struct uuid id;
    struct topic *next; /* in its bucket */
    struct events_subscription *listeners;
    struct event ring[EVENTS_RING];
    size_t count;     /* in the ring */
    size_t oldest;    /* index of the oldest */
    int64_t ended_ms; /* when it was done; 0: not yet */
};

struct events_subscription {
    struct events *events;
    struct topic *topic;
    events_notify *notify;
    void *context;
    struct events_subscription *next;
};

struct events {
    pthread_mutex_t lock;
    struct topic *bucket[BUCKETS];
    uint64_t last_id;
    size_t subscribers;
};

static int64_t now_us(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

enum ischia_code events_create(struct events **ret_events, struct ischia_error *err)
{
    struct events *events = calloc(1, sizeof *events);
    CHECK(events != NULL, err, ISCHIA_E_MEMORY, "no memory for events");
    (void)pthread_mutex_init(&events->lock, NULL);
    events->last_id = (uint64_t)now_us();
    *ret_events = events;
    return ISCHIA_OK;
}

void events_destroy(struct events *events)
{
    if (events == NULL) return;
    assert(events->subscribers == 0);
    for (size_t b = 0; b < BUCKETS; b++)
        while (events->bucket[b] != NULL) {
            struct topic *topic = events->bucket[b];
            events->bucket[b] = topic->next;
            free(topic);
        }
    (void)pthread_mutex_destroy(&events->lock);
    free(events);
}

/* The last bytes of a version 7 id are random: as good as any hash. */
static struct topic **bucket_of(struct events *events, const struct uuid *id)
{
    const size_t mix = (size_t)id->byte[UUID_BYTES - 1] | (size_t)id->byte[UUID_BYTES - 2] << 8;
    return &events->bucket[mix % BUCKETS];
}

static struct topic *find(struct events *events, const struct uuid *id)
{
    struct topic *topic = *bucket_of(events, id);
    while (topic != NULL && !uuid_equal(&topic->id, id)) topic = topic->next;
    return topic;
}

/* NULL when there is no memory. */
static struct topic *find_or_make(struct events *events, const struct uuid *id)
{
    struct topic *topic = find(events, id);
    if (topic != NULL) return topic;
    topic = calloc(1, sizeof *topic);
    if (topic == NULL) return NULL;
    struct topic **bucket = bucket_of(events, id);
    topic->id = *id;
    topic->next = *bucket;
    *bucket = topic;
    return topic;
}

enum ischia_code events_subscribe(struct events *events, const struct uuid *id,
                                  events_notify *notify, void *context,
                                  struct events_subscription **ret, struct ischia_error *err)
{
    struct events_subscription *subscription = calloc(1, sizeof *subscription);
    CHECK(subscription != NULL, err, ISCHIA_E_MEMORY, "no memory for an event stream");
    *subscription =
        (struct events_subscription){.events = events, .notify = notify, .context = context};
    (void)pthread_mutex_lock(&events->lock);
    struct topic *topic = find_or_make(events, id);
    if (topic != NULL) {
        subscription->topic = topic;
        subscription->next = topic->listeners;
        topic->listeners = subscription;
        events->subscribers++;
    }
    (void)pthread_mutex_unlock(&events->lock);
    if (topic == NULL) {
        free(subscription);
        return FAIL(err, ISCHIA_E_MEMORY, "no memory for an event stream");
    }
    *ret = subscription;
    return ISCHIA_OK;
}

void events_unsubscribe(struct events_subscription *subscription)
{
    if (subscription == NULL) return;
    struct events *events = subscription->events;
    (void)pthread_mutex_lock(&events->lock);
    struct events_subscription **link = &subscription->topic->listeners;
    while (*link != subscription) link = &(*link)->next;
    *link = subscription->next;
    events->subscribers--;
    (void)pthread_mutex_unlock(&events->lock);
    free(subscription);
}

/* The i-th event of the ring, oldest first. */
static struct event *event_at(struct topic *topic, size_t i)
{
    return &topic->ring[(topic->oldest + i) % EVENTS_RING];
}

size_t events_read(struct events *events, const struct uuid *id, uint64_t after,
                   struct event *ret_events, size_t room)
{
    size_t copied = 0;
    (void)pthread_mutex_lock(&events->lock);
    struct topic *topic = find(events, id);
    for (size_t i = 0; topic != NULL && i < topic->count && copied < room; i++)
        if (event_at(topic, i)->id > after) ret_events[copied++] = *event_at(topic, i);
    (void)pthread_mutex_unlock(&events->lock);
    return copied;
}

bool events_fraction(struct events *events, const struct uuid *id, double *ret_fraction)
{
    bool known = false;
    (void)pthread_mutex_lock(&events->lock);
    struct topic *topic = find(events, id);
    if (topic != NULL && topic->count > 0) {
        const struct event *last = event_at(topic, topic->count - 1);
        known = last->kind == EVENT_PROGRESS;
        if (known) *ret_fraction = last->fraction;
    }
    (void)pthread_mutex_unlock(&events->lock);
    return known;
}

static void append(struct topic *topic, const struct event *event)
{
    if (topic->count == EVENTS_RING) {
        topic->oldest = (topic->oldest + 1) % EVENTS_RING;
        topic->count--;
    }
    *event_at(topic, topic->count++) = *event;
}

/* Under the lock. topic: NULL allowed. */
static void tell(struct events *events, struct topic *topic, const struct event *event)
{
    struct event numbered = *event;
    numbered.at_ms = now_us() / 1000;
    numbered.id = ++events->last_id;
    if (topic == NULL) return;
    append(topic, &numbered);
    if (event->kind == EVENT_DONE) topic->ended_ms = numbered.at_ms;
    for (struct events_subscription *s = topic->listeners; s != NULL; s = s->next)
        s->notify(s->context);
}

void events_publish(struct events *events, const struct uuid *id, const struct event *event)
{
    (void)pthread_mutex_lock(&events->lock);
    /* A subscriber has made its topic. Where there is none nobody waits, and the store says how it
     * ended: an end alone is not kept. */
    tell(events, event->kind == EVENT_DONE ? find(events, id) : find_or_make(events, id), event);
    (void)pthread_mutex_unlock(&events->lock);
}

void events_erased(struct events *events, const struct uuid *id)
{
    const struct event done = {.kind = EVENT_DONE, .state = QUEUE_CANCELLED};
    (void)pthread_mutex_lock(&events->lock);
    struct topic *topic = find(events, id);
    if (topic != NULL && topic->ended_ms == 0) tell(events, topic, &done);
    (void)pthread_mutex_unlock(&events->lock);
}

/* Also forgets topics without events: somebody listened to an id about which nothing happened. */
static bool is_stale(const struct topic *topic, int64_t now_ms, int64_t age_ms, int64_t silent_ms)
{
    if (topic->listeners != NULL) return false;
    if (topic->count == 0) return true;
    const int64_t last_ms = topic->ring[(topic->oldest + topic->count - 1) % EVENTS_RING].at_ms;
    if (now_ms - last_ms >= silent_ms) return true;
    return topic->ended_ms != 0 && now_ms - topic->ended_ms >= age_ms;
}

void events_sweep(struct events *events, int64_t age_ms, int64_t silent_ms)
{
    const int64_t now_ms = now_us() / 1000;
    (void)pthread_mutex_lock(&events->lock);
    for (size_t b = 0; b < BUCKETS; b++)
        for (struct topic **link = &events->bucket[b]; *link != NULL;) {
            struct topic *topic = *link;
            if (!is_stale(topic, now_ms, age_ms, silent_ms)) {
                link = &topic->next;
                continue;
            }
            *link = topic->next;
            free(topic);
        }
    (void)pthread_mutex_unlock(&events->lock);
}

size_t events_subscriber_count(struct events *events)
{
    (void)pthread_mutex_lock(&events->lock);
    const size_t count = events->subscribers;
    (void)pthread_mutex_unlock(&events->lock);
    return count;
}
