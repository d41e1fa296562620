/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/fhir_date.h"
#include "server/http/fhir_http.h"
#include "server/http/query.h"
#include "server/http/reply.h"
#include "server/http/report.h"
#include "server/http/routes.h"
#include "server/intake.h"
#include "server/metrics.h"

/* Reading and searching under /fhir. Resources are made from the store's rows at each request. */

enum { COUNT_USUAL = 50, VALUE_BYTES = 2048 };

/* ---------------------------------------------------------------------------- shared */

void fhir_origin(const struct call *call, char ret[FHIR_BASE_BYTES])
{
    const char *configured = call->service->config.public_url;
    const char *host = http_request_header(call->request, "Host");
    const char *forwarded = http_request_header(call->request, "X-Forwarded-Proto");
    const bool outside_tls =
        call->service->config.behind_proxy && forwarded != NULL && strcmp(forwarded, "https") == 0;
    if (configured[0] != '\0')
        (void)snprintf(ret, FHIR_BASE_BYTES, "%.380s", configured);
    else
        (void)snprintf(ret, FHIR_BASE_BYTES, "%s://%.300s",
                       call->request->tls || outside_tls ? "https" : "http",
                       host == NULL ? "localhost" : host);
}

void fhir_base(const struct call *call, char ret[FHIR_BASE_BYTES])
{
    char origin[FHIR_BASE_BYTES];
    fhir_origin(call, origin);
    (void)snprintf(ret, FHIR_BASE_BYTES, "%.390s/fhir", origin);
}

int fhir_indent(const struct call *call)
{
    char value[8];
    (void)query_find(call->request->query, "_pretty", value, sizeof value);
    return strcmp(value, "true") == 0 ? 2 : 0;
}

