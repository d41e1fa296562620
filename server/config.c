/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/config.h"

#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "api/text.h"
#include "server/auth.h"
#include "server/log.h"
#include "server/peers.h"

static const char *const audit_choices[] = {"off", "changes", "all", NULL};

#define TEXT(field, preset, help)                                                                  \
    {                                                                                              \
#field, CONFIG_TEXT, "", 0, 0, preset, NULL, false, offsetof(struct config, field), help   \
    }
#define NUMBER(name, field, unit, min, max, preset, reload, help)                                  \
    {                                                                                              \
        name, CONFIG_INTEGER, unit, min, max, preset, NULL, reload,                                \
            offsetof(struct config, field), help                                                   \
    }
#define SWITCH(field, preset, help)                                                                \
    {                                                                                              \
#field, CONFIG_BOOLEAN, "", 0, 1, preset, NULL, false, offsetof(struct config, field),     \
            help                                                                                   \
    }
#define CHOICE(field, words, preset, reload, help)                                                 \
    {                                                                                              \
#field, CONFIG_CHOICE, "", 0, 0, preset, words, reload, offsetof(struct config, field),    \
            help                                                                                   \
    }

const struct config_option config_options[] = {
    TEXT(listen, "127.0.0.1:8080",
         "Address and port to answer on; port 0 takes a free one. Anything but the loopback "
         "address needs tokens and TLS, or behind_proxy."),
    TEXT(state_dir, "/var/lib/ischia", "Directory of the database; nothing else is written."),
    TEXT(store, "",
         "Where the store is: a directory, or postgresql://USER@HOST/DATABASE for any number of "
         "daemons; empty: in the state directory."),
    NUMBER("workers", workers, "processes", 0, 1024, "0", false,
           "Worker processes that solve side by side; 0: one a processor core."),
    TEXT(worker_program, "",
         "The program that solves; empty: `ischia` beside ischiad, else the one on the path."),
    NUMBER("worker_memory", worker_memory_mib, "MiB", 128, 1048576, "2048", false,
           "Memory that one worker may use; one that asks for more is ended and replaced."),
    NUMBER("worker_time", worker_time_s, "s", 1, 86400, "300", false,
           "Time that one solve may take before its worker is ended."),
    NUMBER("queue_limit", queue_limit, "assessments", 1, 10000000, "20000", true,
           "Waiting assessments above which new ones are answered 429."),
    NUMBER("study_limit", study_limit, "points", 1, 1000000, "10000", false,
           "Points that one study may have, and waiting points of all studies above which new "
           "ones are answered 429."),
    TEXT(emulator, "",
         "File with a trained emulator, as emulator/train.py writes it, for estimates and "
         "intervals; empty: the one that came with the program; none: no estimates."),
    NUMBER("retention_days", retention_days, "d", 0, 36500, "0", true,
           "Age after which finished assessments are erased; 0: never."),
    NUMBER("retention_count", retention_count, "assessments", 0, INT_MAX, "0", true,
           "Finished assessments to keep, the newest; 0: all."),
    NUMBER("idempotency_hours", idempotency_hours, "h", 1, 8760, "24", true,
           "How long an Idempotency-Key is remembered."),
    SWITCH(behind_proxy, "false",
           "A reverse proxy does TLS and access control: any address is allowed, and the client "
           "is the last one in X-Forwarded-For."),
    TEXT(proxy_addresses, "",
         "Addresses and networks, separated by commas, of the reverse proxy: from any other "
         "X-Forwarded-For and user_header are not believed. Empty: X-Forwarded-For is believed "
         "from all."),
    TEXT(user_header, "",
         "Name of the request header in which the proxy says who has signed in; empty: none. Needs "
         "behind_proxy and proxy_addresses. Requests without it, or from elsewhere, need a token."),
    TEXT(user_scopes, "read,assess",
         "What those named by user_header may do: read, assess, or admin, which holds both."),
    TEXT(user_admins, "",
         "Those named by user_header who have the scope admin, separated by commas."),
    TEXT(tls_certificate, "",
         "PEM file with the certificate chain; turns TLS on. SIGHUP reads it and tls_key again."),
    TEXT(tls_key, "", "PEM file with the certificate's private key."),
    TEXT(allowed_hosts, "",
         "Names, separated by commas, that a request's Host may give besides the loopback names "
         "and the address listened on."),
    TEXT(allowed_origins, "",
         "Origins, separated by commas, whose pages may change something; this server's own "
         "always may."),
    TEXT(public_url, "",
         "Address under which others reach this service, as https://host: in links of FHIR "
         "resources, cards, messages and webhooks; empty: that of the request."),
    TEXT(cds_issuers, "",
         "JSON file with the issuers and keys whose signed tokens CDS services take, instead of "
         "access tokens; empty: access tokens. Needs public_url."),
    TEXT(hl7_listen, "",
         "Address and port for HL7 v2 over MLLP; empty: off. Anything but the loopback address "
         "needs hl7_tls with hl7_client_ca, or behind_proxy."),
    SWITCH(hl7_tls, "false", "TLS on hl7_listen, with tls_certificate and tls_key."),
    TEXT(hl7_client_ca, "",
         "PEM file: those who send HL7 v2 over TLS have to show a certificate of this authority."),
    TEXT(hl7_application, "ISCHIA", "MSH-3 of the HL7 v2 messages sent."),
    TEXT(hl7_facility, "", "MSH-4 of the HL7 v2 messages sent."),
    TEXT(hl7_peer, "",
         "HOST:PORT of the record system that is sent an ORU^R01 over MLLP when an assessment "
         "ends; empty: none."),
    SWITCH(hl7_peer_tls, "false", "TLS to hl7_peer."),
    TEXT(hl7_peer_application, "", "MSH-5 of the results sent to hl7_peer."),
    TEXT(hl7_peer_facility, "", "MSH-6 of the results sent to hl7_peer."),
    TEXT(webhook_url, "",
         "Address that is told by a signed POST when an assessment ends; empty: none."),
    TEXT(webhook_secret, "", "File with the secret that signs webhooks; needed with webhook_url."),
    TEXT(push_url, "",
         "Base of a FHIR server that a DiagnosticReport is posted to when an assessment ends; "
         "empty: none."),
    TEXT(push_token_url, "",
         "Token endpoint for push_url (SMART Backend Services); empty: no authorization."),
    TEXT(push_client, "", "Client id at push_token_url."),
    TEXT(push_key, "", "PEM file with the private key (P-384 or RSA) of push_client."),
    TEXT(push_key_id, "", "Key id (kid) of push_key as push_token_url knows it."),
    TEXT(push_scope, "system/DiagnosticReport.c", "Scope asked for at push_token_url."),
    TEXT(outbound_ca, "",
         "PEM file with the authorities that webhook_url, push_url, push_token_url and hl7_peer "
         "are checked against; empty: the system's."),
    NUMBER("outbound_pause", outbound_pause_s, "s", 1, 86400, "60", false,
           "Longest pause before something that could not be delivered is tried again; pauses "
           "begin at a second and double."),
    NUMBER("outbound_days", outbound_days, "d", 1, 365, "7", false,
           "How long a delivery is tried before it is given up."),
    NUMBER("http_threads", http_threads, "threads", 0, 256, "0", false,
           "Threads that answer requests; 0: one a processor core, at most 8."),
    NUMBER("connections", connections, "connections", 16, 1000000, "4096", false,
           "Connections open at once."),
    NUMBER("connections_per_address", connections_per_address, "connections", 1, 1000000, "2048",
           false, "Connections open at once from one address."),
    NUMBER("idle_timeout", idle_timeout_s, "s", 1, 3600, "60", false,
           "How long a connection may stay without a request."),
    NUMBER("request_timeout", request_timeout_s, "s", 1, 3600, "20", false,
           "How long a client may take to send one request, from its first line to its last byte."),
    NUMBER("rate_limit", rate_limit, "requests/s", 0, 1000000, "100", true,
           "Requests that one client (token, or else address) may send; 0: no limit. Requests "
           "from this machine are not limited unless they carry a token."),
    NUMBER("rate_burst", rate_burst, "requests", 1, 1000000, "200", true,
           "Requests that a client may send at once before rate_limit holds."),
    NUMBER("drain_timeout", drain_timeout_s, "s", 0, 3600, "20", true,
           "How long running solves may finish after SIGTERM; later they return to the queue."),
    CHOICE(audit, audit_choices, "all", true,
           "Which requests the audit log records: none, those that change something, or also "
           "those that read an assessment."),
    CHOICE(log_level, log_level_names, "info", true, "The least serious messages to log."),
    SWITCH(sandbox, "true", "Give up, after start, what the daemon does not need."),
};
const size_t config_option_count = sizeof config_options / sizeof config_options[0];

