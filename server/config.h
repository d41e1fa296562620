/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_CONFIG_H
#define ISCHIA_SERVER_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "solver/error.h"

/*
 * The options of ischiad. One table (config_options) gives each its name, unit, bounds, default
 * and help; the file, the environment, the flags, --print-config and the manual page iterate it.
 *
 * Later sources win: default, file (`name = value`), environment (ISCHIA_NAME), flag (--name).
 */

enum { CONFIG_TEXT_BYTES = 256 };

enum config_audit { CONFIG_AUDIT_OFF, CONFIG_AUDIT_CHANGES, CONFIG_AUDIT_ALL };

struct config {
    char listen[CONFIG_TEXT_BYTES];
    char state_dir[CONFIG_TEXT_BYTES];
    char store[CONFIG_TEXT_BYTES];
    char proxy_addresses[CONFIG_TEXT_BYTES];
    char user_header[CONFIG_TEXT_BYTES];
    char user_scopes[CONFIG_TEXT_BYTES];
    char user_admins[CONFIG_TEXT_BYTES];
    char tls_certificate[CONFIG_TEXT_BYTES];
    char tls_key[CONFIG_TEXT_BYTES];
    char allowed_hosts[CONFIG_TEXT_BYTES];
    char allowed_origins[CONFIG_TEXT_BYTES];
    char worker_program[CONFIG_TEXT_BYTES];
    char public_url[CONFIG_TEXT_BYTES];
    char cds_issuers[CONFIG_TEXT_BYTES];
    char hl7_listen[CONFIG_TEXT_BYTES];
    char hl7_client_ca[CONFIG_TEXT_BYTES];
    char hl7_application[CONFIG_TEXT_BYTES];
    char hl7_facility[CONFIG_TEXT_BYTES];
    char hl7_peer[CONFIG_TEXT_BYTES];
    char hl7_peer_application[CONFIG_TEXT_BYTES];
    char hl7_peer_facility[CONFIG_TEXT_BYTES];
    char webhook_url[CONFIG_TEXT_BYTES];
    char webhook_secret[CONFIG_TEXT_BYTES];
    char push_url[CONFIG_TEXT_BYTES];
    char push_token_url[CONFIG_TEXT_BYTES];
    char push_client[CONFIG_TEXT_BYTES];
    char push_key[CONFIG_TEXT_BYTES];
    char push_key_id[CONFIG_TEXT_BYTES];
    char push_scope[CONFIG_TEXT_BYTES];
    char outbound_ca[CONFIG_TEXT_BYTES];
    bool hl7_tls;
    bool hl7_peer_tls;
    int outbound_pause_s;
    int outbound_days;
    bool behind_proxy;
    bool sandbox;
    int workers;
    int worker_memory_mib;
    int worker_time_s;
    int queue_limit, study_limit;
    char emulator[CONFIG_TEXT_BYTES];
    int retention_days;
    int retention_count;
    int idempotency_hours;
    int http_threads;
    int connections;
    int connections_per_address;
    int idle_timeout_s;
    int request_timeout_s;
    int rate_limit;
    int rate_burst;
    int drain_timeout_s;
    int audit;     /* enum config_audit */
    int log_level; /* enum log_level   */
};

enum config_kind { CONFIG_TEXT, CONFIG_INTEGER, CONFIG_BOOLEAN, CONFIG_CHOICE };

struct config_option {
    const char *name; /* as in the file; the flag has '-' for '_', the variable is upper case */
    enum config_kind kind;
    const char *unit; /* "" when it has none */
    int min, max;     /* of an integer */
    const char *default_text;
    const char *const *choices; /* of a choice, NULL-ended */
    bool reloadable;            /* SIGHUP applies a new value without a restart */
    size_t offset;              /* in struct config */
    const char *help;           /* one plain sentence */
};

extern const struct config_option config_options[];
extern const size_t config_option_count;

/* Every option at its default. */
struct config config_default(void);

/* ISCHIA_E_INPUT: a name that does not exist is answered with the nearest one that does. */
ISCHIA_MUST_CHECK enum ischia_code config_find(const char *name, const struct config_option **ret,
                                               struct ischia_error *err);

/* Sets one option from its text. ISCHIA_E_INPUT as config_find, or names what is accepted. */
ISCHIA_MUST_CHECK enum ischia_code config_set(struct config *config, const char *name,
                                              const char *value, struct ischia_error *err);

/* Reads `name = value` lines; '#' starts a comment. `origin` names the text in messages. The text
 * need not end in NUL. On failure *config holds the lines before the bad one. */
ISCHIA_MUST_CHECK enum ischia_code config_parse(struct config *config, const char *text,
                                                size_t size, const char *origin,
                                                struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code config_read_file(struct config *config, const char *path,
                                                    struct ischia_error *err);

/* Applies ISCHIA_* variables. Those that no option owns (other programs may use the prefix too) go
 * to ret_unknown, separated by spaces and cut to fit, for a warning. */
ISCHIA_MUST_CHECK enum ischia_code
config_read_environment(struct config *config, char *const *environment, char *ret_unknown,
                        size_t unknown_size, struct ischia_error *err);

/* Rules that join options (certificate with key, ...). */
ISCHIA_MUST_CHECK enum ischia_code config_check(const struct config *config,
                                                struct ischia_error *err);

/* The effective values, in the form of the file, each under its help. */
void config_print(const struct config *config, FILE *out);
/* The options as a section of the manual page (man macros), or as lines for --help. */
void config_print_man(FILE *out);
void config_print_help(FILE *out);

/* Copies the reloadable options of `from`. Returns how many others differ (they need a restart);
 * their names, separated by spaces, go to ret_names. */
size_t config_reload(struct config *config, const struct config *from, char *ret_names,
                     size_t names_size);

/* The choice's word for an option's present value; static storage. */
void config_value_text(const struct config *config, const struct config_option *option, char *ret,
                       size_t size);

#endif
