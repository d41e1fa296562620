/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/http.h"

#include <assert.h>
#include <errno.h>
#include <microhttpd.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "server/http/gzip.h"
#include "server/http/listen.h"
#include "server/http/query.h"
#include "server/http/tls.h"

/*
 * A request's way through the library: on_uri (its first line was read; the exchange is made),
 * on_access with the head, on_access with each piece of the body, on_access without data (answer),
 * again after each wait, on_completed.
 *
 * Waits: an exchange that waits is suspended, which takes it out of its thread's epoll set, and put
 * on the list that the ticker thread walks. http_wake and the ticker resume it.
 *
 * Slow clients: the library's timeout counts from the last byte, which a client that sends one byte
 * now and then never reaches. Each connection therefore has a deadline of its own that the ticker
 * enforces; whoever changes its phase first, the ticker or the library's thread, has it.
 */

enum {
    CONNECTION_MEMORY_BYTES = 32 * 1024, /* head of a request, and what the library needs */
    HEAD_BYTES_MAX = 16 * 1024,
    /* A refused body is read to here, so that the client sees why; far above what routes take. */
    DISCARD_BYTES_MAX = 32 * 1024 * 1024,
    STREAM_BLOCK_BYTES = 2048,
    TICK_MS = 1000
};

enum phase { PHASE_IDLE, PHASE_RECEIVING, PHASE_ANSWERING, PHASE_REAPED };

struct connection {
    struct connection *previous, *next;
    int fd;
    bool tls;
    atomic_int phase;
    atomic_llong deadline_ms;
    int gone_ticks; /* the ticker's own: how often it found the peer gone */
};

enum step { STEP_HEAD, STEP_BODY, STEP_ANSWER };

struct http_exchange {
    atomic_int references; /* the library's, the stream's, and those of http_hold */
    struct http_request request;
    struct http_server *server;
    struct connection *connection;
    struct MHD_Connection *mhd;
    enum step step;
    int status; /* sent; 0: none */
    char *body;
    size_t body_capacity, body_max, discarded;
    struct http_response *refusal; /* to be sent when the body was read and thrown away */
    struct http_stream stream;
    bool gzip;       /* the client takes it */
    char *authority; /* of a target in absolute form, behind target; NULL: none */
    /* Under server->lock: */
    bool suspended, wake_pending;
    int64_t wake_at_ms;
    struct http_exchange *previous, *next; /* on server->waiting while suspended */
    char target[];
};

struct http_server {
    struct http_app app;
    struct http_options options;
    struct MHD_Daemon *daemon;
    char address[LISTEN_ADDRESS_BYTES];
    int listen_fd;
    pthread_mutex_t lock; /* over waiting and next_tick_ms */
    pthread_cond_t tick;
    struct http_exchange *waiting;
    int64_t next_tick_ms;
    pthread_mutex_t connections_lock;
    struct connection *connections;
    pthread_t ticker;
    bool ticker_runs;
    atomic_bool stopping, ticker_stops;
};

const char *const http_method_names[HTTP_METHOD_COUNT] = {
    [HTTP_GET] = "GET",         [HTTP_HEAD] = "HEAD",   [HTTP_POST] = "POST",
    [HTTP_PUT] = "PUT",         [HTTP_PATCH] = "PATCH", [HTTP_DELETE] = "DELETE",
    [HTTP_OPTIONS] = "OPTIONS", [HTTP_OTHER] = "",
};

const char *http_library_version(void) { return MHD_get_version(); }

int64_t http_now_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

const char *http_request_header(const struct http_request *request, const char *name)
{
    const struct http_exchange *x = request->exchange;
    if (x->authority != NULL && strcasecmp(name, "Host") == 0) return x->authority;
    return MHD_lookup_connection_value(x->mhd, MHD_HEADER_KIND, name);
}

struct header_count {
    const char *name;
    int count;
};

