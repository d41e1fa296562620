/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A DiagnosticReport, with its Observations inside and the report attached, created at a FHIR
 * server. If-None-Exist with the assessment's identifier makes a second try find the first. Access
 * by SMART Backend Services: a JWT signed with our key is changed for a token, which is kept until
 * it expires.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/fhir.h"
#include "server/http/report.h"
#include "server/jose.h"
#include "server/outbound/target.h"
#include "server/outbound/web.h"
#include "server/textfile.h"

enum { ASSERTION_LIFE_S = 240, TOKEN_BYTES_MAX = 8192, TOKEN_MARGIN_S = 30, TOKEN_USUAL_S = 300 };

struct pusher {
    struct jose_key *key;              /* NULL: no authorization */
    char header[TOKEN_BYTES_MAX + 32]; /* "Authorization: Bearer …"; "": none yet */
    int64_t token_until_s;
};

static bool is_wanted(const struct config *config) { return config->push_url[0] != '\0'; }

static enum ischia_code open_pusher(void **ret_state, const struct config *config,
                                    struct ischia_error *err)
{
    char *pem = NULL;
    struct pusher *p = calloc(1, sizeof *p);
    enum ischia_code code = ISCHIA_OK;
    CHECK(p != NULL, err, ISCHIA_E_MEMORY, "no memory for a target");
    if (config->push_token_url[0] != '\0') {
        code = textfile_read(config->push_key, &pem, err);
        if (code == ISCHIA_OK) code = jose_private_key(&p->key, pem, config->push_key_id, err);
        free(pem);
    }
    if (code == ISCHIA_OK)
        *ret_state = p;
    else
        free(p);
    return code;
}

static void close_pusher(void *state)
{
    struct pusher *p = state;
    jose_key_destroy(p->key);
    free(p);
}

/* ------------------------------------------------------------------------------ a token */

static enum ischia_code claims_text(const struct config *config, char **ret,
                                    struct ischia_error *err)
{
    struct uuid id;
    char jti[UUID_TEXT_BYTES];
    struct json_out out;
    const time_t now = time(NULL);
    TRY(uuid_make((int64_t)now * 1000, &id, err));
    uuid_format(&id, jti);
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    json_put_string(&out, "iss", config->push_client);
    json_put_string(&out, "sub", config->push_client);
    json_put_string(&out, "aud", config->push_token_url);
    json_put_integer(&out, "iat", (long long)now);
    json_put_integer(&out, "exp", (long long)now + ASSERTION_LIFE_S);
    json_put_string(&out, "jti", jti);
    json_close_object(&out);
    return json_out_take(&out, ret, NULL, err);
}

/* The scope is the operator's: percent-encoded, as forms want it. */
static void put_encoded(struct text_out *out, const char *text)
{
    static const char plain[] =
        "-._~0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
    char escape[4];
    for (; *text != '\0'; text++) {
        (void)snprintf(escape, sizeof escape, "%%%02X", (unsigned)(unsigned char)*text);
        if (strchr(plain, *text) != NULL)
            text_put(out, text, 1);
        else
            text_put(out, escape, 3);
    }
}

static enum ischia_code form_text(const struct pusher *p, const struct config *config, char **ret,
                                  size_t *ret_size, struct ischia_error *err)
{
    char *claims = NULL, *assertion = NULL;
    struct text_out out;
    TRY(claims_text(config, &claims, err));
    const enum ischia_code code = jose_sign(p->key, claims, &assertion, err);
    free(claims);
    TRY(code);
    text_out_init(&out);
    text_put_string(&out, "grant_type=client_credentials&client_assertion_type=urn%3Aietf%3Aparams"
                          "%3Aoauth%3Aclient-assertion-type%3Ajwt-bearer&scope=");
    put_encoded(&out, config->push_scope);
    text_put_string(&out, "&client_assertion=");
    text_put_string(&out, assertion);
    free(assertion);
    return text_out_take(&out, ret, ret_size, err);
}

/* Visible characters only: it goes into a header. */
static bool is_plain(const char *token)
{
    const size_t length = strlen(token);
    for (size_t i = 0; i < length; i++)
        if ((unsigned char)token[i] <= 0x20 || (unsigned char)token[i] >= 0x7f) return false;
    return length > 0 && length < TOKEN_BYTES_MAX;
}

