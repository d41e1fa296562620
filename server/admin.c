/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/admin.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "server/audit.h"
#include "server/auth.h"
#include "server/standard_streams.h"
#include "server/store/store.h"

const char admin_help[] =
    "  token create [scope=read,assess] [expires=30d] [name=TEXT]\n"
    "      Makes an access token and shows it once. Scopes: read, assess, admin. From the first\n"
    "      token on every request needs one.\n"
    "  token list            Shows the tokens, without their secrets.\n"
    "  token revoke ID       Makes a token invalid within a second.\n"
    "  token forget          Erases the tokens that are revoked or expired. When none is left, a\n"
    "      service on the loopback address asks for none any more.\n"
    "  audit verify          Checks the chain of the audit log and prints its head.\n"
    "  audit list            Prints the audit log.\n"
    "  feedback list         Prints what clinicians answered to CDS cards, a JSON object a line.\n"
    "  outbox list           Prints what waits to be told to record systems, and why.\n"
    "  outbox retry          Makes all of it due now, also what was given up.\n"
    "  backup FILE           Copies the whole store into a new file, while the daemon runs or "
    "not.\n"
    "  restore FILE          Replaces the content of the store by that of a backup.\n"
    "  store migrate --from STORE --to STORE\n"
    "      Copies everything into an empty store, while no daemon uses either. A STORE is\n"
    "      sqlite:DIRECTORY or postgresql://USER@HOST/DATABASE.\n";

static int complain(const struct ischia_error *err)
{
    (void)fprintf(stderr, "ischiad: %s\n", err->message);
    return err->code == ISCHIA_E_INPUT ? ADMIN_USAGE : ADMIN_FAILED;
}

static const char *location(const struct config *config)
{
    return config->store[0] == '\0' ? config->state_dir : config->store;
}

/* -------------------------------------------------------------------------- tokens */

/* "30d", "12h", "45m" from now -> Unix ms; false when it is none of these. */
static bool parse_expiry(const char *text, int64_t *ret_ms)
{
    static const struct {
        char unit;
        int64_t seconds;
    } units[] = {{'d', 86400}, {'h', 3600}, {'m', 60}, {'s', 1}};
    char *end = NULL;
    errno = 0;
    const long number = strtol(text, &end, 10);
    if (errno != 0 || end == text || number < 1 || number > 100000) return false;
    for (size_t i = 0; i < sizeof units / sizeof units[0]; i++) {
        if (end[0] != units[i].unit || end[1] != '\0') continue;
        *ret_ms = ((int64_t)time(NULL) + number * units[i].seconds) * 1000;
        return true;
    }
    return false;
}

struct token_wish {
    unsigned scopes;
    int64_t expires_ms;
    const char *name;
};

/* Behind "NAME="; NULL: the word is another. */
static const char *value_of(const char *word, const char *name)
{
    const size_t length = strlen(name);
    return strncmp(word, name, length) == 0 && word[length] == '=' ? word + length + 1 : NULL;
}

static enum ischia_code parse_wish(struct token_wish *wish, const char *word,
                                   struct ischia_error *err)
{
    const char *scope = value_of(word, "scope"), *expires = value_of(word, "expires");
    const char *name = value_of(word, "name");
    if (scope != NULL) wish->scopes = auth_parse_scopes(scope);
    if (name != NULL) wish->name = name;
    CHECK(scope != NULL || expires != NULL || name != NULL, err, ISCHIA_E_INPUT,
          "token create takes scope=, expires= and name=, not '%.40s'", word);
    CHECK(wish->scopes != 0, err, ISCHIA_E_INPUT,
          "token create: scope is '%.40s'; accepted read, assess, admin, with commas between",
          scope);
    CHECK(expires == NULL || parse_expiry(expires, &wish->expires_ms), err, ISCHIA_E_INPUT,
          "token create: expires is '%.40s'; write 30d, 12h or 45m", expires);
    return ISCHIA_OK;
}

/* A secret that nobody got to see is of no use to its owner, only to others. */
static enum ischia_code show_token(struct store *store, const char *token, struct ischia_error *err)
{
    char id[AUTH_ID_BYTES];
    struct ischia_error unseen, second;
    (void)printf("%s\n", token);
    if (standard_output_flush(&unseen) == ISCHIA_OK) return ISCHIA_OK;
    (void)snprintf(id, sizeof id, "%s", token + strlen(AUTH_TOKEN_PREFIX));
    const bool revoked = auth_token_revoke(store, id, &second) == ISCHIA_OK;
    return FAIL(err, unseen.code, "%.200s; the token %s %s", unseen.message, id,
                revoked ? "has been revoked (token forget erases it)"
                        : "could not be revoked: do it yourself");
}

