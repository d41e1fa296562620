/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/http/routes.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "api/fhir.h"
#include "api/problem_doc.h"
#include "server/http/guard.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/log.h"
#include "server/metrics.h"

enum { RECORD_BYTES_MAX = 256 * 1024, SEARCH_BYTES_MAX = 4096 };
enum { STUDY_BYTES_MAX = 1024 * 1024 };
enum { CASE_BYTES_MAX = 64 * 1024, EMPTY_BODY_BYTES_MAX = 1024, ROUTES_MAX = 64 };

#define JSON       "application/json"
#define FORM       "application/x-www-form-urlencoded"
#define HTML       "text/html; charset=utf-8"
#define TYPES(...) ((const char *const[]){__VA_ARGS__, NULL})
#define ASSESSMENT "/v1/assessments/{id}"
#define STUDY      "/v1/studies/{id}"
#define CSV        "text/csv"

#define FHIR_TYPES TYPES("application/fhir+json", "application/json")
#define FHIR_QUERY TYPES("_format", "_pretty")
/* What a server offers of one type: reading, and for some searching in both forms. */
#define FHIR_READ(type, audit)                                                                     \
    {                                                                                              \
        HTTP_GET, "/fhir/" type "/{file}", "GET /fhir/" type "/{file}", handle_fhir_read,          \
            AUTH_READ, 0, NULL, FHIR_TYPES, FHIR_QUERY, audit, false                               \
    }
#define FHIR_DEFINITION(type)                                                                      \
    {                                                                                              \
        HTTP_GET, "/fhir/" type "/{file}", "GET /fhir/" type "/{file}", handle_fhir_read, 0, 0,    \
            NULL, FHIR_TYPES, FHIR_QUERY, NULL, false                                              \
    }
#define FHIR_SEARCH(type)                                                                          \
    {                                                                                              \
        HTTP_GET, "/fhir/" type, "GET /fhir/" type, handle_fhir_search, AUTH_READ, 0, NULL,        \
            FHIR_TYPES, fhir_search_keys, "assessment.list", false                                 \
    }
#define CDS_HOOK(id)                                                                               \
    {                                                                                              \
        HTTP_POST, "/cds-services/" id, "POST /cds-services/" id, handle_cds_hook, AUTH_READ,      \
            RECORD_BYTES_MAX, TYPES(JSON), TYPES(JSON), NULL, "cds.hook", false                    \
    }
#define CDS_FEEDBACK(id)                                                                           \
    {                                                                                              \
        HTTP_POST, "/cds-services/" id "/feedback", "POST /cds-services/" id "/feedback",          \
            handle_cds_feedback, AUTH_READ, RECORD_BYTES_MAX, TYPES(JSON), TYPES(JSON), NULL,      \
            "cds.feedback", false                                                                  \
    }
#define FHIR_POST_SEARCH(type)                                                                     \
    {                                                                                              \
        HTTP_POST, "/fhir/" type "/_search", "POST /fhir/" type "/_search", handle_fhir_search,    \
            AUTH_READ, SEARCH_BYTES_MAX, TYPES(FORM), FHIR_TYPES, fhir_search_keys,                \
            "assessment.list", false                                                               \
    }

