/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/guard.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <time.h>

#include "server/digest.h"
#include "server/http/listen.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/log.h"
#include "server/metrics.h"
#include "server/peers.h"

static int64_t unix_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static bool is_own_host(const struct service *service, const char *host)
{
    char own[LISTEN_ADDRESS_BYTES];
    if (strcmp(host, "localhost") == 0 || listen_text_is_loopback(host)) return true;
    if (query_list_has(service->config.allowed_hosts, host)) return true;
    return query_host(http_address(service->http), own, sizeof own) && strcmp(host, own) == 0;
}

/* A name that is rebound to us reaches us with a Host of its own. Where tokens are needed it gains
 * nothing by that, so that a server with tokens and no list of names takes any. */
static bool host_is_ours(const struct call *call)
{
    char host[256];
    const char *header = http_request_header(call->request, "Host");
    if (header == NULL || !query_host(header, host, sizeof host)) return false;
    if (is_own_host(call->service, host)) return true;
    return call->service->config.allowed_hosts[0] == '\0' && auth_asks(call->service->auth);
}

/* "https://name:port" against the Host that was asked for. */
static bool origin_is_ours(const struct call *call, const char *origin)
{
    const char *host = http_request_header(call->request, "Host");
    const char *name = strstr(origin, "://");
    if (query_list_has(call->service->config.allowed_origins, origin)) return true;
    return host != NULL && name != NULL && strcasecmp(name + 3, host) == 0;
}

static bool changes_something(const struct call *call)
{
    const enum http_method method = call->request->method;
    return method != HTTP_GET && method != HTTP_HEAD && method != HTTP_OPTIONS;
}

/* Browsers say where a request comes from; programs say nothing and are no danger here. */
static bool origin_is_fine(const struct call *call)
{
    const char *origin = http_request_header(call->request, "Origin");
    const char *site = http_request_header(call->request, "Sec-Fetch-Site");
    if (!changes_something(call)) return true;
    if (origin != NULL) return origin_is_ours(call, origin);
    return site == NULL || strcmp(site, "same-origin") == 0 || strcmp(site, "none") == 0;
}

/* True when the other end is the reverse proxy, whose headers count. */
static bool is_from_proxy(const struct call *call)
{
    const struct config *config = &call->service->config;
    if (!config->behind_proxy) return false;
    return config->proxy_addresses[0] == '\0' ||
           peers_have(config->proxy_addresses, call->request->peer);
}

/* The address that asks: behind a proxy the one that the proxy names. */
static void find_client(struct call *call)
{
    const char *forwarded = http_request_header(call->request, "X-Forwarded-For");
    if (forwarded != NULL && is_from_proxy(call) &&
        query_forwarded_for(forwarded, call->client, sizeof call->client))
        return;
    (void)snprintf(call->client, sizeof call->client, "%s", call->request->peer);
}

static bool within_rate(struct call *call, struct http_response *ret)
{
    struct service *service = call->service;
    const int limit = atomic_load_explicit(&service->rate_limit, memory_order_relaxed);
    const int burst = atomic_load_explicit(&service->rate_burst, memory_order_relaxed);
    const bool local = call->who.id[0] == '-' && listen_text_is_loopback(call->client);
    if (limit == 0 || local) return true;
    const int wait_s = rate_take(service->rate, call->client, limit, burst, http_now_ms());
    if (wait_s == 0) return true;
    metrics_count(METRIC_REFUSED_RATE);
    http_header(ret, "Retry-After", "%d", wait_s);
    reply_refusal(call->request, ret, PROBLEM_RATE, WORD_DAEMON_REFUSAL_RATE,
                  WORDS(word_count("limit", limit), word_count("wait", wait_s)));
    return false;
}

static bool refuse_unknown(struct call *call, enum auth_verdict verdict, struct http_response *ret)
{
    static const enum word details[] = {
        [AUTH_NO_TOKEN] = WORD_DAEMON_REFUSAL_NO_TOKEN,
        [AUTH_BAD_TOKEN] = WORD_DAEMON_REFUSAL_BAD_TOKEN,
        [AUTH_EXPIRED] = WORD_DAEMON_REFUSAL_EXPIRED_TOKEN,
    };
    metrics_count(METRIC_REFUSED_AUTH);
    /* Refused without a token: that is how a browser learns to ask for one; not worth a record. */
    if (verdict != AUTH_NO_TOKEN)
        (void)audit_change(call->service->audit, "-", "access", call->id_text, "401");
    http_header_static(ret, "WWW-Authenticate",
                       "Bearer realm=\"ischia\", Basic realm=\"ischia\", charset=\"UTF-8\"");
    reply_refusal(call->request, ret, PROBLEM_UNAUTHORIZED, details[verdict], NULL);
    return false;
}