static enum ischia_code token_create(struct store *store, char *const *words, int count,
                                     struct ischia_error *err)
{
    struct token_wish wish = {AUTH_READ | AUTH_ASSESS, 0, ""};
    char token[AUTH_TOKEN_BYTES];
    for (int i = 0; i < count; i++) TRY(parse_wish(&wish, words[i], err));
    TRY(auth_token_create(store, wish.scopes, wish.expires_ms, wish.name, token, err));
    TRY(show_token(store, token, err));
    (void)fprintf(stderr,
                  "This is shown once: keep it now. Send it as `Authorization: Bearer …`.\n");
    return ISCHIA_OK;
}

static enum ischia_code token_list(struct store *store, char *const *words, int count,
                                   struct ischia_error *err)
{
    (void)words;
    (void)count;
    return auth_token_list(store, stdout, err);
}

static enum ischia_code token_revoke(struct store *store, char *const *words, int count,
                                     struct ischia_error *err)
{
    (void)count;
    return auth_token_revoke(store, words[0], err);
}

static enum ischia_code token_forget(struct store *store, char *const *words, int count,
                                     struct ischia_error *err)
{
    int64_t forgotten = 0;
    (void)words;
    (void)count;
    TRY(auth_token_forget(store, &forgotten, err));
    (void)printf("%lld\n", (long long)forgotten);
    return ISCHIA_OK;
}

/* --------------------------------------------------------------------------- audit */

static enum ischia_code verify(struct store *store, char *const *words, int count,
                               struct ischia_error *err)
{
    (void)words;
    (void)count;
    return audit_verify(store, stdout, err);
}

static enum ischia_code list(struct store *store, char *const *words, int count,
                             struct ischia_error *err)
{
    (void)words;
    (void)count;
    return audit_list(store, stdout, err);
}

/* ------------------------------------------------------------------------ exchange */

static bool print_feedback(void *context, const struct store_feedback *row)
{
    char card[UUID_TEXT_BYTES];
    (void)context;
    uuid_format(&row->card, card);
    (void)printf("{\"at_ms\":%lld,\"service\":\"%s\",\"card\":\"%s\",\"feedback\":%s}\n",
                 (long long)row->at_ms, row->service, card, row->document);
    return true;
}

static enum ischia_code feedback_list(struct store *store, char *const *words, int count,
                                      struct ischia_error *err)
{
    (void)words;
    (void)count;
    return store_feedback_list(store, print_feedback, NULL, err);
}

static bool print_outbox(void *context, const struct store_outbox_row *row)
{
    char id[UUID_TEXT_BYTES];
    (void)context;
    uuid_format(&row->delivery.id, id);
    (void)printf("%s %s %s attempts=%d due_ms=%lld%s %s\n", row->target, id,
                 store_change_names[row->delivery.kind], row->delivery.attempts,
                 (long long)row->due_ms, row->given_up ? " given-up" : "", row->problem);
    return true;
}

static enum ischia_code outbox_list(struct store *store, char *const *words, int count,
                                    struct ischia_error *err)
{
    (void)words;
    (void)count;
    return store_outbox_list(store, print_outbox, NULL, err);
}

static enum ischia_code outbox_retry(struct store *store, char *const *words, int count,
                                     struct ischia_error *err)
{
    int due = 0;
    (void)words;
    (void)count;
    TRY(store_outbox_revive(store, &due, err));
    (void)printf("%d\n", due);
    return ISCHIA_OK;
}

static enum ischia_code backup(struct store *store, char *const *words, int count,
                               struct ischia_error *err)
{
    (void)count;
    return store_backup(store, words[0], err);
}

/* ------------------------------------------------------------------------ dispatch */

struct command {
    const char *noun, *verb; /* verb NULL: none */
    int words_min, words_max;
    enum ischia_code (*run)(struct store *store, char *const *words, int count,
                            struct ischia_error *err);
    const char *audit; /* what the audit log calls it; NULL: nothing was changed */
};