const struct route routes[] = {
    {HTTP_POST, "/v1/assessments", "POST /v1/assessments", handle_submit, AUTH_ASSESS,
     CASE_BYTES_MAX, TYPES(JSON, FORM), TYPES(JSON, "text/html"), TYPES("lang"),
     "assessment.create", false},
    {HTTP_GET, "/v1/assessments", "GET /v1/assessments", handle_list, AUTH_READ, 0, NULL,
     TYPES(JSON, "text/csv"), TYPES("subject", "side", "status", "limit", "cursor"),
     "assessment.list", false},
    {HTTP_GET, ASSESSMENT, "GET " ASSESSMENT, handle_get, AUTH_READ, 0, NULL, TYPES(JSON), NULL,
     "assessment.read", false},
    {HTTP_DELETE, ASSESSMENT, "DELETE " ASSESSMENT, handle_erase, AUTH_ADMIN, EMPTY_BODY_BYTES_MAX,
     NULL, NULL, NULL, "assessment.erase", false},
    {HTTP_POST, ASSESSMENT "/cancel", "POST " ASSESSMENT "/cancel", handle_cancel, AUTH_ASSESS,
     EMPTY_BODY_BYTES_MAX, NULL, TYPES(JSON), TYPES("lang"), "assessment.cancel", false},
    {HTTP_GET, ASSESSMENT "/events", "GET " ASSESSMENT "/events", handle_events, AUTH_READ, 0, NULL,
     TYPES("text/event-stream"), NULL, "assessment.read", false},
    {HTTP_GET, ASSESSMENT "/field.vtu", "GET " ASSESSMENT "/field.vtu", handle_field, AUTH_READ, 0,
     NULL, TYPES("application/vnd.vtk.vtu", "application/xml"), NULL, "assessment.read", false},
    {HTTP_GET, ASSESSMENT "/section.svg", "GET " ASSESSMENT "/section.svg", handle_section,
     AUTH_READ, 0, NULL, TYPES("image/svg+xml"), TYPES("lang"), "assessment.read", false},
    {HTTP_GET, ASSESSMENT "/report", "GET " ASSESSMENT "/report", handle_report, AUTH_READ, 0, NULL,
     TYPES("text/html"), TYPES("wait", "lang"), "assessment.read", false},
    {HTTP_POST, "/v1/estimates", "POST /v1/estimates", handle_estimate, AUTH_ASSESS, CASE_BYTES_MAX,
     TYPES(JSON), TYPES(JSON), NULL, NULL, false},
    {HTTP_POST, "/v1/estimates/what-if", "POST /v1/estimates/what-if", handle_what_if, AUTH_ASSESS,
     CASE_BYTES_MAX, TYPES(JSON), TYPES(JSON), TYPES("parameter", "points"), NULL, false},
    {HTTP_POST, "/v1/studies", "POST /v1/studies", handle_study_submit, AUTH_ASSESS,
     STUDY_BYTES_MAX, TYPES(JSON, CSV), TYPES(JSON), TYPES("name", "model", "resolution"),
     "study.create", false},
    {HTTP_GET, "/v1/studies", "GET /v1/studies", handle_study_list, AUTH_READ, 0, NULL, TYPES(JSON),
     TYPES("limit", "cursor"), "study.list", false},
    {HTTP_GET, STUDY, "GET " STUDY, handle_study_get, AUTH_READ, 0, NULL, TYPES(JSON), NULL,
     "study.read", false},
    {HTTP_DELETE, STUDY, "DELETE " STUDY, handle_study_erase, AUTH_ADMIN, EMPTY_BODY_BYTES_MAX,
     NULL, NULL, NULL, "study.erase", false},
    {HTTP_POST, STUDY "/cancel", "POST " STUDY "/cancel", handle_study_cancel, AUTH_ASSESS,
     EMPTY_BODY_BYTES_MAX, NULL, TYPES(JSON), NULL, "study.cancel", false},
    {HTTP_GET, STUDY "/results", "GET " STUDY "/results", handle_study_results, AUTH_READ, 0, NULL,
     TYPES(JSON, CSV), NULL, "study.read", false},
    {HTTP_GET, "/v1/parameters", "GET /v1/parameters", handle_parameters, 0, 0, NULL, TYPES(JSON),
     TYPES("lang"), NULL, false},
    {HTTP_GET, "/v1/changes", "GET /v1/changes", handle_changes, AUTH_READ, 0, NULL, TYPES(JSON),
     TYPES("since", "limit"), "changes.read", false},
    {HTTP_GET, "/openapi.json", "GET /openapi.json", handle_openapi, 0, 0, NULL, TYPES(JSON), NULL,
     NULL, false},
    {HTTP_GET, "/healthz", "GET /healthz", handle_health, 0, 0, NULL, TYPES(JSON), NULL, NULL,
     false},
    {HTTP_GET, "/readyz", "GET /readyz", handle_ready, 0, 0, NULL, TYPES(JSON), NULL, NULL, false},
    {HTTP_GET, "/metrics", "GET /metrics", handle_metrics, AUTH_READ, 0, NULL, TYPES("text/plain"),
     NULL, NULL, false},
    {HTTP_GET, "/version", "GET /version", handle_version, 0, 0, NULL, TYPES(JSON), NULL, NULL,
     false},
    {HTTP_GET, "/fhir/metadata", "GET /fhir/metadata", handle_fhir_metadata, 0, 0, NULL, FHIR_TYPES,
     TYPES("_format", "_pretty", "mode"), NULL, false},
    {HTTP_POST, "/fhir/$assess", "POST /fhir/$assess", handle_fhir_assess, AUTH_ASSESS,
     RECORD_BYTES_MAX, FHIR_TYPES, FHIR_TYPES, FHIR_QUERY, "assessment.create", false},
    {HTTP_GET, "/fhir/async/{id}", "GET /fhir/async/{id}", handle_fhir_async, AUTH_READ, 0, NULL,
     FHIR_TYPES, FHIR_QUERY, "assessment.read", false},
    {HTTP_DELETE, "/fhir/async/{id}", "DELETE /fhir/async/{id}", handle_fhir_cancel, AUTH_ASSESS,
     EMPTY_BODY_BYTES_MAX, NULL, FHIR_TYPES, FHIR_QUERY, "assessment.cancel", false},
    FHIR_SEARCH("RiskAssessment"),
    FHIR_POST_SEARCH("RiskAssessment"),
    FHIR_READ("RiskAssessment", "assessment.read"),
    FHIR_SEARCH("DiagnosticReport"),
    FHIR_POST_SEARCH("DiagnosticReport"),
    FHIR_READ("DiagnosticReport", "assessment.read"),
    FHIR_READ("Observation", "assessment.read"),
    FHIR_READ("Provenance", "assessment.read"),
    FHIR_DEFINITION("Device"),
    FHIR_DEFINITION("OperationDefinition"),
    FHIR_DEFINITION("CodeSystem"),
    FHIR_DEFINITION("StructureDefinition"),
    {HTTP_GET, "/cds-services", "GET /cds-services", handle_cds_discovery, 0, 0, NULL, TYPES(JSON),
     NULL, NULL, false},
    CDS_HOOK("ischia-patient-view"),
    CDS_FEEDBACK("ischia-patient-view"),
    CDS_HOOK("ischia-order-select"),
    CDS_FEEDBACK("ischia-order-select"),
    {HTTP_GET, "/docs", "GET /docs", handle_docs, 0, 0, NULL, TYPES("text/html"), NULL, NULL, true},
    {HTTP_GET, "/", "GET /", handle_home, 0, 0, NULL, TYPES("text/html"), TYPES("from", "lang"),
     NULL, true},
    {HTTP_GET, "/form", "GET /form", handle_form, 0, 0, NULL, TYPES("text/html"), TYPES("lang"),
     NULL, true},
    {HTTP_GET, "/assessments", "GET /assessments", handle_past, 0, 0, NULL, TYPES("text/html"),
     TYPES("subject", "side", "status", "limit", "cursor", "with", "lang"), NULL, true},
    {HTTP_GET, "/assessments/{id}", "GET /assessments/{id}", handle_result, 0, 0, NULL,
     TYPES("text/html"), TYPES("with", "lang", "plain"), NULL, true},
    {HTTP_GET, "/assets/{file}", "GET /assets/{file}", handle_asset, 0, 0, NULL, NULL, NULL, NULL,
     true},
};
const size_t route_count = sizeof routes / sizeof routes[0];