/* Who has signed in at the reverse proxy. ABSENT: nobody is named, or not by the proxy. */
enum user_answer { USER_ABSENT, USER_NAMED, USER_BAD };

/* Letter by letter: to be another's namesake but for a capital makes nobody an administrator. */
static bool is_listed(const char *list, const char *name)
{
    static const char between[] = ", \t";
    const size_t length = strlen(name);
    for (list += strspn(list, between); *list != '\0'; list += strspn(list, between)) {
        const size_t entry = strcspn(list, between);
        if (entry == length && strncmp(list, name, length) == 0) return true;
        list += entry;
    }
    return false;
}

static enum user_answer find_user(struct call *call)
{
    const struct config *config = &call->service->config;
    if (config->user_header[0] == '\0' || !is_from_proxy(call)) return USER_ABSENT;
    const char *name = http_request_header(call->request, config->user_header);
    if (name == NULL || name[0] == '\0') return USER_ABSENT;
    const unsigned scopes =
        is_listed(config->user_admins, name) ? AUTH_ALL : auth_parse_scopes(config->user_scopes);
    /* Twice: the proxy added its own to what the client sent, and either may stand first. */
    if (http_request_header_count(call->request, config->user_header) != 1) return USER_BAD;
    return auth_user(name, scopes, &call->who) ? USER_NAMED : USER_BAD;
}

static bool refuse_user(struct call *call, struct http_response *ret)
{
    metrics_count(METRIC_REFUSED_AUTH);
    (void)audit_change(call->service->audit, "-", "access", call->id_text, "401");
    http_header_static(ret, "WWW-Authenticate", "Bearer realm=\"ischia\"");
    reply_refusal(call->request, ret, PROBLEM_UNAUTHORIZED, WORD_DAEMON_REFUSAL_USER,
                  WORDS(word_text("header", call->service->config.user_header)));
    return false;
}

/* By the proxy's word, else by token. Where the proxy has the word, an open door without tokens
 * would let in whoever reaches this port past the proxy. */
static enum auth_verdict identify(struct call *call, enum user_answer user)
{
    if (user == USER_NAMED) return AUTH_GRANTED;
    const char *header = http_request_header(call->request, "Authorization");
    const enum auth_verdict verdict =
        auth_check(call->service->auth, header, unix_ms(), &call->who);
    if (call->service->config.user_header[0] == '\0' || call->who.id[0] != '-') return verdict;
    call->who.scopes = 0;
    return verdict == AUTH_GRANTED ? AUTH_NO_TOKEN : verdict;
}

static const char *scope_name(unsigned scope)
{
    if (scope & AUTH_ADMIN) return "admin";
    return scope & AUTH_ASSESS ? "assess" : "read";
}

static bool is_cds(const struct call *call)
{
    return strncmp(call->request->target, "/cds-services", 13) == 0;
}

/* A record system shows who it is with a token that it signed itself. */
static bool authorize_issuer(struct call *call, struct http_response *ret)
{
    char audience[CONFIG_TEXT_BYTES + HTTP_PATH_BYTES], issuer[TRUST_ISSUER_BYTES] = "";
    unsigned char digest[DIGEST_BYTES];
    char hex[DIGEST_HEX_BYTES];
    const char *target = call->request->target;
    (void)snprintf(audience, sizeof audience, "%s%.*s", call->service->config.public_url,
                   (int)strcspn(target, "?"), target);
    const char *why =
        trust_check(call->service->trust, http_request_header(call->request, "Authorization"),
                    audience, unix_ms() / 1000, issuer);
    if (why == NULL) {
        const struct digest_part part = digest_text(issuer);
        digest_parts(&part, 1, digest);
        digest_hex(digest, hex);
        (void)snprintf(call->who.id, sizeof call->who.id, "iss-%.12s", hex);
        call->who.scopes = AUTH_READ;
        return true;
    }
    metrics_count(METRIC_REFUSED_AUTH);
    (void)audit_change(call->service->audit, "-", "access", "", "401");
    http_header_static(ret, "WWW-Authenticate", "Bearer realm=\"ischia\"");
    reply_refusal_english(call->request, ret, PROBLEM_UNAUTHORIZED, "%s", why);
    return false;
}