static char *text_field(struct config *config, const struct config_option *option)
{
    return (char *)config + option->offset;
}

static int *int_field(struct config *config, const struct config_option *option)
{
    return (int *)(void *)((char *)config + option->offset);
}

static bool *bool_field(struct config *config, const struct config_option *option)
{
    return (bool *)(void *)((char *)config + option->offset);
}

static enum ischia_code set_text(struct config *config, const struct config_option *option,
                                 const char *value, struct ischia_error *err)
{
    const size_t length = strlen(value);
    CHECK(length < CONFIG_TEXT_BYTES, err, ISCHIA_E_INPUT, "%s is longer than %d bytes",
          option->name, CONFIG_TEXT_BYTES - 1);
    for (size_t i = 0; i < length; i++)
        CHECK(!iscntrl((unsigned char)value[i]), err, ISCHIA_E_INPUT,
              "%s holds a control character", option->name);
    memcpy(text_field(config, option), value, length + 1);
    return ISCHIA_OK;
}

static enum ischia_code set_integer(struct config *config, const struct config_option *option,
                                    const char *value, struct ischia_error *err)
{
    char *end = NULL;
    errno = 0;
    const long number = strtol(value, &end, 10);
    CHECK(end != value && *end == '\0' && errno == 0 && number >= option->min &&
              number <= option->max,
          err, ISCHIA_E_INPUT, "%s is '%.40s'; accepted %d to %d %s", option->name, value,
          option->min, option->max, option->unit);
    *int_field(config, option) = (int)number;
    return ISCHIA_OK;
}