enum route_contract route_contract_of(const struct route *route)
{
    if (strncmp(route->path, "/fhir/", 6) == 0) return ROUTE_FHIR;
    return strncmp(route->path, "/cds-services", 13) == 0 ? ROUTE_CDS : ROUTE_OPENAPI;
}

/* ------------------------------------------------------------------------- finding */

/* One segment of a path and of a template. */
static bool segment_matches(const char *template, size_t template_length, const char *path,
                            size_t length, char *ret_id, size_t id_size)
{
    if (template_length != 4 || memcmp(template, "{id}", 4) != 0)
        return template_length == length && memcmp(template, path, length) == 0;
    if (length == 0 || length >= id_size) {
        ret_id[0] = '\0';
        return length > 0;
    }
    memcpy(ret_id, path, length);
    ret_id[length] = '\0';
    return true;
}

static bool path_matches(const char *template, const char *path, char *ret_id, size_t id_size,
                         char *ret_rest, size_t rest_size)
{
    while (*template == '/' && *path == '/') {
        template ++;
        path++;
        const size_t template_length = strcspn(template, "/"), length = strcspn(path, "/");
        if (strcmp(template, "{file}") == 0) {
            (void)snprintf(ret_rest, rest_size, "%s", path);
            return *path != '\0';
        }
        if (!segment_matches(template, template_length, path, length, ret_id, id_size))
            return false;
        template += template_length;
        path += length;
    }
    return *template == '\0' && *path == '\0';
}

