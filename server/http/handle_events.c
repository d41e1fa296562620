/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/problem_doc.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/routes.h"
#include "server/metrics.h"

/*
 * GET …/events: server-sent events. Each event's id is the daemon's event number, so that a stream
 * that reconnects goes on behind the last one it saw (Last-Event-ID). A client that comes back
 * after `done` is told 204, which ends its reconnecting.
 */

enum { HEARTBEAT_MS = 15000, EVENTS_AT_ONCE = 4, LINE_BYTES = 512 };
static const char heartbeat[] = ": still here\n\n";

struct stream {
    struct service *service;
    struct uuid id;
    struct events_subscription *subscription;
    struct http_exchange *exchange; /* held: the subscription wakes it */
    uint64_t after;                 /* the last event that was sent */
    int64_t beat_ms;                /* when the next heartbeat is due */
    bool ended;
    size_t used, sent; /* of buffer */
    char buffer[EVENTS_AT_ONCE * LINE_BYTES];
};

static void wake_stream(void *context) { http_wake(context); }

static void close_stream(void *context)
{
    struct stream *stream = context;
    events_unsubscribe(stream->subscription);
    http_release(stream->exchange);
    metrics_add(METRIC_EVENT_STREAMS, -1);
    free(stream);
}

static void put_frame(struct stream *stream, uint64_t id, const char *name, const char *data)
{
    const size_t room = sizeof stream->buffer - stream->used;
    const int n = snprintf(stream->buffer + stream->used, room, "id: %llu\nevent: %s\ndata: %s\n\n",
                           (unsigned long long)id, name, data);
    if (n > 0 && (size_t)n < room) stream->used += (size_t)n;
}

static void put_event(struct stream *stream, const struct event *event)
{
    struct json_out out;
    char *data = NULL;
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    json_put_string(&out, "status", queue_state_names[event->state]);
    json_put_number(&out, "fraction", event->fraction);
    if (event->kind == EVENT_PROGRESS) {
        json_put_integer(&out, "load_step", event->load_step);
        json_put_integer(&out, "newton_iteration", event->newton_iteration);
        json_put_number(&out, "F_N", event->F_N);
        json_put_string(&out, "message", event->message);
    }
    json_close_object(&out);
    /* No memory: this event is left out; the next one says more than it did. */
    if (json_out_take(&out, &data, NULL, NULL) == ISCHIA_OK)
        put_frame(stream, event->id, event_kind_names[event->kind], data);
    free(data);
    stream->after = event->id;
    stream->ended = stream->ended || event->kind == EVENT_DONE;
}

/* What the store knows, for a stream whose events are gone (the daemon was restarted). */
static bool put_stored_end(struct stream *stream)
{
    struct store_assessment row;
    enum store_answer answer = STORE_DONE;
    struct event done = {.kind = EVENT_DONE};
    memset(&row, 0, sizeof row);
    if (store_peek(stream->service->store, &stream->id, &row, &answer, NULL) != ISCHIA_OK)
        return false;
    if (answer != STORE_DONE) row.state = QUEUE_CANCELLED; /* erased meanwhile */
    if (!queue_is_final(row.state)) return false;
    done.id = (uint64_t)row.finished_ms * 1000;
    done.state = row.state;
    done.fraction = row.state == QUEUE_SUCCEEDED ? 1 : 0;
    put_event(stream, &done);
    return true;
}

static void fill(struct stream *stream)
{
    struct event events[EVENTS_AT_ONCE];
    stream->used = stream->sent = 0;
    const size_t count =
        events_read(stream->service->events, &stream->id, stream->after, events, EVENTS_AT_ONCE);
    for (size_t i = 0; i < count && !stream->ended; i++) put_event(stream, &events[i]);
    if (count > 0 || http_now_ms() < stream->beat_ms) return;
    if (put_stored_end(stream)) return;
    memcpy(stream->buffer, heartbeat, sizeof heartbeat - 1);
    stream->used = sizeof heartbeat - 1;
}