static enum MHD_Result count_header(void *context, enum MHD_ValueKind kind, const char *key,
                                    const char *value)
{
    struct header_count *header = context;
    (void)kind;
    (void)value;
    header->count += strcasecmp(key, header->name) == 0;
    return MHD_YES;
}

int http_request_header_count(const struct http_request *request, const char *name)
{
    struct header_count header = {name, 0};
    (void)MHD_get_connection_values(request->exchange->mhd, MHD_HEADER_KIND, count_header, &header);
    return header.count;
}

/* ----------------------------------------------------------------------------- waits */

/* With server->lock held. */
static void unlink_waiting(struct http_exchange *x)
{
    if (x->previous != NULL)
        x->previous->next = x->next;
    else
        x->server->waiting = x->next;
    if (x->next != NULL) x->next->previous = x->previous;
    x->previous = x->next = NULL;
}

/* With server->lock held. */
static void resume(struct http_exchange *x)
{
    unlink_waiting(x);
    x->suspended = false;
    MHD_resume_connection(x->mhd);
}

void http_wake(struct http_exchange *exchange)
{
    struct http_server *server = exchange->server;
    (void)pthread_mutex_lock(&server->lock);
    if (exchange->suspended)
        resume(exchange);
    else
        exchange->wake_pending = true;
    (void)pthread_mutex_unlock(&server->lock);
}

void http_hold(struct http_exchange *exchange)
{
    (void)atomic_fetch_add_explicit(&exchange->references, 1, memory_order_relaxed);
}

void http_release(struct http_exchange *exchange)
{
    if (atomic_fetch_sub_explicit(&exchange->references, 1, memory_order_acq_rel) == 1)
        free(exchange);
}

/* Parks the exchange until http_wake or wake_at_ms. False when it was woken already: go on. */
static bool park(struct http_exchange *x, int64_t wake_at_ms)
{
    struct http_server *server = x->server;
    (void)pthread_mutex_lock(&server->lock);
    const bool parked = !x->wake_pending;
    x->wake_pending = false;
    if (parked) {
        MHD_suspend_connection(x->mhd);
        x->suspended = true;
        x->wake_at_ms = wake_at_ms;
        x->previous = NULL;
        x->next = server->waiting;
        if (x->next != NULL) x->next->previous = x;
        server->waiting = x;
        if (wake_at_ms < server->next_tick_ms) (void)pthread_cond_signal(&server->tick);
    }
    (void)pthread_mutex_unlock(&server->lock);
    return parked;
}

/* With server->lock held: resumes what is due, returns when the next one is. */
static int64_t resume_due(struct http_server *server, int64_t now_ms)
{
    int64_t next_ms = now_ms + TICK_MS;
    struct http_exchange *x = server->waiting;
    while (x != NULL) {
        struct http_exchange *following = x->next;
        if (x->wake_at_ms <= now_ms)
            resume(x);
        else if (x->wake_at_ms < next_ms)
            next_ms = x->wake_at_ms;
        x = following;
    }
    return next_ms;
}

/* ---------------------------------------------------------------------- slow clients */

/* Answers past the library, which cannot answer in the middle of a request. It has sent nothing for
 * this request, so the bytes are the first. Over TLS only the library can write: no words there. */
static void refuse_on_socket(struct http_server *server, const struct connection *connection,
                             int status)
{
    struct http_response response;
    char text[2048];
    if (!connection->tls) {
        http_response_init(&response, status);
        server->app.on_refuse(server->app.context, NULL, status, &response);
        const int n = snprintf(text, sizeof text,
                               "HTTP/1.1 %d %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\n"
                               "Connection: close\r\n\r\n%.*s",
                               status, MHD_get_reason_phrase_for((unsigned)status), response.type,
                               response.size, (int)response.size, response.bytes);
        http_response_finish(&response);
        const ssize_t sent =
            n <= 0 || (size_t)n >= sizeof text
                ? 0
                : send(connection->fd, text, (size_t)n, MSG_NOSIGNAL | MSG_DONTWAIT);
        (void)sent; /* a client that does not read either gets the closing alone */
    }
    (void)shutdown(connection->fd, SHUT_RDWR);
}