const struct route *route_find(enum http_method method, const char *path, char *ret_id,
                               size_t id_size, char *ret_rest, size_t rest_size,
                               unsigned *ret_allowed)
{
    const struct route *found = NULL;
    const enum http_method wanted = method == HTTP_HEAD ? HTTP_GET : method;
    *ret_allowed = 0;
    for (size_t i = 0; i < route_count; i++) {
        if (!path_matches(routes[i].path, path, ret_id, id_size, ret_rest, rest_size)) continue;
        *ret_allowed |= 1U << routes[i].method;
        if (routes[i].method == HTTP_GET) *ret_allowed |= 1U << HTTP_HEAD;
        if (routes[i].method == wanted) found = &routes[i];
    }
    if (*ret_allowed != 0) *ret_allowed |= 1U << HTTP_OPTIONS;
    return found;
}

void routes_print(FILE *out)
{
    static const char *const contract_words[] = {
        [ROUTE_OPENAPI] = "", [ROUTE_FHIR] = "fhir ", [ROUTE_CDS] = "cds "};
    for (size_t i = 0; i < route_count; i++)
        (void)fprintf(out, "%s %s%s%s%s\n", routes[i].name,
                      routes[i].is_page ? "page " : contract_words[route_contract_of(&routes[i])],
                      routes[i].scope == 0           ? "open"
                      : routes[i].scope == AUTH_READ ? "read"
                                                     : "",
                      routes[i].scope == AUTH_ASSESS ? "assess" : "",
                      routes[i].scope == AUTH_ADMIN ? "admin" : "");
}

/* ---------------------------------------------------------------------------- calls */

struct deferred *deferred_create(struct call *call)
{
    struct deferred *deferred = calloc(1, sizeof *deferred);
    if (deferred == NULL) return NULL;
    atomic_store(&deferred->owners, 2);
    deferred->exchange = call->request->exchange;
    http_hold(deferred->exchange);
    call->deferred = deferred;
    return deferred;
}

void deferred_drop(struct deferred *deferred)
{
    if (atomic_fetch_sub(&deferred->owners, 1) > 1) return;
    free(deferred->bytes);
    free(deferred);
}

void deferred_complete(struct deferred *deferred)
{
    struct http_exchange *exchange = deferred->exchange;
    atomic_store(&deferred->done, true);
    http_wake(exchange);
    http_release(exchange);
    deferred_drop(deferred);
}

static void wake_call(void *context) { http_wake(context); }

bool call_subscribe(struct call *call)
{
    struct ischia_error err;
    if (call->subscription != NULL) return true;
    return events_subscribe(call->service->events, &call->id, wake_call, call->request->exchange,
                            &call->subscription, &err) == ISCHIA_OK;
}

bool call_still_waits(const struct call *call, bool ended)
{
    return !ended && http_now_ms() < call->deadline_ms && call->subscription != NULL &&
           !http_is_stopping(call->service->http);
}

void call_wait(struct call *call, struct http_response *response)
{
    response->action = HTTP_WAIT;
    response->wake_at_ms = call->deadline_ms;
}

/* ------------------------------------------------------------------------- dispatch */