static enum ischia_code set_boolean(struct config *config, const struct config_option *option,
                                    const char *value, struct ischia_error *err)
{
    static const struct {
        const char *word;
        bool value;
    } words[] = {{"true", true},   {"yes", true}, {"on", true},   {"1", true},
                 {"false", false}, {"no", false}, {"off", false}, {"0", false}};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        if (strcmp(value, words[i].word) != 0) continue;
        *bool_field(config, option) = words[i].value;
        return ISCHIA_OK;
    }
    return FAIL(err, ISCHIA_E_INPUT, "%s is '%.40s'; accepted true or false", option->name, value);
}

static enum ischia_code set_choice(struct config *config, const struct config_option *option,
                                   const char *value, struct ischia_error *err)
{
    char known[128] = "";
    size_t used = 0;
    for (int i = 0; option->choices[i] != NULL; i++) {
        if (strcmp(value, option->choices[i]) == 0) {
            *int_field(config, option) = i;
            return ISCHIA_OK;
        }
        const int n = snprintf(known + used, sizeof known - used, "%s%s", i == 0 ? "" : ", ",
                               option->choices[i]);
        if (n > 0 && (size_t)n < sizeof known - used) used += (size_t)n;
    }
    return FAIL(err, ISCHIA_E_INPUT, "%s is '%.40s'; accepted %s", option->name, value, known);
}

static enum ischia_code set_option(struct config *config, const struct config_option *option,
                                   const char *value, struct ischia_error *err)
{
    static enum ischia_code (*const set[])(struct config *, const struct config_option *,
                                           const char *, struct ischia_error *) = {
        [CONFIG_TEXT] = set_text,
        [CONFIG_INTEGER] = set_integer,
        [CONFIG_BOOLEAN] = set_boolean,
        [CONFIG_CHOICE] = set_choice,
    };
    return set[option->kind](config, option, value, err);
}

struct config config_default(void)
{
    struct config config;
    memset(&config, 0, sizeof config);
    for (size_t i = 0; i < config_option_count; i++) {
        /* A default that its own option refuses is our bug: test_config walks the table. */
        if (set_option(&config, &config_options[i], config_options[i].default_text, NULL) !=
            ISCHIA_OK)
            abort();
    }
    return config;
}

