/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/auth.h"

#include <ctype.h>
#include <pthread.h>
#include <sodium.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <time.h>

#include "server/log.h"

enum {
    SECRET_BYTES = 32,
    SECRET_TEXT_BYTES = 44, /* base64url without padding, and its NUL */
    HASH_BYTES = STORE_DIGEST_BYTES
};
static const char token_prefix[] = AUTH_TOKEN_PREFIX;
static const char hash_key[] = "ischia access token v1"; /* separates this use of BLAKE2b */

struct token_list {
    struct store_token *token; /* none that is revoked */
    size_t count;
    int64_t now_ms; /* when it was read */
    bool in_use;    /* there was a token ever, revoked or not, that is not forgotten */
    bool failed;    /* no memory for one */
    size_t refused; /* of those that hold, above AUTH_TOKENS_MAX */
};

struct auth {
    struct store *store;
    pthread_rwlock_t lock; /* over list and epoch */
    struct token_list list;
    int64_t epoch;
    atomic_llong checked_s;
    bool required;
    atomic_bool failing; /* the tokens cannot be read: said once */
};

static const struct {
    const char *word;
    unsigned bits;
} scope_words[] = {{"read", AUTH_READ}, {"assess", AUTH_ASSESS}, {"admin", AUTH_ALL}};
enum { SCOPE_WORDS = sizeof scope_words / sizeof scope_words[0] };

unsigned auth_parse_scopes(const char *text)
{
    unsigned scopes = 0;
    while (*text != '\0') {
        const size_t length = strcspn(text, ",");
        unsigned bits = 0;
        for (size_t i = 0; i < SCOPE_WORDS; i++)
            if (strlen(scope_words[i].word) == length &&
                strncmp(text, scope_words[i].word, length) == 0)
                bits = scope_words[i].bits;
        if (bits == 0) return 0;
        scopes |= bits;
        text += length;
        if (*text == ',') text++;
    }
    return scopes;
}

static const char *scopes_text(unsigned scopes)
{
    if (scopes & AUTH_ADMIN) return "admin";
    if (scopes == (AUTH_READ | AUTH_ASSESS)) return "read,assess";
    return scopes & AUTH_ASSESS ? "assess" : "read";
}

static void hash_secret(unsigned char ret[HASH_BYTES], const char *secret)
{
    (void)crypto_generichash(ret, HASH_BYTES, (const unsigned char *)secret, strlen(secret),
                             (const unsigned char *)hash_key, sizeof hash_key - 1);
}

static int64_t unix_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static bool is_expired(const struct store_token *token, int64_t now_ms)
{
    return token->expires_ms != 0 && now_ms >= token->expires_ms;
}

/* Where one more goes; NULL: no memory, which list->failed says, or every place is taken. An
 * expired one, which is kept only so that its owner is told why it no longer works, makes room. */
static struct store_token *find_place(struct token_list *list)
{
    if (list->count == AUTH_TOKENS_MAX) {
        for (size_t i = 0; i < list->count; i++)
            if (is_expired(&list->token[i], list->now_ms)) return &list->token[i];
        return NULL;
    }
    struct store_token *grown = realloc(list->token, (list->count + 1) * sizeof *grown);
    list->failed = grown == NULL;
    if (list->failed) return NULL;
    list->token = grown;
    return &grown[list->count++];
}

static bool keep_token(void *context, const struct store_token *token)
{
    struct token_list *list = context;
    const bool expired = is_expired(token, list->now_ms);
    list->in_use = true;
    if (token->revoked_ms != 0 || (expired && list->count == AUTH_TOKENS_MAX)) return true;
    struct store_token *place = find_place(list);
    if (place != NULL) *place = *token;
    list->refused += place == NULL && !list->failed;
    return !list->failed;
}

static enum ischia_code read_tokens(struct store *store, struct token_list *ret,
                                    struct ischia_error *err)
{
    struct token_list list = {.now_ms = unix_ms()};
    enum ischia_code code = store_token_list(store, keep_token, &list, err);
    if (code == ISCHIA_OK && list.failed)
        code = FAIL(err, ISCHIA_E_MEMORY, "no memory for the tokens");
    if (code == ISCHIA_OK && list.refused > 0)
        LOG_WARNING("too many tokens; the newest are not known", "known=%zu unknown=%zu",
                    list.count, list.refused);
    if (code == ISCHIA_OK)
        *ret = list;
    else
        free(list.token);
    return code;
}