static void put_allow(struct http_response *ret, unsigned allowed)
{
    char list[64] = "";
    size_t used = 0;
    for (int i = 0; i < HTTP_OTHER; i++) {
        if ((allowed & (1U << i)) == 0) continue;
        const int n = snprintf(list + used, sizeof list - used, "%s%s", used == 0 ? "" : ", ",
                               http_method_names[i]);
        if (n > 0 && (size_t)n < sizeof list - used) used += (size_t)n;
    }
    http_header(ret, "Allow", "%s", list);
}

static bool refuse_route(struct call *call, struct http_response *ret)
{
    if (call->allowed == 0) {
        reply_refusal(call->request, ret, PROBLEM_NOT_FOUND, WORD_DAEMON_REFUSAL_NO_ADDRESS, NULL);
        return false;
    }
    put_allow(ret, call->allowed);
    if (call->request->method == HTTP_OPTIONS)
        ret->status = 204;
    else
        reply_refusal(call->request, ret, PROBLEM_METHOD, WORD_DAEMON_REFUSAL_METHOD, NULL);
    return false;
}

static bool takes_type(const struct route *route, const char *content_type)
{
    if (content_type == NULL) return false;
    for (int i = 0; route->takes[i] != NULL; i++)
        if (query_media_type_is(content_type, route->takes[i])) return true;
    return false;
}

/* What the client wants to have: under /fhir the parameter _format comes before the header. */
static const char *wanted_type(const struct call *call)
{
    static const struct {
        const char *word, *type;
    } formats[] = {
        {"json", FHIR_MEDIA_TYPE},
        {"application/fhir+json", FHIR_MEDIA_TYPE},
        {"application/fhir json", FHIR_MEDIA_TYPE}, /* a '+' that was not escaped */
        {"application/json", "application/json"},
        {"text/json", "application/json"},
    };
    char format[64];
    const bool fhir = route_contract_of(call->route) == ROUTE_FHIR;
    if (!fhir || query_find(call->request->query, "_format", format, sizeof format) == QUERY_ABSENT)
        return http_request_header(call->request, "Accept");
    for (size_t i = 0; i < sizeof formats / sizeof formats[0]; i++)
        if (strcmp(format, formats[i].word) == 0) return formats[i].type;
    return "application/fhir+xml"; /* whatever it is, it is not given */
}

/* Bodies are read as they come: one that is packed would be taken for what it is not. */
static bool is_sent_plain(struct call *call, struct http_response *ret)
{
    const char *encoding = http_request_header(call->request, "Content-Encoding");
    if (encoding == NULL || strcasecmp(encoding, "identity") == 0) return true;
    http_header_static(ret, "Accept-Encoding", "identity");
    reply_refusal(call->request, ret, PROBLEM_MEDIA_TYPE_WRONG, WORD_DAEMON_REFUSAL_ENCODING, NULL);
    return false;
}

static bool agree_on_types(struct call *call, struct http_response *ret)
{
    const struct route *route = call->route;
    const char *content_type = http_request_header(call->request, "Content-Type");
    if (route->takes != NULL && !takes_type(route, content_type)) {
        reply_refusal(
            call->request, ret, PROBLEM_MEDIA_TYPE_WRONG,
            route->takes[1] == NULL ? WORD_DAEMON_REFUSAL_SEND : WORD_DAEMON_REFUSAL_SEND_EITHER,
            WORDS(word_text("type", route->takes[0]), word_text("other", route->takes[1])));
        return false;
    }
    if (route->takes != NULL && !is_sent_plain(call, ret)) return false;
    if (route->gives == NULL) return true;
    call->accepted = query_accept(wanted_type(call), route->gives);
    if (call->accepted >= 0) return true;
    reply_refusal(call->request, ret, PROBLEM_NOT_ACCEPTABLE,
                  route->gives[1] == NULL ? WORD_DAEMON_REFUSAL_GIVEN_AS
                                          : WORD_DAEMON_REFUSAL_GIVEN_AS_EITHER,
                  WORDS(word_text("type", route->gives[0]), word_text("other", route->gives[1])));
    return false;
}