static const struct config_option *find_option(const char *name)
{
    for (size_t i = 0; i < config_option_count; i++)
        if (strcmp(config_options[i].name, name) == 0) return &config_options[i];
    return NULL;
}

static const char *nearest_name(const char *name)
{
    int least = TEXT_NO_SLIP;
    const char *nearest = "";
    for (size_t i = 0; i < config_option_count; i++) {
        const int slips = text_slips(name, config_options[i].name);
        if (slips >= least) continue;
        least = slips;
        nearest = config_options[i].name;
    }
    return nearest;
}

enum ischia_code config_find(const char *name, const struct config_option **ret,
                             struct ischia_error *err)
{
    *ret = find_option(name);
    if (*ret != NULL) return ISCHIA_OK;
    const char *nearest = nearest_name(name);
    if (nearest[0] == '\0') return FAIL(err, ISCHIA_E_INPUT, "no option is called '%.48s'", name);
    return FAIL(err, ISCHIA_E_INPUT, "no option is called '%.48s'; did you mean '%s'?", name,
                nearest);
}

enum ischia_code config_set(struct config *config, const char *name, const char *value,
                            struct ischia_error *err)
{
    const struct config_option *option = NULL;
    TRY(config_find(name, &option, err));
    return set_option(config, option, value, err);
}

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

/* Cuts blanks and a comment off the ends of text[0..size); returns the start. */
static const char *trimmed(const char *text, size_t *size)
{
    while (*size > 0 && is_blank(*text)) {
        text++;
        (*size)--;
    }
    while (*size > 0 && is_blank(text[*size - 1])) (*size)--;
    return text;
}

/* Copies text[0..size) as a string, NUL bytes refused. False when it does not fit. */
static bool copy_word(char *to, size_t to_size, const char *text, size_t size)
{
    if (size >= to_size || memchr(text, '\0', size) != NULL) return false;
    memcpy(to, text, size);
    to[size] = '\0';
    return true;
}

static enum ischia_code parse_line(struct config *config, const char *line, size_t size,
                                   struct ischia_error *err)
{
    char name[64], value[CONFIG_TEXT_BYTES + 64];
    const char *comment = memchr(line, '#', size);
    if (comment != NULL) size = (size_t)(comment - line);
    line = trimmed(line, &size);
    if (size == 0) return ISCHIA_OK;
    const char *equals = memchr(line, '=', size);
    CHECK(equals != NULL, err, ISCHIA_E_INPUT, "expected `name = value`");
    size_t name_size = (size_t)(equals - line), value_size = size - name_size - 1;
    const char *name_start = trimmed(line, &name_size);
    const char *value_start = trimmed(equals + 1, &value_size);
    CHECK(copy_word(name, sizeof name, name_start, name_size), err, ISCHIA_E_INPUT,
          "the option's name is too long");
    CHECK(copy_word(value, sizeof value, value_start, value_size), err, ISCHIA_E_INPUT,
          "the value of '%s' is too long", name);
    return config_set(config, name, value, err);
}

enum ischia_code config_parse(struct config *config, const char *text, size_t size,
                              const char *origin, struct ischia_error *err)
{
    int number = 0;
    while (size > 0) {
        struct ischia_error cause;
        const char *newline = memchr(text, '\n', size);
        const size_t length = newline == NULL ? size : (size_t)(newline - text);
        const size_t taken = newline == NULL ? size : length + 1;
        number++;
        if (parse_line(config, text, length, &cause) != ISCHIA_OK)
            return FAIL(err, cause.code, "%s, line %d: %.400s", origin, number, cause.message);
        text += taken;
        size -= taken;
    }
    return ISCHIA_OK;
}

