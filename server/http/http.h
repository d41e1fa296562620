/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_HTTP_H
#define ISCHIA_SERVER_HTTP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "solver/error.h"

/*
 * HTTP without its library: http.c is the only file that sees microhttpd. It offers requests and
 * responses as plain structs to one application, and three ways to answer: at once, after a wait
 * (the connection is parked and costs no thread), or as a stream.
 *
 * Threads: the application is called on one of several threads, but never twice at once for the
 * same request. http_wake may be called from anywhere.
 */

enum http_method {
    HTTP_GET,
    HTTP_HEAD,
    HTTP_POST,
    HTTP_PUT,
    HTTP_PATCH,
    HTTP_DELETE,
    HTTP_OPTIONS,
    HTTP_OTHER,
    HTTP_METHOD_COUNT
};
extern const char *const http_method_names[HTTP_METHOD_COUNT];

enum { HTTP_PEER_BYTES = 46, HTTP_PATH_BYTES = 1024 };

struct http_exchange; /* one request and its answer, as http.c sees it */

struct http_request {
    enum http_method method;
    const char *target; /* path and query as sent, without the authority of an absolute one */
    const char *query;  /* behind the '?', "" when there is none                      */
    const char *body;   /* "" until it is there; not NUL-terminated                   */
    size_t body_size;
    char peer[HTTP_PEER_BYTES]; /* the other end's address, numeric                   */
    bool tls;
    bool has_body;
    int64_t begun_ms; /* monotonic: when its first line was read                    */
    int woken;        /* how often it was called again after a wait                   */
    void *state;      /* the application's own; it frees it in on_done                */
    int language;     /* the application's own: what the client reads                 */
    struct http_exchange *exchange;
};

/* The first value of a header, NULL when it was not sent. Valid as long as the request. "Host" is
 * the authority of a target in absolute form, which replaces the header (RFC 9112, 3.2.2). */
const char *http_request_header(const struct http_request *request, const char *name);
/* How often a header was sent. */
int http_request_header_count(const struct http_request *request, const char *name);

enum { HTTP_HEADERS_MAX = 20, HTTP_ETAG_BYTES = 80, HTTP_ARENA_BYTES = 1024 };

enum http_action {
    HTTP_SEND,   /* status, headers and body                                            */
    HTTP_WAIT,   /* call on_request again after http_wake or at wake_at_ms               */
    HTTP_STREAM, /* status and headers, then what the stream gives                      */
    HTTP_DROP    /* close without an answer: there is no memory for one                 */
};

struct http_stream {
    /* Writes at most size bytes and returns how many. 0: nothing now; call again after http_wake
     * or at *ret_wake_ms (monotonic). Negative: the end. */
    ssize_t (*read)(void *state, char *buffer, size_t size, int64_t *ret_wake_ms);
    void (*close)(void *state); /* called exactly once, whether or not read ever was        */
    void *state;
};

struct http_response {
    enum http_action action;
    int status;
    const char *type;  /* media type, static storage; NULL: no body                     */
    const char *bytes; /* the body                                                      */
    size_t size;
    void (*release)(void *owner); /* frees the body when it was sent; NULL: static bytes   */
    void *owner;
    const char *packed; /* the same body as gzip, in static storage; NULL: none ready       */
    size_t packed_size;
    bool compressible;          /* gzip it for clients that take it                              */
    bool close;                 /* the connection ends with this answer                          */
    char etag[HTTP_ETAG_BYTES]; /* with its quotes; "": none                           */
    int64_t wake_at_ms;         /* HTTP_WAIT: monotonic                               */
    struct http_stream stream;
    struct {
        const char *name, *value;
    } header[HTTP_HEADERS_MAX];
    int header_count;
    size_t arena_used;
    char arena[HTTP_ARENA_BYTES]; /* values that are not static                         */
};

/* A response with nothing in it but its status. */
void http_response_init(struct http_response *ret, int status);
/* Frees the body that was not sent; for answers that are thrown away. */
void http_response_finish(struct http_response *response);

/* name and value are static storage. A header beyond the room is dropped (asserted in tests). */
void http_header_static(struct http_response *response, const char *name, const char *value);
/* Formats the value into the response. One that does not fit is dropped. */
__attribute__((format(printf, 3, 4))) void http_header(struct http_response *response,
                                                       const char *name, const char *format, ...);
/* Takes over a body that free() releases. */
void http_body(struct http_response *response, const char *type, char *bytes, size_t size);
/* A body in static storage. */
void http_body_static(struct http_response *response, const char *type, const char *bytes,
                      size_t size);
/* Replaces the body by its gzip form where the client accepts that and it helps, and says that the
 * answer depends on it. A failure leaves the body plain: still right. */
void http_response_pack(struct http_response *response, bool accepted);

struct http_app {
    void *context;
    /* The head was read: sets *ret_body_max (0: no body) and returns true to go on; or fills
     * *ret_refusal and returns false. Both may set request->state. */
    bool (*on_head)(void *context, struct http_request *request, size_t *ret_body_max,
                    struct http_response *ret_refusal);
    /* All is read, or a wait ended. ret is initialised with status 200. */
    void (*on_request)(void *context, struct http_request *request, struct http_response *ret);
    /* The transport refuses (400, 408, 413, 431): the application words it. request is NULL when
     * there is none to speak of; the answer may then have no headers of its own. */
    void (*on_refuse)(void *context, struct http_request *request, int status,
                      struct http_response *ret);
    /* The last call for a request; status 0 when no answer was sent. */
    void (*on_done)(void *context, struct http_request *request, int status);
    /* A connection was opened (+1) or closed (-1). */
    void (*on_connection)(void *context, int change);
    void (*on_slow_client)(void *context);
    void (*on_log)(void *context, const char *message); /* the library complains */
};

struct http_options {
    const char *listen; /* "address:port", "[v6]:port"                                    */
    int threads;
    int connections, connections_per_address;
    int idle_timeout_s, request_timeout_s;
    bool tls; /* with the certificate of tls_set                                             */
};

struct http_server;

/* Listens and answers until http_stop. ISCHIA_E_INPUT: the address is not usable; ISCHIA_E_IO: it
 * cannot be listened on. *ret is the caller's to stop; it is set before the first callback, and
 * NULL after a failure. */
ISCHIA_MUST_CHECK enum ischia_code http_start(struct http_server **ret,
                                              const struct http_options *options,
                                              const struct http_app *app, struct ischia_error *err);

/* "127.0.0.1:8080": the address that is really listened on. */
const char *http_address(const struct http_server *server);

/* Accepts no more connections and wakes every wait and stream, so that they can end. */
void http_quiesce(struct http_server *server);
bool http_is_stopping(const struct http_server *server);
/* http_quiesce, then waits for requests under way: no callback runs after it. NULL allowed. */
void http_stop(struct http_server *server);
/* http_stop, and frees all; after every http_release. NULL allowed. */
void http_destroy(struct http_server *server);

/* Calls on_request, or the stream's read, of this exchange again soon. Cheap; any thread. Who may
 * call it after on_done (a client can leave at any time) holds the exchange first. */
void http_wake(struct http_exchange *exchange);
void http_hold(struct http_exchange *exchange);
void http_release(struct http_exchange *exchange);

const char *http_library_version(void); /* "0.9.75" */
int64_t http_now_ms(void);              /* the monotonic clock of wake_at_ms */

#endif
