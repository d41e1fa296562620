/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_SERVICE_H
#define ISCHIA_SERVER_SERVICE_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "server/audit.h"
#include "server/auth.h"
#include "server/config.h"
#include "server/estimator.h"
#include "server/events.h"
#include "server/http/documents.h"
#include "server/http/http.h"
#include "server/queue.h"
#include "server/rate.h"
#include "server/store/store.h"
#include "server/trust.h"

/* What the routes work with. The daemon's main owns the parts. */
struct service {
    struct http_server *http;
    struct store *store;
    struct queue *queue;
    struct events *events;
    struct auth *auth;
    struct audit *audit;
    struct rate *rate;
    struct documents *documents; /* finished documents, rendered */
    struct estimator *estimator; /* NULL: none is installed */
    struct trust *trust;         /* who may call CDS services; NULL: as everywhere, by token */
    /* Read at every request and changed by SIGHUP, hence atomic; the rest of config is constant. */
    struct config config;
    atomic_int rate_limit, rate_burst;
    bool on_loopback; /* listens there only */
    atomic_bool draining;
};

/* The options that SIGHUP may change, from config to the parts that go by them. */
void service_apply(struct service *service);

/* The application that http_start wants. */
struct http_app service_app(struct service *service);

struct route;

/* What a callback on another thread answers; two owners: the call and the callback. */
struct deferred {
    atomic_int owners;
    atomic_bool done;
    struct http_exchange *exchange; /* held until the callback has run */
    enum ischia_code code;
    struct ischia_error err;
    struct store_accepted accepted;
    char *bytes;
    size_t size;
};

/* One request on its way through a route. */
struct call {
    struct service *service;
    struct http_request *request;
    const struct route *route; /* NULL: no such path */
    unsigned allowed;          /* methods that the path takes, bit by enum http_method */
    char lang_query[16];       /* "?lang=fr" when the address asks for a language, else ""     */
    int accepted;              /* which of the route's media types the client likes best */
    struct auth_identity who;
    char client[80]; /* rate limits and idempotency keys are by this: token or address */
    struct uuid id;
    char id_text[UUID_TEXT_BYTES]; /* "" when the path has none, or none that can be one */
    char rest[256];                /* what "{file}" stands for */
    int64_t deadline_ms;           /* of a wait */
    struct events_subscription *subscription;
    struct deferred *deferred;
};

/* A deferred for this call; NULL when there is no memory. The callback ends with
 * deferred_complete, the call with deferred_drop (call_finish does it). */
struct deferred *deferred_create(struct call *call);
void deferred_complete(struct deferred *deferred);
void deferred_drop(struct deferred *deferred);

/* Asks to be called again when something happens to the assessment, or at deadline_ms. */
void call_wait(struct call *call, struct http_response *response);
/* Subscribes the call to its assessment's events, once. */
bool call_subscribe(struct call *call);
/* True while there is a reason to wait for the end of the assessment. ended: it has. */
bool call_still_waits(const struct call *call, bool ended);

#endif