enum ischia_code auth_create(struct auth **ret, struct store *store, struct ischia_error *err)
{
    CHECK(sodium_init() >= 0, err, ISCHIA_E_STATE, "libsodium could not start");
    struct auth *auth = calloc(1, sizeof *auth);
    CHECK(auth != NULL, err, ISCHIA_E_MEMORY, "no memory for the tokens");
    auth->store = store;
    /* The epoch first: a token added in between is then read twice, not missed. */
    enum ischia_code code = store_token_epoch(store, &auth->epoch, err);
    if (code == ISCHIA_OK) code = read_tokens(store, &auth->list, err);
    if (code == ISCHIA_OK && pthread_rwlock_init(&auth->lock, NULL) != 0) {
        free(auth->list.token);
        code = FAIL(err, ISCHIA_E_MEMORY, "no lock for the tokens");
    }
    if (code != ISCHIA_OK) {
        free(auth);
        return code;
    }
    *ret = auth;
    return ISCHIA_OK;
}

void auth_destroy(struct auth *auth)
{
    if (auth == NULL) return;
    (void)pthread_rwlock_destroy(&auth->lock);
    free(auth->list.token);
    free(auth);
}

void auth_require(struct auth *auth) { auth->required = true; }

static void say_failing(struct auth *auth, const struct ischia_error *err)
{
    struct log_value detail;
    if (!atomic_exchange(&auth->failing, true))
        LOG_ERROR("the tokens cannot be read; those known stay", "detail=%s",
                  log_quote(&detail, err->message));
}

/* Reads the tokens again when they changed. When the store cannot be read the tokens known stay:
 * to forget them would open the door. */
static void reload(struct auth *auth)
{
    struct token_list list = {0};
    struct ischia_error err = {0};
    int64_t epoch = 0;
    enum ischia_code code = store_token_epoch(auth->store, &epoch, &err);
    if (code == ISCHIA_OK && epoch != auth->epoch) code = read_tokens(auth->store, &list, &err);
    if (code != ISCHIA_OK) {
        say_failing(auth, &err);
        return;
    }
    atomic_store(&auth->failing, false);
    if (epoch == auth->epoch) return;
    (void)pthread_rwlock_wrlock(&auth->lock);
    struct store_token *old = auth->list.token;
    auth->list = list;
    auth->epoch = epoch;
    (void)pthread_rwlock_unlock(&auth->lock);
    free(old);
}

/* Asks the store at most once a second, by whichever thread comes first. */
static void refresh(struct auth *auth)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC_COARSE, &now);
    long long checked_s = atomic_load_explicit(&auth->checked_s, memory_order_relaxed);
    if (checked_s == now.tv_sec) return;
    if (atomic_compare_exchange_strong(&auth->checked_s, &checked_s, (long long)now.tv_sec))
        reload(auth);
}

bool auth_has_tokens(struct auth *auth)
{
    refresh(auth);
    (void)pthread_rwlock_rdlock(&auth->lock);
    const bool has = auth->list.count > 0;
    (void)pthread_rwlock_unlock(&auth->lock);
    return has;
}

bool auth_asks(struct auth *auth)
{
    refresh(auth);
    (void)pthread_rwlock_rdlock(&auth->lock);
    const bool asks = auth->required || auth->list.in_use;
    (void)pthread_rwlock_unlock(&auth->lock);
    return asks;
}