void fhir_send(struct call *call, int status, struct json_out *out, struct http_response *ret)
{
    struct ischia_error err;
    char *text = NULL;
    size_t size = 0;
    if (json_out_take(out, &text, &size, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return;
    }
    ret->status = status;
    http_body(ret, call->route->gives[call->accepted], text, size);
    ret->compressible = true;
}

bool fhir_get_row(struct call *call, struct store_assessment *ret_row, struct http_response *ret)
{
    struct ischia_error err;
    enum store_answer answer = STORE_NOT_FOUND;
    memset(ret_row, 0, sizeof *ret_row);
    if (call->id_text[0] != '\0' &&
        store_get(call->service->store, &call->id, ret_row, &answer, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return false;
    }
    if (answer != STORE_DONE) reply_no_assessment(call, ret);
    return answer == STORE_DONE;
}

/* The report as an attachment for those that have ended, else "". */
static enum ischia_code attach_report(char **ret, const struct store_assessment *row,
                                      struct ischia_error *err)
{
    *ret = NULL;
    return queue_is_final(row->state) ? report_attachment(ret, row, err) : ISCHIA_OK;
}

/* -------------------------------------------------------------------------- metadata */

void handle_fhir_metadata(struct call *call, struct http_response *ret)
{
    struct json_out out;
    char base[FHIR_BASE_BYTES];
    fhir_base(call, base);
    json_out_init(&out, fhir_indent(call));
    json_open_object(&out, NULL);
    fhir_put_capability_statement(&out, base);
    json_close_object(&out);
    http_header_static(ret, "Cache-Control", "no-cache");
    fhir_send(call, 200, &out, ret);
}

/* ------------------------------------------------------------------------------ read */

static enum fhir_type type_of(const struct route *route)
{
    const char *name = route->path + strlen("/fhir/");
    for (int i = 0; i < FHIR_TYPE_COUNT; i++) {
        const size_t length = strlen(fhir_type_names[i]);
        if (strncmp(name, fhir_type_names[i], length) == 0 &&
            (name[length] == '/' || name[length] == '\0'))
            return (enum fhir_type)i;
    }
    return FHIR_TYPE_COUNT;
}

static void send_definition(struct call *call, enum fhir_type type, struct http_response *ret)
{
    struct json_out out;
    bool found = type == FHIR_DEVICE && strcmp(call->rest, FHIR_DEVICE_ID) == 0;
    json_out_init(&out, fhir_indent(call));
    if (found) {
        fhir_put_device(&out, NULL);
    } else {
        json_open_object(&out, NULL);
        found = fhir_put_definition(&out, type, call->rest);
        json_close_object(&out);
    }
    http_header_static(ret, "Cache-Control", "no-cache");
    if (found) {
        fhir_send(call, 200, &out, ret);
        return;
    }
    json_out_finish(&out);
    reply_refusal_english(call->request, ret, PROBLEM_NOT_FOUND, "There is no such %s.",
                          fhir_type_names[type]);
}

/* Which assessment the id in the path means, and which of its numbers. */
static void find_id(struct call *call, enum fhir_type type, int *ret_measure)
{
    char id[ASSESSMENT_ID_BYTES];
    const bool observation = type == FHIR_OBSERVATION;
    if (observation && !fhir_observation_id(call->rest, id, ret_measure)) return;
    if (uuid_parse(observation ? id : call->rest, &call->id)) uuid_format(&call->id, call->id_text);
}

/* False when the record has no such resource (yet). */
static bool put_resource(struct json_out *out, enum fhir_type type, const struct record *record,
                         int measure, const char *html)
{
    char digits[TEXT_NUMBER_BYTES];
    if (type == FHIR_OBSERVATION && record_digits(record, measure, digits)[0] == '\0') return false;
    if (type == FHIR_OBSERVATION) fhir_put_observation(out, NULL, record, measure);
    if (type == FHIR_RISK_ASSESSMENT) fhir_put_risk_assessment(out, NULL, record);
    if (type == FHIR_DIAGNOSTIC_REPORT) fhir_put_diagnostic_report(out, NULL, record, html, false);
    if (type == FHIR_PROVENANCE) fhir_put_provenance(out, NULL, record);
    return true;
}

static void put_version(const struct store_assessment *row, struct http_response *ret)
{
    const int64_t last = row->finished_ms > row->started_ms ? row->finished_ms : row->started_ms;
    const time_t seconds = (time_t)((last > row->created_ms ? last : row->created_ms) / 1000);
    struct tm parts;
    char when[40];
    (void)snprintf(ret->etag, sizeof ret->etag, "W/\"%lld\"", (long long)row->change_seq);
    (void)gmtime_r(&seconds, &parts);
    (void)strftime(when, sizeof when, "%a, %d %b %Y %H:%M:%S GMT", &parts);
    http_header(ret, "Last-Modified", "%s", when);
    http_header_static(ret, "Cache-Control", "no-cache, private");
}

static void send_resource(struct call *call, enum fhir_type type, int measure,
                          const struct store_assessment *row, struct http_response *ret)
{
    struct ischia_error err;
    struct json_out out;
    char *html = NULL;
    struct record *record = malloc(sizeof *record);
    enum ischia_code code = record == NULL ? FAIL(&err, ISCHIA_E_MEMORY, "no memory for a record")
                                           : intake_record(record, row, &err);
    if (code == ISCHIA_OK && type == FHIR_DIAGNOSTIC_REPORT) code = attach_report(&html, row, &err);
    json_out_init(&out, fhir_indent(call));
    if (code != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
    } else if (put_resource(&out, type, record, measure, html == NULL ? "" : html)) {
        put_version(row, ret);
        if (!reply_not_modified(call->request, ret)) fhir_send(call, 200, &out, ret);
    } else {
        reply_refusal_english(call->request, ret, PROBLEM_NOT_FOUND,
                              "This assessment has no such number (yet).");
    }
    json_out_finish(&out);
    free(html);
    free(record);
}

void handle_fhir_read(struct call *call, struct http_response *ret)
{
    struct store_assessment row;
    const enum fhir_type type = type_of(call->route);
    int measure = 0;
    if (type >= FHIR_DEVICE) {
        send_definition(call, type, ret);
        return;
    }
    find_id(call, type, &measure);
    if (!fhir_get_row(call, &row, ret)) return;
    send_resource(call, type, measure, &row, ret);
    store_assessment_finish(&row);
}

/* ---------------------------------------------------------------------------- search */

struct search {
    char cursor[STORE_CURSOR_BYTES];
    bool nothing; /* no row can match */
    struct store_filter filter;
    struct store_alternative alternative[STORE_ALTERNATIVES_MAX];
    char reference[STORE_ALTERNATIVES_MAX][ORIGIN_TEXT_BYTES]; /* of a person, each its own */
    int condition, count;  /* the one that is being read; alternatives so far   */
    bool full;             /* there are more than have room                     */
    struct text_out query; /* what was understood, for links; without the cursor */
    struct doc_faults faults;
};

static void add(struct search *s, struct store_alternative alternative)
{
    alternative.condition = s->condition;
    s->alternative[s->count++] = alternative;
}

/* Takers add what can hold of a row, if anything can. False: no value of this parameter. */

static bool take_person(struct search *s, const char *value)
{
    static const char prefix[] = "Patient/";
    const char *id = NULL;
    const bool whole = fhir_is_local_patient(value, &id);
    const bool bare = !whole && strchr(value, '/') == NULL && strchr(value, ':') == NULL;
    char *reference = s->reference[s->count];
    const int length = snprintf(reference, ORIGIN_TEXT_BYTES, "%s%s", bare ? prefix : "", value);
    if (length >= ORIGIN_TEXT_BYTES) return true; /* longer than any that is kept */
    add(s, (struct store_alternative){.kind = STORE_OF_PERSON,
                                      .subject =
                                          whole || bare ? reference + strlen(prefix) : reference,
                                      .reference = reference});
    return value[0] != '\0';
}

static bool take_times(struct search *s, enum store_alternative_kind kind, const char *value)
{
    struct store_alternative times = {.kind = kind};
    if (!fhir_date_range(value, &times.from_ms, &times.before_ms)) return false;
    add(s, times);
    return true;
}

static bool take_date(struct search *s, const char *value)
{
    return take_times(s, STORE_ENDED, value);
}

static bool take_last_updated(struct search *s, const char *value)
{
    return take_times(s, STORE_CHANGED, value);
}

/* Perhaps behind its system and a '|'. */
static bool take_status(struct search *s, const char *value)
{
    static const struct {
        const char *word;
        unsigned states;
    } words[] = {
        {"registered", 1U << QUEUE_QUEUED | 1U << QUEUE_RUNNING},
        {"final", 1U << QUEUE_SUCCEEDED},
        {"cancelled", 1U << QUEUE_FAILED | 1U << QUEUE_CANCELLED},
        /* of the value sets too, but nothing of ours ever is */
        {"partial", 0},
        {"preliminary", 0},
        {"amended", 0},
        {"corrected", 0},
        {"appended", 0},
        {"entered-in-error", 0},
        {"unknown", 0},
    };
    const char *bar = strchr(value, '|');
    const char *word = bar == NULL ? value : bar + 1;
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        if (strcmp(words[i].word, word) != 0) continue;
        if (words[i].states != 0)
            add(s, (struct store_alternative){.kind = STORE_IN_STATES, .states = words[i].states});
        return true;
    }
    return false;
}

static bool take_id(struct search *s, const char *value)
{
    struct store_alternative known = {.kind = STORE_HAS_ID};
    if (uuid_parse(value, &known.id)) add(s, known);
    return value[0] != '\0';
}

static bool take_count(struct search *s, const char *value)
{
    long long count;
    if (!query_whole_number(value, 1, STORE_LIST_LIMIT_MAX, &count)) return false;
    s->filter.limit = (int)count;
    return true;
}

static bool take_cursor(struct search *s, const char *value)
{
    (void)snprintf(s->cursor, sizeof s->cursor, "%.39s", value);
    s->filter.cursor = s->cursor;
    return true;
}

static bool take_nothing(struct search *s, const char *value)
{
    (void)s, (void)value;
    return true;
}

const char *const fhir_search_keys[] = {"subject",      "subject:Patient", "patient", "date",
                                        "_lastUpdated", "status",          "_id",     "_count",
                                        "_cursor",      "_format",         "_pretty", NULL};
static const struct {
    bool (*take)(struct search *s, const char *value);
    bool is_condition; /* one of the values between its commas has to hold; escapes are undone */
} takers[] = {{take_person, true},   {take_person, true},       {take_person, true},
              {take_date, true},     {take_last_updated, true}, {take_status, true},
              {take_id, true},       {take_count, false},       {take_cursor, false},
              {take_nothing, false}, {take_nothing, false}};
_Static_assert(sizeof takers / sizeof takers[0] + 1 ==
                   sizeof fhir_search_keys / sizeof fhir_search_keys[0],
               "each key has its taker");

static void put_encoded(struct text_out *out, const char *text)
{
    static const char plain[] =
        "-._~0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
    char escape[4];
    for (; *text != '\0'; text++) {
        if (strchr(plain, *text) != NULL) {
            text_put(out, text, 1);
            continue;
        }
        (void)snprintf(escape, sizeof escape, "%%%02X", (unsigned)(unsigned char)*text);
        text_put(out, escape, 3);
    }
}

/* The value up to the next comma that separates, with FHIR's escapes undone (of ',' '$' '|' and the
 * backslash itself). Returns what follows that comma, NULL: it was the last. */
static const char *next_value(const char *list, char ret[VALUE_BYTES])
{
    for (; *list != '\0' && *list != ','; list++) {
        if (list[0] == '\\' && list[1] != '\0' && strchr(",$|\\", list[1]) != NULL) list++;
        *ret++ = *list;
    }
    *ret = '\0';
    return *list == ',' ? list + 1 : NULL;
}

/* One of the values has to hold. */
static bool take_list(struct search *s, int i, const char *list)
{
    char value[VALUE_BYTES];
    const int before = s->count;
    s->condition++;
    while (list != NULL) {
        list = next_value(list, value);
        s->full = s->count == STORE_ALTERNATIVES_MAX;
        if (s->full) return true;
        if (!takers[i].take(s, value)) return false;
    }
    s->nothing = s->nothing || s->count == before;
    return true;
}

static void take_value(struct search *s, int i, const char *value)
{
    const char *key = fhir_search_keys[i];
    if (!(takers[i].is_condition ? take_list(s, i, value) : takers[i].take(s, value)))
        doc_faults_add(&s->faults, key, "malformed", "%s has a value that is not accepted", key);
}

static void take_pair(struct search *s, const char *key, const char *value)
{
    for (int i = 0; fhir_search_keys[i] != NULL; i++) {
        if (strcmp(fhir_search_keys[i], key) != 0) continue;
        take_value(s, i, value);
        if (strcmp(key, "_cursor") == 0) return;
        text_put_string(&s->query, s->query.length == 0 ? "" : "&");
        put_encoded(&s->query, key);
        text_put_string(&s->query, "=");
        put_encoded(&s->query, value);
        return;
    }
    /* Under Prefer: handling=lenient the route has let it pass; a form's body is not looked at. */
    s->faults.dropped++;
}

static void take_pairs(struct search *s, const char *pairs)
{
    char key[64], value[VALUE_BYTES];
    for (;;) {
        const enum query_answer answer = query_next(&pairs, key, sizeof key, value, sizeof value);
        if (answer == QUERY_ABSENT) return;
        if (answer == QUERY_FOUND)
            take_pair(s, key, value);
        else
            doc_faults_add(&s->faults, "query", "malformed",
                           "a parameter is too long or cannot be decoded");
    }
}

/* A body is never left out: without it the search would be a wider one. */
static enum ischia_code take_form(struct search *s, const struct http_request *request,
                                  struct ischia_error *err)
{
    char *form = strndup(request->body, request->body_size);
    CHECK(form != NULL, err, ISCHIA_E_MEMORY, "no memory for a search's form");
    if (strlen(form) == request->body_size)
        take_pairs(s, form);
    else
        doc_faults_add(&s->faults, "query", "malformed", "the form holds a NUL");
    free(form);
    return ISCHIA_OK;
}

/* False: ret is the refusal. */
static bool read_search(struct call *call, struct search *s, struct http_response *ret)
{
    struct problem problem;
    struct ischia_error err;
    const char *prefer = http_request_header(call->request, "Prefer");
    const bool lenient = prefer != NULL && strstr(prefer, "handling=lenient") != NULL;
    memset(s, 0, sizeof *s);
    text_out_init(&s->query);
    doc_faults_init(&s->faults);
    s->filter.limit = COUNT_USUAL;
    s->filter.with_results = true;
    take_pairs(s, call->request->query);
    if (take_form(s, call->request, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return false;
    }
    if (s->faults.dropped > 0 && !lenient)
        doc_faults_add(&s->faults, "query", "unsupported",
                       "a search parameter is not known here; Prefer: handling=lenient ignores it");
    if (s->full)
        doc_faults_add(&s->faults, "query", "too_many", "a search has at most %d values",
                       STORE_ALTERNATIVES_MAX);
    s->filter.alternative = s->alternative;
    s->filter.alternative_count = s->count;
    if (s->faults.count == 0) return true;
    problem_init(&problem, PROBLEM_BAD_REQUEST, "The search is not acceptable.");
    problem.faults = s->faults;
    reply_problem(call->request, &problem, ret);
    return false;
}

struct page {
    struct json_out out;
    enum fhir_type type;
    const char *base;
    struct record *record;
    int count;
    enum ischia_code code;
    struct ischia_error err;
};

static bool write_entry(void *context, const struct store_assessment *row)
{
    struct page *page = context;
    char url[FHIR_BASE_BYTES + 80], *html = NULL;
    page->code = intake_record(page->record, row, &page->err);
    if (page->code == ISCHIA_OK && page->type == FHIR_DIAGNOSTIC_REPORT)
        page->code = attach_report(&html, row, &page->err);
    if (page->code != ISCHIA_OK) return false;
    (void)snprintf(url, sizeof url, "%s/%s/%s", page->base, fhir_type_names[page->type],
                   page->record->id);
    if (page->count == 0) json_open_array(&page->out, "entry"); /* FHIR has no empty arrays */
    json_open_object(&page->out, NULL);
    json_put_string(&page->out, "fullUrl", url);
    if (page->type == FHIR_RISK_ASSESSMENT)
        fhir_put_risk_assessment(&page->out, "resource", page->record);
    else
        fhir_put_diagnostic_report(&page->out, "resource", page->record, html == NULL ? "" : html,
                                   false);
    json_open_object(&page->out, "search");
    json_put_string(&page->out, "mode", "match");
    json_close_object(&page->out);
    json_close_object(&page->out);
    free(html);
    page->count++;
    return true;
}

static void put_link(struct page *page, const char *relation, const struct search *s,
                     const char *cursor)
{
    struct text_out url;
    text_out_init(&url);
    text_put_string(&url, page->base);
    text_put_string(&url, "/");
    text_put_string(&url, fhir_type_names[page->type]);
    if (s->query.length > 0 || cursor[0] != '\0') text_put_string(&url, "?");
    if (s->query.length > 0) text_put_string(&url, s->query.text);
    if (cursor[0] != '\0') {
        text_put_string(&url, s->query.length > 0 ? "&_cursor=" : "_cursor=");
        text_put_string(&url, cursor);
    }
    json_open_object(&page->out, NULL);
    json_put_string(&page->out, "relation", relation);
    json_put_string(&page->out, "url", url.text == NULL ? page->base : url.text);
    json_close_object(&page->out);
    page->out.text.failed = page->out.text.failed || url.failed || s->query.failed;
    text_out_finish(&url);
}

static enum ischia_code write_bundle(struct call *call, const struct search *s, struct page *page)
{
    char cursor[STORE_CURSOR_BYTES] = "";
    json_open_object(&page->out, NULL);
    json_put_string(&page->out, "resourceType", "Bundle");
    json_put_string(&page->out, "type", "searchset");
    if (!s->nothing)
        TRY(store_list(call->service->store, &s->filter, write_entry, page, cursor, &page->err));
    TRY(page->code);
    if (page->count > 0) json_close_array(&page->out);
    if (cursor[0] == '\0' && s->cursor[0] == '\0')
        json_put_integer(&page->out, "total", page->count);
    json_open_array(&page->out, "link");
    put_link(page, "self", s, s->cursor);
    if (cursor[0] != '\0') put_link(page, "next", s, cursor);
    json_close_array(&page->out);
    json_close_object(&page->out);
    return ISCHIA_OK;
}

static void send_page(struct call *call, const struct search *s, struct http_response *ret)
{
    char base[FHIR_BASE_BYTES];
    struct page page = {.type = type_of(call->route), .base = base, .code = ISCHIA_OK};
    fhir_base(call, base);
    page.record = malloc(sizeof *page.record);
    json_out_init(&page.out, fhir_indent(call));
    const enum ischia_code code = page.record == NULL
                                      ? FAIL(&page.err, ISCHIA_E_MEMORY, "no memory for a record")
                                      : write_bundle(call, s, &page);
    http_header_static(ret, "Cache-Control", "no-store");
    if (code == ISCHIA_OK)
        fhir_send(call, 200, &page.out, ret);
    else if (code == ISCHIA_E_INPUT && s->cursor[0] != '\0')
        reply_refusal_english(call->request, ret, PROBLEM_BAD_REQUEST, "%s", page.err.message);
    else
        reply_failure(call->request, ret, &page.err);
    json_out_finish(&page.out);
    free(page.record);
}

void handle_fhir_search(struct call *call, struct http_response *ret)
{
    struct search s;
    const int64_t begun_us = metrics_now_us();
    if (read_search(call, &s, ret)) send_page(call, &s, ret);
    text_out_finish(&s.query);
    metrics_store(STORE_LISTS, (double)(metrics_now_us() - begun_us) / 1e6);
}