/*
 * True when the peer has sent its last byte, all of it was read, and no request came of it. The
 * library takes a short read for the end of what is there and so misses a closing that came along
 * with it, until its timeout. Seen twice, so that a request just being read is not cut off.
 */
static bool is_gone(struct connection *connection)
{
    char byte = 0;
    const bool ended = recv(connection->fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT) == 0;
    connection->gone_ticks = ended ? connection->gone_ticks + 1 : 0;
    return connection->gone_ticks > 1;
}

static void reap_one(struct http_server *server, struct connection *connection, int64_t now_ms)
{
    int phase = atomic_load(&connection->phase);
    if (phase != PHASE_IDLE && phase != PHASE_RECEIVING) return;
    const bool gone = is_gone(connection);
    if (!gone && now_ms < atomic_load(&connection->deadline_ms)) return;
    if (!atomic_compare_exchange_strong(&connection->phase, &phase, PHASE_REAPED)) return;
    if (!gone) server->app.on_slow_client(server->app.context);
    /* A connection that never asked for anything is closed without words. */
    if (phase == PHASE_RECEIVING && !gone)
        refuse_on_socket(server, connection, 408);
    else
        (void)shutdown(connection->fd, SHUT_RDWR);
}

static void reap_slow(struct http_server *server, int64_t now_ms)
{
    (void)pthread_mutex_lock(&server->connections_lock);
    for (struct connection *c = server->connections; c != NULL; c = c->next)
        reap_one(server, c, now_ms);
    (void)pthread_mutex_unlock(&server->connections_lock);
}

static void *run_ticker(void *context)
{
    struct http_server *server = context;
    int64_t reap_at_ms = 0;
    while (!atomic_load(&server->ticker_stops)) {
        const int64_t now_ms = http_now_ms();
        if (now_ms >= reap_at_ms) {
            reap_slow(server, now_ms);
            reap_at_ms = now_ms + TICK_MS;
        }
        (void)pthread_mutex_lock(&server->lock);
        server->next_tick_ms = resume_due(server, now_ms);
        const struct timespec until = {.tv_sec = server->next_tick_ms / 1000,
                                       .tv_nsec = server->next_tick_ms % 1000 * 1000000};
        (void)pthread_cond_timedwait(&server->tick, &server->lock, &until);
        (void)pthread_mutex_unlock(&server->lock);
    }
    return NULL;
}

/* Moves the connection to another phase unless the ticker has given it up. */
static bool enter_phase(struct connection *connection, enum phase phase, int64_t deadline_ms)
{
    int now = atomic_load(&connection->phase);
    atomic_store(&connection->deadline_ms, deadline_ms);
    while (now != PHASE_REAPED)
        if (atomic_compare_exchange_weak(&connection->phase, &now, (int)phase)) return true;
    return false;
}

static int64_t after_s(int seconds) { return http_now_ms() + (int64_t)seconds * 1000; }