/* The token inside "Bearer x" or "Basic base64(user:x)". False when there is none. */
static bool header_token(const char *header, char ret[AUTH_TOKEN_BYTES])
{
    unsigned char decoded[192];
    size_t size = 0;
    if (strncasecmp(header, "Bearer ", 7) == 0) {
        const int n = snprintf(ret, AUTH_TOKEN_BYTES, "%s", header + 7);
        return n > 0 && n < AUTH_TOKEN_BYTES;
    }
    if (strncasecmp(header, "Basic ", 6) != 0) return false;
    if (sodium_base642bin(decoded, sizeof decoded - 1, header + 6, strlen(header + 6), NULL, &size,
                          NULL, sodium_base64_VARIANT_ORIGINAL) != 0)
        return false;
    decoded[size] = '\0';
    const char *colon = strchr((const char *)decoded, ':');
    const int n = snprintf(ret, AUTH_TOKEN_BYTES, "%s", colon == NULL ? "" : colon + 1);
    sodium_memzero(decoded, sizeof decoded);
    return n > 0 && n < AUTH_TOKEN_BYTES;
}

/* "ischia_<id>_<secret>" -> id and where the secret starts. */
static bool split_token(const char *token, char ret_id[AUTH_ID_BYTES], const char **ret_secret)
{
    const size_t prefix = sizeof token_prefix - 1, id = AUTH_ID_BYTES - 1;
    if (strncmp(token, token_prefix, prefix) != 0 || strlen(token) < prefix + id + 2) return false;
    memcpy(ret_id, token + prefix, id);
    ret_id[id] = '\0';
    *ret_secret = token + prefix + id + 1;
    return token[prefix + id] == '_';
}

/* Compares the hash with every token's, so that the time does not tell which ids exist. */
static const struct store_token *match_token(const struct auth *auth, const char *id,
                                             const unsigned char hash[HASH_BYTES])
{
    const struct store_token *found = NULL;
    for (size_t i = 0; i < auth->list.count; i++) {
        const struct store_token *token = &auth->list.token[i];
        const int id_differs = sodium_memcmp(token->id, id, AUTH_ID_BYTES);
        const int hash_differs = sodium_memcmp(token->digest, hash, HASH_BYTES);
        if ((id_differs | hash_differs) == 0) found = token;
    }
    return found;
}

static enum auth_verdict judge(const struct auth *auth, const char *header, int64_t now_ms,
                               struct auth_identity *ret_identity)
{
    char text[AUTH_TOKEN_BYTES], id[AUTH_ID_BYTES];
    unsigned char hash[HASH_BYTES];
    const char *secret = "";
    if (header == NULL) return AUTH_NO_TOKEN;
    if (!header_token(header, text) || !split_token(text, id, &secret)) return AUTH_BAD_TOKEN;
    hash_secret(hash, secret);
    sodium_memzero(text, sizeof text);
    const struct store_token *token = match_token(auth, id, hash);
    if (token == NULL) return AUTH_BAD_TOKEN;
    if (is_expired(token, now_ms)) return AUTH_EXPIRED;
    (void)snprintf(ret_identity->id, sizeof ret_identity->id, "%s", id);
    ret_identity->scopes = token->scopes;
    return AUTH_GRANTED;
}

enum auth_verdict auth_check(struct auth *auth, const char *header, int64_t now_ms,
                             struct auth_identity *ret_identity)
{
    enum auth_verdict verdict = AUTH_GRANTED;
    *ret_identity = (struct auth_identity){.id = "-", .scopes = 0};
    refresh(auth);
    (void)pthread_rwlock_rdlock(&auth->lock);
    if (auth->required || auth->list.in_use)
        verdict = judge(auth, header, now_ms, ret_identity);
    else
        ret_identity->scopes = AUTH_ALL;
    (void)pthread_rwlock_unlock(&auth->lock);
    return verdict;
}

bool auth_user(const char *name, unsigned scopes, struct auth_identity *ret_identity)
{
    const size_t length = strlen(name);
    if (length == 0 || length > AUTH_USER_MAX) return false;
    for (const char *c = name; *c != '\0'; c++)
        if (!isalnum((unsigned char)*c) && strchr("._@+-\\", *c) == NULL) return false;
    (void)snprintf(ret_identity->id, sizeof ret_identity->id, "user:%s", name);
    ret_identity->scopes = scopes;
    return true;
}

static bool count_holding(void *context, const struct store_token *token)
{
    struct token_list *list = context;
    list->count += token->revoked_ms == 0 && !is_expired(token, list->now_ms);
    return true;
}