static const struct command commands[] = {
    {"token", "create", 0, 3, token_create, "token.create"},
    {"token", "list", 0, 0, token_list, NULL},
    {"token", "revoke", 1, 1, token_revoke, "token.revoke"},
    {"token", "forget", 0, 0, token_forget, "token.forget"},
    {"audit", "verify", 0, 0, verify, NULL},
    {"audit", "list", 0, 0, list, NULL},
    {"feedback", "list", 0, 0, feedback_list, NULL},
    {"outbox", "list", 0, 0, outbox_list, NULL},
    {"outbox", "retry", 0, 0, outbox_retry, "outbox.retry"},
    {"backup", NULL, 1, 1, backup, "backup"},
};

static enum ischia_code run_command(const struct config *config, const struct command *command,
                                    char *const *words, int count, struct ischia_error *err)
{
    const struct store_options options = {.location = location(config), .mode = STORE_ADMIN};
    struct store *store = NULL;
    TRY(store_open(&options, &store, err));
    enum ischia_code code = command->run(store, words, count, err);
    if (code == ISCHIA_OK && command->audit != NULL) {
        const struct store_audit row = {.who = "admin",
                                        .what = command->audit,
                                        .subject = command->words_min == 1 ? words[0] : "",
                                        .outcome = "ok",
                                        .detail = ""};
        code = store_audit_append(store, &row, err);
    }
    store_close(store);
    return code;
}

/* ---------------------------------------------------- commands that open no store first */

static enum ischia_code note(const char *where, const char *what, struct ischia_error *err)
{
    const struct store_options options = {.location = where, .mode = STORE_ADMIN};
    const struct store_audit row = {
        .who = "admin", .what = what, .subject = "", .outcome = "ok", .detail = ""};
    struct store *store = NULL;
    TRY(store_open(&options, &store, err));
    const enum ischia_code code = store_audit_append(store, &row, err);
    store_close(store);
    return code;
}

static enum ischia_code restore(const struct config *config, char *const *words,
                                struct ischia_error *err)
{
    return store_restore(location(config), words[0], err);
}

static enum ischia_code migrate(const struct config *config, char *const *words,
                                struct ischia_error *err)
{
    int64_t rows = 0;
    (void)config;
    TRY(store_move(words[0], words[1], &rows, err));
    TRY(note(words[1], "store.migrate", err));
    (void)printf("%lld rows\n", (long long)rows);
    return ISCHIA_OK;
}

static const struct {
    const char *noun, *verb; /* verb NULL: none */
    int words;
    enum ischia_code (*run)(const struct config *config, char *const *words,
                            struct ischia_error *err);
} closed_commands[] = {
    {"restore", NULL, 1, restore},
    {"store", "migrate", 2, migrate},
};

/* False: it is none of these. */
static bool run_closed(const struct config *config, char *const *words, int count,
                       enum ischia_code *ret_code, struct ischia_error *err)
{
    for (size_t i = 0; i < sizeof closed_commands / sizeof closed_commands[0]; i++) {
        const int used = closed_commands[i].verb == NULL ? 1 : 2;
        if (count != used + closed_commands[i].words) continue;
        if (strcmp(words[0], closed_commands[i].noun) != 0) continue;
        if (used == 2 && strcmp(words[1], closed_commands[i].verb) != 0) continue;
        *ret_code = closed_commands[i].run(config, words + used, err);
        return true;
    }
    return false;
}

static const struct command *find_command(char *const *words, int count, int *ret_used)
{
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        const struct command *c = &commands[i];
        const int used = c->verb == NULL ? 1 : 2;
        if (count < used || strcmp(words[0], c->noun) != 0) continue;
        if (c->verb != NULL && strcmp(words[1], c->verb) != 0) continue;
        if (count - used < c->words_min || count - used > c->words_max) continue;
        *ret_used = used;
        return c;
    }
    return NULL;
}

int admin_run(const struct config *config, char *const *words, int count)
{
    struct ischia_error err;
    int used = 0;
    enum ischia_code code = ISCHIA_OK;
    if (run_closed(config, words, count, &code, &err))
        return code == ISCHIA_OK ? ADMIN_OK : complain(&err);
    const struct command *command = find_command(words, count, &used);
    if (command == NULL) {
        (void)fprintf(stderr, "ischiad: no such command, or not with these words. Commands:\n%s",
                      admin_help);
        return ADMIN_USAGE;
    }
    if (run_command(config, command, words + used, count - used, &err) != ISCHIA_OK)
        return complain(&err);
    return ADMIN_OK;
}
