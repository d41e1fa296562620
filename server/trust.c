/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/trust.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "api/base64.h"
#include "api/json.h"
#include "server/digest.h"
#include "server/jose.h"
#include "server/textfile.h"

enum { KEYS_MAX = 64, SEEN_MAX = 4096, TOKEN_BYTES_MAX = 8192, PART_BYTES_MAX = 6144 };
enum { LIFE_MAX_S = 3600, CLOCK_SKEW_S = 60, SIGNATURE_BYTES_MAX = 1024 };

struct trust {
    struct trusted {
        char issuer[TRUST_ISSUER_BYTES];
        struct jose_key *key;
    } key[KEYS_MAX];
    int key_count;
    pthread_mutex_t lock; /* guards what follows */
    struct {
        unsigned char digest[DIGEST_BYTES]; /* of issuer and jti */
        int64_t until_s;
    } seen[SEEN_MAX];
};

/* ------------------------------------------------------------------------------ the file */

static const char *text_of(const struct json *object, const char *key)
{
    const struct json *value = json_member(object, key);
    return value != NULL && json_type_of(value) == JSON_STRING ? json_string(value) : "";
}

static enum ischia_code read_issuer(struct trust *trust, const struct json *issuer,
                                    struct ischia_error *err)
{
    const char *name = text_of(issuer, "iss");
    const struct json *keys = json_member(json_member(issuer, "jwks"), "keys");
    CHECK(name[0] != '\0' && strlen(name) < TRUST_ISSUER_BYTES && keys != NULL &&
              json_type_of(keys) == JSON_ARRAY && json_count(keys) > 0,
          err, ISCHIA_E_INPUT, "an issuer has no iss or no jwks with keys");
    for (const struct json *k = json_first(keys); k != NULL; k = json_next(k)) {
        CHECK(trust->key_count < KEYS_MAX, err, ISCHIA_E_LIMIT, "there are more than %d keys",
              KEYS_MAX);
        struct trusted *slot = &trust->key[trust->key_count];
        TRY(jose_public_key(&slot->key, k, err));
        (void)snprintf(slot->issuer, sizeof slot->issuer, "%s", name);
        trust->key_count++;
    }
    return ISCHIA_OK;
}

static enum ischia_code read_issuers(struct trust *trust, const char *text,
                                     struct ischia_error *err)
{
    struct doc_faults faults;
    struct json *root = NULL;
    enum ischia_code code = ISCHIA_OK;
    doc_faults_init(&faults);
    TRY(json_parse(&root, text, strlen(text), &json_limits_record, &faults, err));
    const struct json *list = json_member(root, "issuers");
    if (faults.count > 0 || list == NULL || json_type_of(list) != JSON_ARRAY ||
        json_count(list) == 0)
        code = FAIL(err, ISCHIA_E_INPUT, "there is no list of issuers");
    for (const struct json *i = json_first(list); code == ISCHIA_OK && i != NULL; i = json_next(i))
        code = read_issuer(trust, i, err);
    json_destroy(root);
    return code;
}

enum ischia_code trust_create(struct trust **ret, const char *path, struct ischia_error *err)
{
    struct ischia_error cause;
    char *text = NULL;
    TRY(textfile_read(path, &text, err));
    struct trust *trust = calloc(1, sizeof *trust);
    enum ischia_code code = ISCHIA_E_MEMORY;
    if (trust == NULL) {
        (void)FAIL(&cause, code, "no memory for the keys");
    } else {
        (void)pthread_mutex_init(&trust->lock, NULL);
        code = read_issuers(trust, text, &cause);
    }
    free(text);
    if (code != ISCHIA_OK) {
        trust_destroy(trust);
        return FAIL(err, code, "%.200s: %.280s", path, cause.message);
    }
    *ret = trust;
    return ISCHIA_OK;
}

void trust_destroy(struct trust *trust)
{
    if (trust == NULL) return;
    for (int i = 0; i < trust->key_count; i++) jose_key_destroy(trust->key[i].key);
    (void)pthread_mutex_destroy(&trust->lock);
    free(trust);
}

/* ----------------------------------------------------------------------------- a token */

struct token {
    const char *text; /* the signed part */
    size_t length;
    struct json *head, *claims;
    unsigned char signature[SIGNATURE_BYTES_MAX];
    size_t signature_size;
};

/* One base64url part as JSON; NULL when it is none. */
static struct json *part_json(const char *text, size_t length)
{
    struct doc_faults faults;
    struct json *root = NULL;
    unsigned char *bytes = malloc(PART_BYTES_MAX);
    size_t size = 0;
    doc_faults_init(&faults);
    if (bytes == NULL) return NULL;
    if (!base64url_decode(text, length, bytes, PART_BYTES_MAX, &size) ||
        json_parse(&root, (const char *)bytes, size, &json_limits_request, &faults, NULL) !=
            ISCHIA_OK)
        root = NULL;
    free(bytes);
    if (faults.count == 0) return root;
    json_destroy(root);
    return NULL;
}