enum ischia_code config_read_file(struct config *config, const char *path, struct ischia_error *err)
{
    enum { LARGEST_BYTES = 65536 };
    FILE *file = fopen(path, "re");
    CHECK(file != NULL, err, ISCHIA_E_INPUT, "cannot open %s: %s", path, strerror(errno));
    char *text = malloc(LARGEST_BYTES);
    enum ischia_code code = ISCHIA_OK;
    if (text == NULL) {
        code = FAIL(err, ISCHIA_E_MEMORY, "no memory to read %s", path);
        goto done;
    }
    const size_t size = fread(text, 1, LARGEST_BYTES, file);
    if (ferror(file))
        code = FAIL(err, ISCHIA_E_IO, "cannot read %s: %s", path, strerror(errno));
    else if (size == LARGEST_BYTES)
        code = FAIL(err, ISCHIA_E_LIMIT, "%s is larger than %d bytes", path, LARGEST_BYTES - 1);
    else
        code = config_parse(config, text, size, path, err);
done:
    free(text);
    (void)fclose(file);
    return code;
}

/* "ISCHIA_LISTEN=x" -> option and value; NULL when the variable is none of ours. */
static const struct config_option *variable_option(const char *variable, const char **ret_value)
{
    char name[64];
    const char *equals = strchr(variable, '=');
    if (equals == NULL || !copy_word(name, sizeof name, variable, (size_t)(equals - variable)))
        return NULL;
    for (char *c = name; *c != '\0'; c++) *c = (char)tolower((unsigned char)*c);
    *ret_value = equals + 1;
    return find_option(name);
}

static void append_word(char *list, size_t size, const char *word, size_t length)
{
    const size_t used = strlen(list);
    if (used + length + 2 > size) return;
    (void)snprintf(list + used, size - used, "%s%.*s", used == 0 ? "" : " ", (int)length, word);
}

enum ischia_code config_read_environment(struct config *config, char *const *environment,
                                         char *ret_unknown, size_t unknown_size,
                                         struct ischia_error *err)
{
    static const char prefix[] = "ISCHIA_";
    ret_unknown[0] = '\0';
    for (; *environment != NULL; environment++) {
        struct ischia_error cause;
        const char *value = NULL, *variable = *environment;
        if (strncmp(variable, prefix, sizeof prefix - 1) != 0) continue;
        const struct config_option *option = variable_option(variable + sizeof prefix - 1, &value);
        if (option == NULL)
            append_word(ret_unknown, unknown_size, variable, strcspn(variable, "="));
        else if (set_option(config, option, value, &cause) != ISCHIA_OK)
            return FAIL(err, cause.code, "environment variable %.*s: %.400s",
                        (int)strcspn(variable, "="), variable, cause.message);
    }
    return ISCHIA_OK;
}

/* "" or http(s)://host with an optional path, without anything that must be escaped. */
static bool url_is_plain(const char *url)
{
    const size_t length = strlen(url);
    if (length == 0) return true;
    if (strncmp(url, "http://", 7) != 0 && strncmp(url, "https://", 8) != 0) return false;
    for (const char *c = url; *c != '\0'; c++)
        if ((unsigned char)*c <= 0x20 || (unsigned char)*c >= 0x7f ||
            strchr("\"<>?#\\", *c) != NULL)
            return false;
    return url[length - 1] != '/';
}

/* What stands in MSH as it is. */
static enum ischia_code check_hl7_names(const struct config *config, struct ischia_error *err)
{
    const char *const names[] = {config->hl7_application, config->hl7_facility,
                                 config->hl7_peer_application, config->hl7_peer_facility};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        for (const char *c = names[i]; *c != '\0'; c++)
            CHECK((unsigned char)*c >= 0x20 && (unsigned char)*c < 0x7f &&
                      strchr("|^~\\&", *c) == NULL,
                  err, ISCHIA_E_INPUT, "an HL7 name is '%.40s'; accepted ASCII without |^~\\&",
                  names[i]);
    CHECK(config->hl7_application[0] != '\0', err, ISCHIA_E_INPUT, "hl7_application is empty");
    return ISCHIA_OK;
}

/* The name of a header that means nothing else: a token of RFC 9110. */
static bool is_own_header(const char *name)
{
    static const char *const taken[] = {"authorization",   "cookie", "connection",    "host",
                                        "x-forwarded-for", "origin", "content-length"};
    for (size_t i = 0; i < sizeof taken / sizeof taken[0]; i++)
        if (strcasecmp(name, taken[i]) == 0) return false;
    for (const char *c = name; *c != '\0'; c++)
        if (!isalnum((unsigned char)*c) && *c != '-' && *c != '_') return false;
    return true;
}

