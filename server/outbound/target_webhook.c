/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * A POST that says which assessment ended, and nothing about the person. Signed as Standard
 * Webhooks has it: HMAC-SHA256 over "id.timestamp.body", so that the receiver knows who sends and
 * that it is not an old message.
 */
#include <sodium.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "api/base64.h"
#include "server/outbound/target.h"
#include "server/outbound/web.h"
#include "server/textfile.h"

enum { SECRET_BYTES_MAX = 512, ID_BYTES = 80 };

struct webhook {
    unsigned char secret[SECRET_BYTES_MAX];
    size_t size;
};

static bool is_wanted(const struct config *config) { return config->webhook_url[0] != '\0'; }

/* "whsec_" and base64, as receivers' libraries write it; else the text itself. */
static bool read_secret(struct webhook *w, const char *text)
{
    static const char prefix[] = "whsec_";
    const size_t length = strcspn(text, "\r\n");
    if (strncmp(text, prefix, sizeof prefix - 1) == 0)
        return sodium_base642bin(w->secret, sizeof w->secret, text + sizeof prefix - 1,
                                 length - (sizeof prefix - 1), NULL, &w->size, NULL,
                                 sodium_base64_VARIANT_ORIGINAL) == 0 &&
               w->size >= 24;
    if (length < 24 || length > sizeof w->secret) return false;
    memcpy(w->secret, text, length);
    w->size = length;
    return true;
}

static enum ischia_code open_webhook(void **ret_state, const struct config *config,
                                     struct ischia_error *err)
{
    char *text = NULL;
    TRY(textfile_read(config->webhook_secret, &text, err));
    struct webhook *w = calloc(1, sizeof *w);
    const bool good = w != NULL && read_secret(w, text);
    free(text);
    if (!good) free(w);
    CHECK(good, err, ISCHIA_E_INPUT, "%.200s does not hold a secret of 24 to %d bytes",
          config->webhook_secret, SECRET_BYTES_MAX);
    *ret_state = w;
    return ISCHIA_OK;
}

static void close_webhook(void *state)
{
    sodium_memzero(state, sizeof(struct webhook));
    free(state);
}

static enum ischia_code body_text(const struct delivery *d, char **ret, size_t *ret_size,
                                  struct ischia_error *err)
{
    struct json_out out;
    char type[48], url[CONFIG_TEXT_BYTES + 80];
    const char *base = d->config->public_url;
    (void)snprintf(type, sizeof type, "assessment.%s", store_change_names[d->row->kind]);
    json_out_init(&out, 0);
    json_open_object(&out, NULL);
    json_put_string(&out, "type", type);
    json_put_string(&out, "timestamp", d->record->finished_at);
    json_open_object(&out, "data");
    json_put_string(&out, "id", d->record->id);
    json_put_string(&out, "status", assessment_status_names[d->record->status]);
    json_put_integer(&out, "seq", d->row->change_seq);
    (void)snprintf(url, sizeof url, "%s/v1/assessments/%s", base, d->record->id);
    json_put_string(&out, "self", url);
    (void)snprintf(url, sizeof url, "%s/fhir/DiagnosticReport/%s", base, d->record->id);
    json_put_string(&out, "fhir", url);
    json_close_object(&out);
    json_close_object(&out);
    return json_out_take(&out, ret, ret_size, err);
}

/* "webhook-signature: v1,…" into a text that is the caller's to free; NULL: no memory. */
static char *signature_header(const struct webhook *w, const char *id, const char *timestamp,
                              const char *body)
{
    const char *const parts[] = {id, ".", timestamp, ".", body};
    unsigned char mac[crypto_auth_hmacsha256_BYTES];
    crypto_auth_hmacsha256_state hash;
    struct text_out out;
    char *text = NULL;
    (void)crypto_auth_hmacsha256_init(&hash, w->secret, w->size);
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++)
        (void)crypto_auth_hmacsha256_update(&hash, (const unsigned char *)parts[i],
                                            strlen(parts[i]));
    (void)crypto_auth_hmacsha256_final(&hash, mac);
    text_out_init(&out);
    text_put_string(&out, "webhook-signature: v1,");
    base64_put(&out, mac, sizeof mac);
    return text_out_take(&out, &text, NULL, NULL) == ISCHIA_OK ? text : NULL;
}

static enum outcome judge(const struct web_answer *answer, char *problem)
{
    if (answer->status >= 200 && answer->status < 300) return OUTCOME_DELIVERED;
    if (answer->status == 0) {
        (void)snprintf(problem, TARGET_PROBLEM_BYTES, "%s", answer->problem);
        return OUTCOME_DOWN;
    }
    (void)snprintf(problem, TARGET_PROBLEM_BYTES, "answered %d", answer->status);
    if (answer->status == 410) return OUTCOME_NEVER; /* Gone: the receiver wants no more of it */
    return answer->status >= 500 || answer->status == 429 ? OUTCOME_DOWN : OUTCOME_REFUSED;
}

static enum outcome post(const struct webhook *w, const struct delivery *d, const char *body,
                         size_t size)
{
    char id[ID_BYTES], timestamp[24], id_header[ID_BYTES + 16], time_header[48];
    struct web_answer answer;
    (void)snprintf(id, sizeof id, "msg_%s_%lld", d->record->id, (long long)d->row->change_seq);
    (void)snprintf(timestamp, sizeof timestamp, "%lld", (long long)time(NULL));
    (void)snprintf(id_header, sizeof id_header, "webhook-id: %s", id);
    (void)snprintf(time_header, sizeof time_header, "webhook-timestamp: %s", timestamp);
    char *signature = signature_header(w, id, timestamp, body);
    if (signature == NULL) return OUTCOME_DOWN;
    const struct web_post request = {
        .url = d->config->webhook_url,
        .header = {"Content-Type: application/json", id_header, time_header, signature},
        .body = body,
        .size = size,
        .ca = d->config->outbound_ca,
        .stopping = d->stopping};
    web_post(&request, &answer);
    const enum outcome outcome = judge(&answer, d->problem);
    web_answer_finish(&answer);
    free(signature);
    return outcome;
}

static enum outcome deliver(void *state, const struct delivery *d)
{
    char *body = NULL;
    size_t size = 0;
    (void)snprintf(d->problem, TARGET_PROBLEM_BYTES, "out of memory");
    if (body_text(d, &body, &size, NULL) != ISCHIA_OK) return OUTCOME_DOWN;
    const enum outcome outcome = post(state, d, body, size);
    free(body);
    return outcome;
}

const struct target target_webhook = {"webhook", is_wanted, open_webhook, deliver, close_webhook};