static ssize_t read_stream(void *context, char *buffer, size_t size, int64_t *ret_wake_ms)
{
    struct stream *stream = context;
    if (stream->sent == stream->used) {
        if (stream->ended || http_is_stopping(stream->service->http)) return -1;
        fill(stream);
    }
    *ret_wake_ms = stream->beat_ms;
    size_t n = stream->used - stream->sent;
    if (n == 0) return 0;
    if (n > size) n = size;
    memcpy(buffer, stream->buffer + stream->sent, n);
    stream->sent += n;
    stream->beat_ms = http_now_ms() + HEARTBEAT_MS;
    return (ssize_t)n;
}

static uint64_t last_seen(const struct call *call)
{
    const char *header = http_request_header(call->request, "Last-Event-ID");
    long long id = 0;
    if (header == NULL || !query_whole_number(header, 0, INT64_MAX, &id)) return 0;
    return (uint64_t)id;
}

/* True when the client has seen the end: it is in the ring up to `after`, or it is what a stored
 * end would be called. */
static bool has_seen_end(struct call *call, const struct store_assessment *row, uint64_t after)
{
    struct event events[EVENTS_RING];
    if (after == 0 || !queue_is_final(row->state)) return false;
    const size_t count = events_read(call->service->events, &call->id, 0, events, EVENTS_RING);
    for (size_t i = 0; i < count; i++)
        if (events[i].kind == EVENT_DONE) return events[i].id <= after;
    return (uint64_t)row->finished_ms * 1000 <= after;
}

static struct stream *open_stream(struct call *call, uint64_t after)
{
    struct stream *stream = calloc(1, sizeof *stream);
    if (stream == NULL) return NULL;
    stream->service = call->service;
    stream->id = call->id;
    stream->exchange = call->request->exchange;
    stream->after = after;
    if (events_subscribe(call->service->events, &call->id, wake_stream, stream->exchange,
                         &stream->subscription, NULL) != ISCHIA_OK) {
        free(stream);
        return NULL;
    }
    http_hold(stream->exchange);
    metrics_add(METRIC_EVENT_STREAMS, 1);
    /* How soon to come back, for browsers; it also makes proxies pass the head on. */
    static const char greeting[] = "retry: 2000\n\n";
    memcpy(stream->buffer, greeting, sizeof greeting - 1);
    stream->used = sizeof greeting - 1;
    return stream;
}

void handle_events(struct call *call, struct http_response *ret)
{
    struct store_assessment row;
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    const uint64_t after = last_seen(call);
    struct stream *stream = open_stream(call, after);
    memset(&row, 0, sizeof row);
    if (stream == NULL) {
        err = (struct ischia_error){.code = ISCHIA_E_MEMORY, .message = "no memory for a stream"};
        reply_failure(call->request, ret, &err);
        return;
    }
    const enum ischia_code code = store_peek(call->service->store, &call->id, &row, &answer, &err);
    const bool streams =
        code == ISCHIA_OK && answer == STORE_DONE && !has_seen_end(call, &row, after);
    if (streams) {
        ret->action = HTTP_STREAM;
        ret->type = "text/event-stream; charset=utf-8";
        ret->stream = (struct http_stream){read_stream, close_stream, stream};
        http_header_static(ret, "Cache-Control", "no-store");
        http_header_static(ret, "X-Accel-Buffering", "no");
        /* An end that is in the store only is told at once, not after a heartbeat. */
        stream->beat_ms = queue_is_final(row.state) ? 0 : http_now_ms() + HEARTBEAT_MS;
        return;
    }
    close_stream(stream);
    if (code != ISCHIA_OK)
        reply_failure(call->request, ret, &err);
    else if (answer != STORE_DONE)
        reply_no_assessment(call, ret);
    else
        ret->status = 204;
}