static bool split(struct token *ret, const char *text)
{
    const char *first = strchr(text, '.'), *second = first == NULL ? NULL : strchr(first + 1, '.');
    if (strlen(text) > TOKEN_BYTES_MAX || second == NULL) return false;
    ret->text = text;
    ret->length = (size_t)(second - text);
    ret->head = part_json(text, (size_t)(first - text));
    ret->claims = part_json(first + 1, (size_t)(second - first - 1));
    return ret->head != NULL && ret->claims != NULL &&
           base64url_decode(second + 1, strlen(second + 1), ret->signature, sizeof ret->signature,
                            &ret->signature_size);
}

static bool is_signed(const struct trust *trust, const struct token *token)
{
    const char *issuer = text_of(token->claims, "iss"), *algorithm = text_of(token->head, "alg");
    const char *id = text_of(token->head, "kid");
    for (int i = 0; i < trust->key_count; i++) {
        const struct trusted *t = &trust->key[i];
        if (strcmp(t->issuer, issuer) != 0 || strcmp(jose_key_algorithm(t->key), algorithm) != 0 ||
            (id[0] != '\0' && strcmp(jose_key_id(t->key), id) != 0))
            continue;
        if (jose_verify(t->key, token->text, token->length, token->signature,
                        token->signature_size))
            return true;
    }
    return false;
}

/* "aud" is a text or a list of them. */
static bool is_for(const struct json *claims, const char *audience)
{
    const struct json *aud = json_member(claims, "aud");
    if (aud == NULL) return false;
    if (json_type_of(aud) == JSON_STRING) return strcmp(json_string(aud), audience) == 0;
    for (const struct json *a = json_first(aud); a != NULL; a = json_next(a))
        if (json_type_of(a) == JSON_STRING && strcmp(json_string(a), audience) == 0) return true;
    return false;
}

static bool time_of(const struct json *claims, const char *name, double *ret)
{
    const struct json *value = json_member(claims, name);
    if (value == NULL || json_type_of(value) != JSON_NUMBER) return false;
    *ret = json_number(value);
    return *ret >= 0 && *ret < 1e11;
}

static bool is_in_time(const struct json *claims, int64_t now_s)
{
    double expires, issued, not_before = 0;
    const double now = (double)now_s;
    if (!time_of(claims, "exp", &expires) || !time_of(claims, "iat", &issued)) return false;
    if (json_member(claims, "nbf") != NULL && !time_of(claims, "nbf", &not_before)) return false;
    return expires > now - CLOCK_SKEW_S && issued < now + CLOCK_SKEW_S &&
           not_before < now + CLOCK_SKEW_S && expires - issued <= LIFE_MAX_S;
}

/* Notes the jti; false when it was used before. Rows of tokens that have expired are used again; a
 * full table refuses rather than forgets. */
static bool is_first_use(struct trust *trust, const struct json *claims, int64_t now_s)
{
    const struct digest_part parts[] = {digest_text(text_of(claims, "iss")),
                                        digest_text(text_of(claims, "jti"))};
    unsigned char digest[DIGEST_BYTES];
    double expires = 0;
    int free_row = -1;
    bool known = false;
    if (text_of(claims, "jti")[0] == '\0' || !time_of(claims, "exp", &expires)) return false;
    digest_parts(parts, 2, digest);
    (void)pthread_mutex_lock(&trust->lock);
    for (int i = 0; i < SEEN_MAX; i++) {
        const bool old = trust->seen[i].until_s < now_s - CLOCK_SKEW_S;
        if (old) free_row = i;
        known = known || (!old && memcmp(trust->seen[i].digest, digest, sizeof digest) == 0);
    }
    if (!known && free_row >= 0) {
        memcpy(trust->seen[free_row].digest, digest, sizeof digest);
        trust->seen[free_row].until_s = (int64_t)expires;
    }
    (void)pthread_mutex_unlock(&trust->lock);
    return !known && free_row >= 0;
}

static const char *judge(struct trust *trust, struct token *token, const char *header,
                         const char *audience, int64_t now_s)
{
    if (header == NULL || strncasecmp(header, "Bearer ", 7) != 0)
        return "Send a signed token: `Authorization: Bearer JWT`.";
    if (!split(token, header + 7)) return "The token is not a JSON Web Token.";
    if (!is_signed(trust, token))
        return "The token is not signed with ES384 or RS384 by a key of an issuer that is trusted.";
    if (!is_for(token->claims, audience)) return "The token is for another audience.";
    if (!is_in_time(token->claims, now_s))
        return "The token has expired, is not valid yet, or is good for more than an hour.";
    if (!is_first_use(trust, token->claims, now_s))
        return "The token has no jti, or one that was used before.";
    return NULL;
}

const char *trust_check(struct trust *trust, const char *header, const char *audience,
                        int64_t now_s, char ret_issuer[TRUST_ISSUER_BYTES])
{
    struct token token = {.text = NULL};
    const char *why = judge(trust, &token, header, audience, now_s);
    if (why == NULL)
        (void)snprintf(ret_issuer, TRUST_ISSUER_BYTES, "%s", text_of(token.claims, "iss"));
    json_destroy(token.head);
    json_destroy(token.claims);
    return why;
}