static void open_connection(struct http_server *server, struct MHD_Connection *mhd, void **ret)
{
    struct connection *connection = calloc(1, sizeof *connection);
    *ret = connection; /* NULL: its requests are refused in on_uri */
    if (connection == NULL) return;
    connection->fd = MHD_get_connection_info(mhd, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
    connection->tls = server->options.tls;
    atomic_store(&connection->phase, PHASE_IDLE);
    atomic_store(&connection->deadline_ms, after_s(server->options.request_timeout_s));
    (void)pthread_mutex_lock(&server->connections_lock);
    connection->next = server->connections;
    if (connection->next != NULL) connection->next->previous = connection;
    server->connections = connection;
    (void)pthread_mutex_unlock(&server->connections_lock);
}

static void close_connection(struct http_server *server, struct connection *connection)
{
    if (connection == NULL) return;
    (void)pthread_mutex_lock(&server->connections_lock);
    if (connection->previous != NULL)
        connection->previous->next = connection->next;
    else
        server->connections = connection->next;
    if (connection->next != NULL) connection->next->previous = connection->previous;
    (void)pthread_mutex_unlock(&server->connections_lock);
    free(connection);
}

static void on_connection(void *context, struct MHD_Connection *mhd, void **socket_context,
                          enum MHD_ConnectionNotificationCode code)
{
    struct http_server *server = context;
    if (code == MHD_CONNECTION_NOTIFY_STARTED) {
        open_connection(server, mhd, socket_context);
        server->app.on_connection(server->app.context, 1);
    } else {
        close_connection(server, *socket_context);
        *socket_context = NULL;
        server->app.on_connection(server->app.context, -1);
    }
}

/* -------------------------------------------------------------------------- requests */

enum { TARGET_MORE_BYTES = 3 }; /* what set_target may need beyond the uri: "/", and two ends */

/* One in absolute form is taken apart: the path ("/" if none), and behind it the authority. */
static void set_target(struct http_exchange *x, const char *uri)
{
    const char *authority = NULL;
    size_t length = 0;
    const char *path = query_absolute(uri, &authority, &length);
    const char *root = path != NULL && path[0] != '/' ? "/" : "";
    char *end = stpcpy(stpcpy(x->target, root), path == NULL ? uri : path);
    if (path != NULL) x->authority = memcpy(end + 1, authority, length); /* of zeros, so it ends */
    x->request.target = x->target;
    x->request.query = strchr(x->target, '?');
    x->request.query = x->request.query == NULL ? "" : x->request.query + 1;
}

static void *on_uri(void *context, const char *uri, struct MHD_Connection *mhd)
{
    struct http_server *server = context;
    struct connection *connection =
        MHD_get_connection_info(mhd, MHD_CONNECTION_INFO_SOCKET_CONTEXT)->socket_context;
    if (connection == NULL) return NULL;
    struct http_exchange *x = calloc(1, sizeof *x + strlen(uri) + TARGET_MORE_BYTES);
    if (x == NULL) return NULL;
    set_target(x, uri);
    atomic_store_explicit(&x->references, 1, memory_order_relaxed);
    x->server = server;
    x->connection = connection;
    x->mhd = mhd;
    x->request.body = "";
    x->request.tls = connection->tls;
    x->request.begun_ms = http_now_ms();
    x->request.exchange = x;
    listen_peer_text(MHD_get_connection_info(mhd, MHD_CONNECTION_INFO_CLIENT_ADDRESS)->client_addr,
                     x->request.peer, sizeof x->request.peer);
    (void)enter_phase(connection, PHASE_RECEIVING, after_s(server->options.request_timeout_s));
    return x;
}

static void on_completed(void *context, struct MHD_Connection *mhd, void **request_context,
                         enum MHD_RequestTerminationCode code)
{
    struct http_server *server = context;
    struct http_exchange *x = *request_context;
    (void)mhd;
    (void)code;
    if (x == NULL) return;
    *request_context = NULL;
    server->app.on_done(server->app.context, &x->request, x->status);
    (void)enter_phase(x->connection, PHASE_IDLE, after_s(server->options.idle_timeout_s));
    if (x->refusal != NULL) http_response_finish(x->refusal);
    free(x->refusal);
    free(x->body);
    http_release(x);
}

static ssize_t read_stream(void *context, uint64_t position, char *buffer, size_t room)
{
    struct http_exchange *x = context;
    (void)position;
    for (;;) {
        int64_t wake_at_ms = http_now_ms() + TICK_MS;
        const ssize_t n = x->stream.read(x->stream.state, buffer, room, &wake_at_ms);
        if (n > 0) return n;
        if (n < 0) return MHD_CONTENT_READER_END_OF_STREAM;
        if (park(x, wake_at_ms)) return 0;
    }
}

/* The library may do this after on_completed: the stream holds the exchange. */
static void close_stream(void *context)
{
    struct http_exchange *x = context;
    x->stream.close(x->stream.state);
    http_release(x);
}

static struct MHD_Response *make_stream(struct http_exchange *x, struct http_response *response)
{
    x->stream = response->stream;
    struct MHD_Response *made = MHD_create_response_from_callback(
        MHD_SIZE_UNKNOWN, STREAM_BLOCK_BYTES, read_stream, x, close_stream);
    if (made == NULL) return NULL;
    http_hold(x);
    response->action = HTTP_SEND; /* the library closes the stream from now on */
    return made;
}

static struct MHD_Response *make_body(struct http_response *response)
{
    /* The library takes a pointer to non-const but only reads. */
    void *bytes = (void *)(uintptr_t)response->bytes;
    if (response->release == NULL)
        return MHD_create_response_from_buffer(response->size, bytes, MHD_RESPMEM_PERSISTENT);
    struct MHD_Response *made = MHD_create_response_from_buffer_with_free_callback_cls(
        response->size, bytes, response->release, response->owner);
    if (made != NULL) response->release = NULL;
    return made;
}

static bool add_headers(struct MHD_Response *made, const struct http_response *response)
{
    bool good = true;
    for (int i = 0; i < response->header_count; i++)
        good = good && MHD_add_response_header(made, response->header[i].name,
                                               response->header[i].value) == MHD_YES;
    if (response->type != NULL)
        good = good && MHD_add_response_header(made, "Content-Type", response->type) == MHD_YES;
    if (response->etag[0] != '\0')
        good = good && MHD_add_response_header(made, "ETag", response->etag) == MHD_YES;
    if (response->close)
        good = good && MHD_add_response_header(made, "Connection", "close") == MHD_YES;
    return good;
}

static enum MHD_Result send_response(struct http_exchange *x, struct http_response *response)
{
    struct MHD_Response *made = NULL;
    enum MHD_Result sent = MHD_NO;
    if (response->action == HTTP_DROP) goto done;
    if (!enter_phase(x->connection, PHASE_ANSWERING, INT64_MAX)) goto done;
    if (atomic_load_explicit(&x->server->stopping, memory_order_relaxed)) response->close = true;
    if (response->action == HTTP_SEND) http_response_pack(response, x->gzip);
    made = response->action == HTTP_STREAM ? make_stream(x, response) : make_body(response);
    if (made == NULL) goto done;
    if (add_headers(made, response))
        sent = MHD_queue_response(x->mhd, (unsigned)response->status, made);
    if (sent == MHD_YES) x->status = response->status;
    MHD_destroy_response(made);
done:
    http_response_finish(response);
    return sent;
}

static enum MHD_Result refuse(struct http_exchange *x, int status)
{
    struct http_response response;
    http_response_init(&response, status);
    x->server->app.on_refuse(x->server->app.context, &x->request, status, &response);
    response.close = response.close || status == 400; /* where the request ends is not sure */
    return send_response(x, &response);
}

static enum http_method method_of(const char *name)
{
    for (int i = 0; i < HTTP_OTHER; i++)
        if (strcmp(name, http_method_names[i]) == 0) return (enum http_method)i;
    return HTTP_OTHER;
}

static enum MHD_Result add_size(void *context, enum MHD_ValueKind kind, const char *key,
                                size_t key_size, const char *value, size_t value_size)
{
    size_t *head_bytes = context;
    (void)kind;
    (void)key;
    (void)value;
    *head_bytes += key_size + value_size + 4;
    return MHD_YES;
}

/* Length of the body that the head announces: -1 when it comes in chunks. */
static int64_t announced_length(const struct http_exchange *x)
{
    const char *length = http_request_header(&x->request, "Content-Length");
    char *end = NULL;
    if (http_request_header(&x->request, "Transfer-Encoding") != NULL) return -1;
    if (length == NULL) return 0;
    errno = 0;
    const long long bytes = strtoll(length, &end, 10);
    if (errno != 0 || end == length || *end != '\0' || bytes < 0) return INT64_MAX;
    return bytes;
}

/* Keeps the refusal until the body was read: closing on a client that still sends would take the
 * answer away from it, and in the middle of a body the library takes none. */
static enum MHD_Result keep_refusal(struct http_exchange *x, struct http_response *refusal)
{
    x->refusal = malloc(sizeof *x->refusal);
    if (x->refusal == NULL) {
        http_response_finish(refusal);
        return MHD_NO;
    }
    memcpy(x->refusal, refusal, sizeof *refusal);
    for (int i = 0; i < x->refusal->header_count; i++) {
        const char *value = refusal->header[i].value;
        if (value >= refusal->arena && value < refusal->arena + sizeof refusal->arena)
            x->refusal->header[i].value = x->refusal->arena + (value - refusal->arena);
    }
    return MHD_YES;
}

/* Sends the refusal now when there is no body to read first: none was announced, the client asks
 * before it sends one, or there is too much of it. */
static enum MHD_Result refuse_head(struct http_exchange *x, struct http_response *refusal,
                                   int64_t length)
{
    const bool asks_first = http_request_header(&x->request, "Expect") != NULL;
    if (length != 0 && length <= DISCARD_BYTES_MAX && !asks_first) return keep_refusal(x, refusal);
    refusal->close = refusal->close || length != 0;
    return send_response(x, refusal);
}

/* Which Host is asked for, or where the body ends, may not depend on who reads the head. */
static bool is_ambiguous(const struct http_exchange *x)
{
    return http_request_header_count(&x->request, "Host") > 1 ||
           http_request_header_count(&x->request, "Content-Length") > 1;
}

static enum MHD_Result take_head(struct http_exchange *x, const char *method)
{
    const struct http_app *app = &x->server->app;
    struct http_response refusal;
    size_t head_bytes = strlen(x->target);
    const int64_t length = announced_length(x);
    const char *encodings = http_request_header(&x->request, "Accept-Encoding");
    (void)MHD_get_connection_values_n(x->mhd, MHD_HEADER_KIND, add_size, &head_bytes);
    x->step = STEP_BODY;
    x->request.method = method_of(method);
    x->request.has_body = length != 0;
    x->gzip = encodings != NULL && gzip_accepted(encodings);
    if (head_bytes > HEAD_BYTES_MAX) return refuse(x, 431);
    if (is_ambiguous(x)) return refuse(x, 400);
    http_response_init(&refusal, 500);
    if (!app->on_head(app->context, &x->request, &x->body_max, &refusal))
        return refuse_head(x, &refusal, length);
    if (length < 0 || (uint64_t)length <= x->body_max) return MHD_YES;
    http_response_init(&refusal, 413);
    app->on_refuse(app->context, &x->request, 413, &refusal);
    return refuse_head(x, &refusal, length);
}

static bool grow_body(struct http_exchange *x, size_t needed)
{
    size_t capacity = x->body_capacity == 0 ? 1024 : x->body_capacity;
    if (needed <= x->body_capacity) return true;
    while (capacity < needed) capacity *= 2;
    char *grown = realloc(x->body, capacity);
    if (grown == NULL) return false;
    x->body = grown;
    x->body_capacity = capacity;
    return true;
}

/* A body that outgrows its limit without having said so (chunks) is discarded up to a limit. */
static enum MHD_Result discard(struct http_exchange *x, size_t size)
{
    x->discarded += size;
    if (x->discarded <= DISCARD_BYTES_MAX) return MHD_YES;
    if (enter_phase(x->connection, PHASE_REAPED, INT64_MAX))
        refuse_on_socket(x->server, x->connection, 413);
    return MHD_NO;
}

static enum MHD_Result take_body(struct http_exchange *x, const char *data, size_t size)
{
    const size_t needed = x->request.body_size + size;
    if (x->refusal != NULL) return discard(x, size);
    if (needed > x->body_max) {
        struct http_response refusal;
        http_response_init(&refusal, 413);
        x->server->app.on_refuse(x->server->app.context, &x->request, 413, &refusal);
        return keep_refusal(x, &refusal);
    }
    if (!grow_body(x, needed)) return MHD_NO;
    memcpy(x->body + x->request.body_size, data, size);
    x->request.body_size = needed;
    x->request.body = x->body;
    return MHD_YES;
}

static enum MHD_Result answer(struct http_exchange *x)
{
    const struct http_app *app = &x->server->app;
    x->step = STEP_ANSWER;
    if (x->refusal != NULL) return send_response(x, x->refusal);
    /* From here on time is ours, not the client's. */
    if (!enter_phase(x->connection, PHASE_ANSWERING, INT64_MAX)) return MHD_NO;
    for (;;) {
        struct http_response response;
        http_response_init(&response, 200);
        app->on_request(app->context, &x->request, &response);
        if (response.action != HTTP_WAIT) return send_response(x, &response);
        x->request.woken++;
        if (park(x, response.wake_at_ms)) return MHD_YES;
    }
}

static enum MHD_Result on_access(void *context, struct MHD_Connection *mhd, const char *url,
                                 const char *method, const char *version, const char *data,
                                 size_t *size, void **request_context)
{
    struct http_exchange *x = *request_context;
    enum MHD_Result result = MHD_YES;
    (void)context;
    (void)mhd;
    (void)url;
    (void)version;
    if (x == NULL) return MHD_NO;
    if (x->step == STEP_HEAD) return take_head(x, method);
    if (*size == 0) return answer(x);
    result = take_body(x, data, *size);
    *size = 0;
    return result;
}

/* ------------------------------------------------------------------- start and stop */

__attribute__((format(printf, 2, 0))) static void on_log(void *context, const char *format,
                                                         va_list arguments)
{
    struct http_server *server = context;
    char message[256];
    (void)vsnprintf(message, sizeof message, format, arguments);
    message[strcspn(message, "\n")] = '\0';
    server->app.on_log(server->app.context, message);
}

static enum ischia_code start_daemon(struct http_server *server, struct ischia_error *err)
{
    const struct http_options *o = &server->options;
    unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_USE_SUSPEND_RESUME | MHD_USE_ERROR_LOG;
    struct MHD_OptionItem tls_options[] = {
        {MHD_OPTION_HTTPS_CERT_CALLBACK2, 0, tls_callback()},
        {MHD_OPTION_HTTPS_PRIORITIES, 0,
         (void *)(uintptr_t) "SECURE128:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2"},
        {MHD_OPTION_END, 0, NULL},
    };
    if (o->tls)
        flags |= MHD_USE_TLS;
    else
        tls_options[0].option = MHD_OPTION_END;
    server->daemon = MHD_start_daemon(
        flags, 0, NULL, NULL, on_access, server, MHD_OPTION_EXTERNAL_LOGGER, on_log, server,
        MHD_OPTION_LISTEN_SOCKET, server->listen_fd, MHD_OPTION_URI_LOG_CALLBACK, on_uri, server,
        MHD_OPTION_NOTIFY_COMPLETED, on_completed, server, MHD_OPTION_NOTIFY_CONNECTION,
        on_connection, server, MHD_OPTION_THREAD_POOL_SIZE, (unsigned)o->threads,
        MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)CONNECTION_MEMORY_BYTES,
        MHD_OPTION_CONNECTION_LIMIT, (unsigned)o->connections, MHD_OPTION_PER_IP_CONNECTION_LIMIT,
        (unsigned)o->connections_per_address, MHD_OPTION_CONNECTION_TIMEOUT,
        (unsigned)o->idle_timeout_s, MHD_OPTION_THREAD_STACK_SIZE, (size_t)(256 * 1024),
        MHD_OPTION_ARRAY, tls_options, MHD_OPTION_END);
    CHECK(server->daemon != NULL, err, ISCHIA_E_IO, "the HTTP library did not start");
    return ISCHIA_OK;
}