static bool read_token(struct pusher *p, const char *body)
{
    struct doc_faults faults;
    struct json *root = NULL;
    doc_faults_init(&faults);
    if (json_parse(&root, body, strlen(body), &json_limits_request, &faults, NULL) != ISCHIA_OK)
        return false;
    const struct json *token = json_member(root, "access_token");
    const struct json *life = json_member(root, "expires_in");
    const bool good =
        token != NULL && json_type_of(token) == JSON_STRING && is_plain(json_string(token));
    double life_s = TOKEN_USUAL_S;
    if (life != NULL && json_type_of(life) == JSON_NUMBER) life_s = json_number(life);
    if (!(life_s >= 0 && life_s <= 86400)) life_s = TOKEN_USUAL_S;
    if (good) {
        (void)snprintf(p->header, sizeof p->header, "Authorization: Bearer %s", json_string(token));
        p->token_until_s = (int64_t)time(NULL) + (int64_t)life_s - TOKEN_MARGIN_S;
    }
    json_destroy(root);
    return good;
}

/* False: d->problem says why. */
static bool get_token(struct pusher *p, const struct delivery *d)
{
    struct web_answer answer;
    char *form = NULL;
    size_t size = 0;
    if (p->key == NULL || (p->header[0] != '\0' && (int64_t)time(NULL) < p->token_until_s))
        return true;
    p->header[0] = '\0';
    (void)snprintf(d->problem, TARGET_PROBLEM_BYTES, "the token request cannot be made");
    if (form_text(p, d->config, &form, &size, NULL) != ISCHIA_OK) return false;
    const struct web_post request = {
        .url = d->config->push_token_url,
        .header = {"Content-Type: application/x-www-form-urlencoded", "Accept: application/json"},
        .body = form,
        .size = size,
        .ca = d->config->outbound_ca,
        .stopping = d->stopping};
    web_post(&request, &answer);
    const bool good = answer.status == 200 && read_token(p, answer.body);
    if (answer.status == 0)
        (void)snprintf(d->problem, TARGET_PROBLEM_BYTES, "token: %s", answer.problem);
    else
        (void)snprintf(d->problem, TARGET_PROBLEM_BYTES, "token: answered %d", answer.status);
    web_answer_finish(&answer);
    free(form);
    return good;
}

/* --------------------------------------------------------------------------- the report */

static enum ischia_code report_text(const struct delivery *d, char **ret, size_t *ret_size,
                                    struct ischia_error *err)
{
    struct json_out out;
    char *html = NULL;
    TRY(report_attachment(&html, d->assessment, err));
    json_out_init(&out, 0);
    fhir_put_diagnostic_report(&out, NULL, d->record, html, true);
    free(html);
    return json_out_take(&out, ret, ret_size, err);
}

static enum outcome judge(struct pusher *p, const struct web_answer *answer, char *problem)
{
    if (answer->status >= 200 && answer->status < 300) return OUTCOME_DELIVERED;
    if (answer->status == 0) {
        (void)snprintf(problem, TARGET_PROBLEM_BYTES, "%s", answer->problem);
        return OUTCOME_DOWN;
    }
    (void)snprintf(problem, TARGET_PROBLEM_BYTES, "answered %d", answer->status);
    if (answer->status == 401) p->header[0] = '\0'; /* the token was revoked: get another */
    if (answer->status >= 500 || answer->status == 429 || answer->status == 401)
        return OUTCOME_DOWN;
    return OUTCOME_REFUSED;
}

static enum outcome post(struct pusher *p, const struct delivery *d, const char *body, size_t size)
{
    char url[CONFIG_TEXT_BYTES + 24], condition[160];
    struct web_answer answer;
    (void)snprintf(url, sizeof url, "%s/DiagnosticReport", d->config->push_url);
    (void)snprintf(condition, sizeof condition,
                   "If-None-Exist: identifier=urn:ietf:rfc:3986%%7Curn:uuid:%s", d->record->id);
    const struct web_post request = {
        .url = url,
        .header = {"Content-Type: " FHIR_MEDIA_TYPE, "Accept: " FHIR_MEDIA_TYPE,
                   "Prefer: return=minimal", condition, p->header[0] == '\0' ? NULL : p->header},
        .body = body,
        .size = size,
        .ca = d->config->outbound_ca,
        .stopping = d->stopping};
    web_post(&request, &answer);
    const enum outcome outcome = judge(p, &answer, d->problem);
    web_answer_finish(&answer);
    return outcome;
}

static enum outcome deliver(void *state, const struct delivery *d)
{
    char *body = NULL;
    size_t size = 0;
    if (!get_token(state, d)) return OUTCOME_DOWN;
    (void)snprintf(d->problem, TARGET_PROBLEM_BYTES, "the report cannot be written");
    if (report_text(d, &body, &size, NULL) != ISCHIA_OK) return OUTCOME_REFUSED;
    const enum outcome outcome = post(state, d, body, size);
    free(body);
    return outcome;
}

const struct target target_fhir = {"fhir", is_wanted, open_pusher, deliver, close_pusher};