static enum ischia_code check_room(struct store *store, struct ischia_error *err)
{
    struct token_list holding = {.now_ms = unix_ms()};
    TRY(store_token_list(store, count_holding, &holding, err));
    CHECK(holding.count < AUTH_TOKENS_MAX, err, ISCHIA_E_LIMIT,
          "there are %zu tokens that hold, and a service knows at most %d: revoke some first",
          holding.count, AUTH_TOKENS_MAX);
    return ISCHIA_OK;
}

enum ischia_code auth_token_create(struct store *store, unsigned scopes, int64_t expires_ms,
                                   const char *name, char ret_token[AUTH_TOKEN_BYTES],
                                   struct ischia_error *err)
{
    struct store_token token = {.scopes = scopes, .expires_ms = expires_ms};
    enum store_answer answer = STORE_DONE;
    unsigned char id[(AUTH_ID_BYTES - 1) / 2], secret[SECRET_BYTES];
    char secret_text[SECRET_TEXT_BYTES];
    CHECK(sodium_init() >= 0, err, ISCHIA_E_STATE, "libsodium could not start");
    CHECK(strlen(name) < sizeof token.name, err, ISCHIA_E_INPUT,
          "the name is longer than %zu bytes", sizeof token.name - 1);
    for (const char *c = name; *c != '\0'; c++)
        CHECK(!iscntrl((unsigned char)*c), err, ISCHIA_E_INPUT,
              "the name holds a control character");
    TRY(check_room(store, err));
    randombytes_buf(id, sizeof id);
    randombytes_buf(secret, sizeof secret);
    (void)sodium_bin2hex(token.id, AUTH_ID_BYTES, id, sizeof id);
    (void)sodium_bin2base64(secret_text, sizeof secret_text, secret, sizeof secret,
                            sodium_base64_VARIANT_URLSAFE_NO_PADDING);
    hash_secret(token.digest, secret_text);
    (void)snprintf(token.name, sizeof token.name, "%s", name);
    TRY(store_token_add(store, &token, &answer, err));
    CHECK(answer == STORE_DONE, err, ISCHIA_E_STATE, "the random id exists already; try again");
    (void)snprintf(ret_token, AUTH_TOKEN_BYTES, "%s%.16s_%s", token_prefix, token.id, secret_text);
    sodium_memzero(secret, sizeof secret);
    sodium_memzero(secret_text, sizeof secret_text);
    return ISCHIA_OK;
}

enum ischia_code auth_token_revoke(struct store *store, const char *id, struct ischia_error *err)
{
    enum store_answer answer = STORE_DONE;
    TRY(store_token_revoke(store, id, &answer, err));
    CHECK(answer != STORE_NOT_FOUND, err, ISCHIA_E_STATE,
          "no token has the id '%.32s'; see `ischiad token list`", id);
    CHECK(answer != STORE_CONFLICT, err, ISCHIA_E_STATE, "the token %.32s was revoked before", id);
    return ISCHIA_OK;
}

enum ischia_code auth_token_forget(struct store *store, int64_t *ret_count,
                                   struct ischia_error *err)
{
    return store_token_forget(store, ret_count, err);
}

static void print_date(FILE *out, int64_t when_ms)
{
    char text[32];
    const time_t when = (time_t)(when_ms / 1000);
    struct tm parts;
    (void)gmtime_r(&when, &parts);
    (void)strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
    (void)fprintf(out, "%-21s", when_ms == 0 ? "-" : text);
}

static bool print_token(void *context, const struct store_token *token)
{
    FILE *out = context;
    (void)fprintf(out, "%-17s%-12s", token->id, scopes_text(token->scopes));
    print_date(out, token->created_ms);
    print_date(out, token->expires_ms);
    print_date(out, token->revoked_ms);
    return fprintf(out, "%s\n", token->name) >= 0;
}

enum ischia_code auth_token_list(struct store *store, FILE *out, struct ischia_error *err)
{
    (void)fprintf(out, "%-17s%-12s%-21s%-21s%-21s%s\n", "id", "scopes", "created", "expires",
                  "revoked", "name");
    return store_token_list(store, print_token, out, err);
}