static bool read_query(struct call *call, struct http_response *ret)
{
    static const char *const none[] = {NULL};
    char name[64];
    const char *const *known = call->route->queries == NULL ? none : call->route->queries;
    const bool fhir = route_contract_of(call->route) == ROUTE_FHIR;
    const char *prefer = http_request_header(call->request, "Prefer");
    if (fhir && prefer != NULL && strstr(prefer, "handling=lenient") != NULL) return true;
    if (call->route->is_page || !query_unknown(call->request->query, known, name, sizeof name))
        return true;
    reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_QUERY_KEY,
                  WORDS(word_text("name", name)));
    return false;
}

static bool speaks_english_only(const char *target)
{
    return strncmp(target, "/fhir", 5) == 0 || strncmp(target, "/cds-services", 13) == 0;
}

/* "lang" in the query comes before the header; what programs speak among each other is English. */
static void read_language(struct call *call)
{
    char tag[8];
    enum language asked;
    struct http_request *request = call->request;
    if (speaks_english_only(request->target)) return;
    request->language =
        query_language(http_request_header(request, "Accept-Language"), language_tags);
    if (query_find(request->query, "lang", tag, sizeof tag) != QUERY_FOUND ||
        !words_language(tag, &asked))
        return;
    request->language = (int)asked;
    (void)snprintf(call->lang_query, sizeof call->lang_query, "?lang=%s", language_tags[asked]);
}

/* A language that we do not have is refused, but for pages: those are there for people. */
static bool has_known_language(struct call *call, struct http_response *ret)
{
    char known[4 * LANGUAGE_COUNT + 1] = "";
    const bool absent =
        query_find(call->request->query, "lang", known, sizeof known) == QUERY_ABSENT;
    if (absent || call->lang_query[0] != '\0' || call->route->is_page) return true;
    known[0] = '\0';
    for (int l = 0; l < LANGUAGE_COUNT; l++) {
        const size_t used = strlen(known);
        (void)snprintf(known + used, sizeof known - used, "%s%s", l == 0 ? "" : ", ",
                       language_tags[l]);
    }
    reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_QUERY_LANGUAGE,
                  WORDS(word_text("known", known)));
    return false;
}

static bool read_path(struct call *call, struct http_response *ret)
{
    char path[HTTP_PATH_BYTES], id[64] = "";
    const char *target = call->request->target;
    if (!query_decode(target, strcspn(target, "?"), false, path, sizeof path)) {
        reply_refusal(call->request, ret, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_ADDRESS, NULL);
        return false;
    }
    call->route = route_find(call->request->method, path, id, sizeof id, call->rest,
                             sizeof call->rest, &call->allowed);
    if (uuid_parse(id, &call->id)) uuid_format(&call->id, call->id_text);
    return true;
}

/* An {id} that no assessment or study can have is simply not found. */
static bool has_usable_id(struct call *call, struct http_response *ret)
{
    if (strstr(call->route->path, "/v1/") == NULL || strstr(call->route->path, "{id}") == NULL ||
        call->id_text[0] != '\0')
        return true;
    if (strncmp(call->route->path, STUDY, strlen(STUDY)) == 0)
        reply_no_study(call, ret);
    else
        reply_no_assessment(call, ret);
    return false;
}

static bool refuse_while_stopping(struct call *call, struct http_response *ret)
{
    if (call->request->method == HTTP_GET || call->request->method == HTTP_HEAD ||
        !atomic_load_explicit(&call->service->draining, memory_order_relaxed))
        return true;
    http_header_static(ret, "Retry-After", "10");
    reply_refusal(call->request, ret, PROBLEM_UNAVAILABLE, WORD_DAEMON_REFUSAL_STOPPING, NULL);
    return false;
}

static bool admit(struct call *call, struct http_response *ret)
{
    if (!read_path(call, ret) || !guard_admit(call, ret)) return false;
    if (call->route == NULL) return refuse_route(call, ret);
    return refuse_while_stopping(call, ret) && has_usable_id(call, ret) &&
           agree_on_types(call, ret) && read_query(call, ret) && has_known_language(call, ret);
}

static bool on_head(void *context, struct http_request *request, size_t *ret_body_max,
                    struct http_response *ret_refusal)
{
    struct call *call = calloc(1, sizeof *call);
    if (call == NULL) {
        ret_refusal->action = HTTP_DROP;
        return false;
    }
    call->service = context;
    call->request = request;
    request->state = call;
    read_language(call);
    if (!admit(call, ret_refusal)) {
        guard_headers(call, ret_refusal);
        return false;
    }
    *ret_body_max = call->route->body_max;
    return true;
}