/* Who has signed in is believed from one place only: it must be known which. */
static enum ischia_code check_proxy(const struct config *config, struct ischia_error *err)
{
    struct ischia_error cause;
    if (peers_check(config->proxy_addresses, &cause) != ISCHIA_OK)
        return FAIL(err, cause.code, "proxy_addresses: %.300s", cause.message);
    CHECK(config->proxy_addresses[0] == '\0' || config->behind_proxy, err, ISCHIA_E_INPUT,
          "proxy_addresses needs behind_proxy");
    CHECK(auth_parse_scopes(config->user_scopes) != 0, err, ISCHIA_E_INPUT,
          "user_scopes is '%.40s'; accepted read, assess, admin, or some with commas between",
          config->user_scopes);
    if (config->user_header[0] == '\0') return ISCHIA_OK;
    CHECK(config->behind_proxy && config->proxy_addresses[0] != '\0', err, ISCHIA_E_INPUT,
          "user_header needs behind_proxy and proxy_addresses: anybody could send that header");
    CHECK(is_own_header(config->user_header), err, ISCHIA_E_INPUT,
          "user_header is '%.40s'; it takes the name of a header that has no other meaning",
          config->user_header);
    return ISCHIA_OK;
}

enum ischia_code config_check(const struct config *config, struct ischia_error *err)
{
    TRY(check_proxy(config, err));
    CHECK((config->tls_certificate[0] == '\0') == (config->tls_key[0] == '\0'), err, ISCHIA_E_INPUT,
          "tls_certificate and tls_key go together: set both or neither");
    CHECK(config->cds_issuers[0] == '\0' || config->public_url[0] != '\0', err, ISCHIA_E_INPUT,
          "cds_issuers needs public_url: tokens are made out for an address");
    CHECK(!config->hl7_tls || config->tls_certificate[0] != '\0', err, ISCHIA_E_INPUT,
          "hl7_tls needs tls_certificate and tls_key");
    CHECK(config->hl7_client_ca[0] == '\0' || config->hl7_tls, err, ISCHIA_E_INPUT,
          "hl7_client_ca needs hl7_tls");
    CHECK((config->webhook_url[0] == '\0') == (config->webhook_secret[0] == '\0'), err,
          ISCHIA_E_INPUT, "webhook_url and webhook_secret go together: set both or neither");
    CHECK(config->push_token_url[0] == '\0' ||
              (config->push_client[0] != '\0' && config->push_key[0] != '\0' &&
               config->push_url[0] != '\0'),
          err, ISCHIA_E_INPUT, "push_token_url needs push_url, push_client and push_key");
    TRY(check_hl7_names(config, err));
    CHECK(url_is_plain(config->public_url), err, ISCHIA_E_INPUT,
          "public_url is '%.80s'; write https://host without a slash at the end",
          config->public_url);
    CHECK(config->listen[0] != '\0', err, ISCHIA_E_INPUT, "listen is empty");
    CHECK(config->state_dir[0] != '\0', err, ISCHIA_E_INPUT, "state_dir is empty");
    CHECK(config->connections_per_address <= config->connections, err, ISCHIA_E_INPUT,
          "connections_per_address is %d, more than connections, %d",
          config->connections_per_address, config->connections);
    return ISCHIA_OK;
}

void config_value_text(const struct config *config, const struct config_option *option, char *ret,
                       size_t size)
{
    const char *field = (const char *)config + option->offset;
    int number = 0;
    bool flag = false;
    switch (option->kind) {
    case CONFIG_TEXT:
        (void)snprintf(ret, size, "%s", field);
        break;
    case CONFIG_INTEGER:
        memcpy(&number, field, sizeof number);
        (void)snprintf(ret, size, "%d", number);
        break;
    case CONFIG_BOOLEAN:
        memcpy(&flag, field, sizeof flag);
        (void)snprintf(ret, size, "%s", flag ? "true" : "false");
        break;
    case CONFIG_CHOICE:
        memcpy(&number, field, sizeof number);
        (void)snprintf(ret, size, "%s", option->choices[number]);
        break;
    }
}