static enum ischia_code start_ticker(struct http_server *server, struct ischia_error *err)
{
    pthread_condattr_t attributes;
    (void)pthread_condattr_init(&attributes);
    (void)pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    (void)pthread_cond_init(&server->tick, &attributes);
    (void)pthread_condattr_destroy(&attributes);
    (void)pthread_mutex_init(&server->lock, NULL);
    (void)pthread_mutex_init(&server->connections_lock, NULL);
    const int cause = pthread_create(&server->ticker, NULL, run_ticker, server);
    CHECK(cause == 0, err, ISCHIA_E_MEMORY, "cannot start a thread: %s", strerror(cause));
    server->ticker_runs = true;
    return ISCHIA_OK;
}

enum ischia_code http_start(struct http_server **ret, const struct http_options *options,
                            const struct http_app *app, struct ischia_error *err)
{
    struct http_server *server = calloc(1, sizeof *server);
    CHECK(server != NULL, err, ISCHIA_E_MEMORY, "no memory for the server");
    server->app = *app;
    server->options = *options;
    server->listen_fd = -1;
    enum ischia_code code = start_ticker(server, err);
    if (code == ISCHIA_OK)
        code = listen_open(options->listen, &server->listen_fd, server->address, err);
    *ret = server; /* the first request may come before start_daemon returns */
    if (code == ISCHIA_OK) code = start_daemon(server, err);
    if (code != ISCHIA_OK) {
        *ret = NULL;
        http_destroy(server);
    }
    return code;
}