static void on_request(void *context, struct http_request *request, struct http_response *ret)
{
    struct call *call = request->state;
    (void)context;
    call->route->handler(call, ret);
    if (ret->action != HTTP_WAIT) guard_headers(call, ret);
}

static void on_refuse(void *context, struct http_request *request, int status,
                      struct http_response *ret)
{
    static const struct {
        int status;
        enum problem_kind kind;
        enum word detail;
    } refusals[] = {
        {400, PROBLEM_BAD_REQUEST, WORD_DAEMON_REFUSAL_HEAD_TWICE},
        {408, PROBLEM_TIMEOUT, WORD_DAEMON_REFUSAL_LATE},
        {413, PROBLEM_TOO_LARGE, WORD_DAEMON_REFUSAL_BODY},
        {431, PROBLEM_HEADERS_TOO_LARGE, WORD_DAEMON_REFUSAL_HEAD},
    };
    const size_t last = sizeof refusals / sizeof refusals[0] - 1;
    size_t i = 0;
    (void)context;
    while (i < last && refusals[i].status != status) i++;
    reply_refusal(request, ret, refusals[i].kind, refusals[i].detail, NULL);
    guard_headers(request == NULL ? NULL : request->state, ret);
}

/* What was done to which assessment goes into the audit log, whatever came of it. */
static void record(struct call *call, int status)
{
    const struct route *route = call->route;
    char outcome[8];
    if (route == NULL || route->audit == NULL || status == 0 || status == 401) return;
    if (route->method == HTTP_GET) {
        if (status == 200 || status == 304)
            (void)audit_read(call->service->audit, call->who.id, route->audit, call->id_text,
                             http_now_ms());
        return;
    }
    (void)snprintf(outcome, sizeof outcome, "%d", status);
    (void)audit_change(call->service->audit, call->who.id, route->audit, call->id_text, outcome);
}

static void on_done(void *context, struct http_request *request, int status)
{
    struct call *call = request->state;
    (void)context;
    if (call == NULL) return;
    const double seconds = (double)(http_now_ms() - request->begun_ms) / 1e3;
    const size_t route = call->route == NULL ? route_count : (size_t)(call->route - routes);
    if (status != 0) metrics_http(route, status, seconds);
    record(call, status);
    events_unsubscribe(call->subscription);
    if (call->deferred != NULL) deferred_drop(call->deferred);
    free(call);
}

static void on_connection(void *context, int change)
{
    (void)context;
    metrics_add(METRIC_CONNECTIONS, change);
}

static void on_slow_client(void *context)
{
    (void)context;
    metrics_count(METRIC_SLOW_CLIENTS);
}

static void on_log(void *context, const char *message)
{
    struct log_value quoted;
    (void)context;
    LOG_DEBUG("http", "detail=%s", log_quote(&quoted, message));
}

struct http_app service_app(struct service *service)
{
    static const char *names[ROUTES_MAX];
    _Static_assert(sizeof routes / sizeof routes[0] <= ROUTES_MAX, "metrics have room for 64");
    for (size_t i = 0; i < route_count; i++) names[i] = routes[i].name;
    metrics_set_routes(names, route_count);
    return (struct http_app){.context = service,
                             .on_head = on_head,
                             .on_request = on_request,
                             .on_refuse = on_refuse,
                             .on_done = on_done,
                             .on_connection = on_connection,
                             .on_slow_client = on_slow_client,
                             .on_log = on_log};
}

void service_apply(struct service *service)
{
    atomic_store(&service->rate_limit, service->config.rate_limit);
    atomic_store(&service->rate_burst, service->config.rate_burst);
    if (service->queue != NULL) queue_set_limit(service->queue, service->config.queue_limit);
    store_set_idempotency(service->store, (int64_t)service->config.idempotency_hours * 3600 * 1000);
    audit_set_mode(service->audit, (enum config_audit)service->config.audit);
    log_set_level((enum log_level)service->config.log_level);
}