static bool authorize(struct call *call, struct http_response *ret)
{
    const unsigned needed = call->route == NULL ? 0 : call->route->scope;
    if (needed != 0 && is_cds(call) && call->service->trust != NULL)
        return within_rate(call, ret) && authorize_issuer(call, ret);
    const enum user_answer user = find_user(call);
    const enum auth_verdict verdict = identify(call, user);
    if (verdict == AUTH_GRANTED && call->who.id[0] != '-')
        (void)snprintf(call->client, sizeof call->client, "%s", call->who.id);
    if (!within_rate(call, ret)) return false;
    if (needed == 0) return true;
    if (user == USER_BAD) return refuse_user(call, ret);
    if (verdict != AUTH_GRANTED) return refuse_unknown(call, verdict, ret);
    if ((call->who.scopes & needed) == needed) return true;
    metrics_count(METRIC_REFUSED_AUTH);
    (void)audit_change(call->service->audit, call->who.id, "access", call->id_text, "403");
    reply_refusal(call->request, ret, PROBLEM_FORBIDDEN, WORD_DAEMON_REFUSAL_SCOPE,
                  WORDS(word_text("scope", scope_name(needed))));
    return false;
}

bool guard_admit(struct call *call, struct http_response *ret)
{
    call->who = (struct auth_identity){.id = "-", .scopes = 0};
    find_client(call);
    if (!host_is_ours(call)) {
        metrics_count(METRIC_REFUSED_ORIGIN);
        reply_refusal(call->request, ret, PROBLEM_FORBIDDEN, WORD_DAEMON_REFUSAL_HOST, NULL);
        return false;
    }
    if (!origin_is_fine(call)) {
        metrics_count(METRIC_REFUSED_ORIGIN);
        reply_refusal(call->request, ret, PROBLEM_FORBIDDEN, WORD_DAEMON_REFUSAL_ORIGIN, NULL);
        return false;
    }
    return authorize(call, ret);
}

/* The clinic page: its own scripts and styles, pictures it draws, and nobody else's anything. */
static const char page_policy[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; font-src 'self'; worker-src 'self' blob:; manifest-src 'self'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'";
static const char document_policy[] = "default-src 'none'; frame-ancestors 'none'";
/* An SVG opened by itself is a document of this origin: it may do nothing. */
static const char picture_policy[] = "default-src 'none'; sandbox";

static const char *policy_of(const char *type)
{
    if (type == NULL) return document_policy;
    if (strncmp(type, "text/html", 9) == 0) return page_policy;
    return strncmp(type, "image/svg", 9) == 0 ? picture_policy : document_policy;
}

/* Record systems that run in a browser: those on the list of origins may read CDS services. */
static void put_cors(const struct call *call, struct http_response *response)
{
    const char *origin = http_request_header(call->request, "Origin");
    if (origin == NULL || !is_cds(call) ||
        !query_list_has(call->service->config.allowed_origins, origin))
        return;
    http_header(response, "Access-Control-Allow-Origin", "%s", origin);
    http_header_static(response, "Vary", "Origin");
    if (call->request->method != HTTP_OPTIONS) return;
    http_header_static(response, "Access-Control-Allow-Methods", "GET, POST, OPTIONS");
    http_header_static(response, "Access-Control-Allow-Headers", "Authorization, Content-Type");
    http_header_static(response, "Access-Control-Max-Age", "600");
}

void guard_headers(const struct call *call, struct http_response *response)
{
    if (call != NULL) put_cors(call, response);
    /* A browser gives what it has kept the headers of a 304, which has no type to tell a page by: a
     * policy here would take the scripts from a page on its second visit. */
    if (response->status != 304)
        http_header_static(response, "Content-Security-Policy", policy_of(response->type));
    http_header_static(response, "X-Content-Type-Options", "nosniff");
    http_header_static(response, "X-Frame-Options", "DENY");
    /* Not no-referrer: under it a browser sends a plain form's Origin as null, which is refused. */
    http_header_static(response, "Referrer-Policy", "same-origin");
    http_header_static(response, "Cross-Origin-Resource-Policy", "same-origin");
    http_header_static(response, "Cross-Origin-Opener-Policy", "same-origin");
    http_header_static(response, "Permissions-Policy", "camera=(), geolocation=(), microphone=()");
    if (call != NULL && call->request->tls)
        http_header_static(response, "Strict-Transport-Security", "max-age=31536000");
}