/* "128 to 1048576 MiB", "off, changes or all", "true or false", "". */
static void accepted_text(const struct config_option *option, char *ret, size_t size)
{
    size_t used = 0;
    ret[0] = '\0';
    if (option->kind == CONFIG_INTEGER)
        (void)snprintf(ret, size, "%d to %d %s", option->min, option->max, option->unit);
    if (option->kind == CONFIG_BOOLEAN) (void)snprintf(ret, size, "true or false");
    if (option->kind != CONFIG_CHOICE) return;
    for (int i = 0; option->choices[i] != NULL; i++) {
        const char *joint = i == 0 ? "" : option->choices[i + 1] == NULL ? " or " : ", ";
        const int n = snprintf(ret + used, size - used, "%s%s", joint, option->choices[i]);
        if (n > 0 && (size_t)n < size - used) used += (size_t)n;
    }
}

void config_print(const struct config *config, FILE *out)
{
    for (size_t i = 0; i < config_option_count; i++) {
        const struct config_option *option = &config_options[i];
        char value[CONFIG_TEXT_BYTES], accepted[128];
        config_value_text(config, option, value, sizeof value);
        accepted_text(option, accepted, sizeof accepted);
        (void)fprintf(out, "# %s%s%s%s\n%s = %s\n\n", option->help,
                      accepted[0] == '\0' ? "" : " Accepted: ", accepted,
                      accepted[0] == '\0' ? "" : ".", option->name, value);
    }
}

/* "none" would be a word that some options take. */
static const char *default_words(const struct config_option *option)
{
    return option->default_text[0] == '\0' ? "empty" : option->default_text;
}

static void print_flag(FILE *out, const char *name)
{
    for (; *name != '\0'; name++) (void)fputc(*name == '_' ? '-' : *name, out);
}

void config_print_help(FILE *out)
{
    for (size_t i = 0; i < config_option_count; i++) {
        const struct config_option *option = &config_options[i];
        char accepted[128];
        accepted_text(option, accepted, sizeof accepted);
        (void)fputs("  --", out);
        print_flag(out, option->name);
        if (accepted[0] != '\0') (void)fprintf(out, "  (%s)", accepted);
        (void)fprintf(out, "  [%s]\n      %s\n", default_words(option), option->help);
    }
}

void config_print_man(FILE *out)
{
    for (size_t i = 0; i < config_option_count; i++) {
        const struct config_option *option = &config_options[i];
        char accepted[128];
        accepted_text(option, accepted, sizeof accepted);
        (void)fprintf(out, ".TP\n.B %s\n%s\n", option->name, option->help);
        if (accepted[0] != '\0') (void)fprintf(out, "Accepted: %s.\n", accepted);
        (void)fprintf(out, "Default: %s.%s\n", default_words(option),
                      option->reloadable ? " SIGHUP applies a new value." : "");
    }
}

static size_t field_bytes(const struct config_option *option)
{
    switch (option->kind) {
    case CONFIG_TEXT:
        return CONFIG_TEXT_BYTES;
    case CONFIG_BOOLEAN:
        return sizeof(bool);
    case CONFIG_INTEGER:
    case CONFIG_CHOICE:
        break;
    }
    return sizeof(int);
}

static bool option_differs(const struct config *a, const struct config *b,
                           const struct config_option *option)
{
    char text_a[CONFIG_TEXT_BYTES], text_b[CONFIG_TEXT_BYTES];
    config_value_text(a, option, text_a, sizeof text_a);
    config_value_text(b, option, text_b, sizeof text_b);
    return strcmp(text_a, text_b) != 0;
}

size_t config_reload(struct config *config, const struct config *from, char *ret_names,
                     size_t names_size)
{
    size_t differing = 0;
    ret_names[0] = '\0';
    for (size_t i = 0; i < config_option_count; i++) {
        const struct config_option *option = &config_options[i];
        if (!option_differs(config, from, option)) continue;
        if (option->reloadable) {
            memcpy((char *)config + option->offset, (const char *)from + option->offset,
                   field_bytes(option));
            continue;
        }
        append_word(ret_names, names_size, option->name, strlen(option->name));
        differing++;
    }
    return differing;
}