const char *http_address(const struct http_server *server) { return server->address; }

bool http_is_stopping(const struct http_server *server)
{
    return atomic_load_explicit(&server->stopping, memory_order_relaxed);
}

void http_quiesce(struct http_server *server)
{
    if (atomic_exchange(&server->stopping, true)) return;
    if (server->daemon != NULL) (void)MHD_quiesce_daemon(server->daemon);
    (void)pthread_mutex_lock(&server->lock);
    while (server->waiting != NULL) resume(server->waiting);
    (void)pthread_mutex_unlock(&server->lock);
}

/* The library must not be stopped while an exchange waits. Each is woken again and again until it
 * has answered: the application gives up its own waits once http_is_stopping. */
static void await_waiting(struct http_server *server)
{
    static const struct timespec pause = {.tv_sec = 0, .tv_nsec = 10 * 1000 * 1000};
    int idle_rounds = 0;
    while (idle_rounds < 2) {
        (void)pthread_mutex_lock(&server->lock);
        idle_rounds = server->waiting == NULL ? idle_rounds + 1 : 0;
        while (server->waiting != NULL) resume(server->waiting);
        (void)pthread_mutex_unlock(&server->lock);
        (void)nanosleep(&pause, NULL);
    }
}

void http_stop(struct http_server *server)
{
    if (server == NULL) return;
    http_quiesce(server);
    await_waiting(server);
    if (server->daemon != NULL) MHD_stop_daemon(server->daemon);
    server->daemon = NULL;
    atomic_store(&server->ticker_stops, true);
    (void)pthread_mutex_lock(&server->lock);
    (void)pthread_cond_signal(&server->tick);
    (void)pthread_mutex_unlock(&server->lock);
    if (server->ticker_runs) (void)pthread_join(server->ticker, NULL);
    server->ticker_runs = false;
    if (server->listen_fd >= 0) (void)close(server->listen_fd);
    server->listen_fd = -1;
}

void http_destroy(struct http_server *server)
{
    if (server == NULL) return;
    http_stop(server);
    (void)pthread_cond_destroy(&server->tick);
    (void)pthread_mutex_destroy(&server->lock);
    (void)pthread_mutex_destroy(&server->connections_lock);
    free(server);
}
