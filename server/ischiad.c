/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "server/admin.h"
#include "server/config.h"
#include "server/hl7/listener.h"
#include "server/http/listen.h"
#include "server/http/routes.h"
#include "server/http/service.h"
#include "server/http/tls.h"
#include "server/log.h"
#include "server/metrics.h"
#include "server/notify.h"
#include "server/outbound/outbound.h"
#include "server/sandbox.h"
#include "server/standard_streams.h"
#include "server/textfile.h"

/*
 * The daemon. main reads the options; serve is a chain of steps, each with its undoing, and the
 * loop between them takes signals, so that no signal handler exists.
 */

enum { EXIT_USAGE = 2, TICK_MS = 1000, RETIRE_EVERY_S = 60, RETIRE_BATCH = 200 };
enum { DATABASE_PATIENCE_S = 60 };
enum { SWEEP_AGE_MS = 5 * 60 * 1000 };

struct daemon {
    struct service service;
    struct arguments *arguments;
    struct link_tls *hl7_tls; /* NULL: plain */
    struct listener *hl7;     /* NULL: off   */
    struct outbound *outbound;
    char worker_program[PATH_MAX];
    char emulator[ESTIMATOR_PATH_BYTES]; /* "": there is none */
    int64_t retire_at_ms, watchdog_at_ms;
};

/* --------------------------------------------------------------------------- options */

enum action { ACT_SERVE, ACT_CHECK, ACT_PRINT, ACT_MAN, ACT_ROUTES, ACT_HELP, ACT_VERSION };

struct arguments {
    char *config_path; /* NULL: none */
    char **flags;      /* pairs: option name, value */
    int flag_count;
    char **words;
    int word_count;
    char *from, *to; /* of `store migrate`; NULL: not given */
    enum action action;
};

static const struct {
    const char *flag;
    enum action action;
} actions[] = {
    {"check-config", ACT_CHECK},  {"print-config", ACT_PRINT}, {"print-man", ACT_MAN},
    {"print-routes", ACT_ROUTES}, {"help", ACT_HELP},          {"version", ACT_VERSION},
};

static bool find_action(const char *flag, struct arguments *ret)
{
    for (size_t i = 0; i < sizeof actions / sizeof actions[0]; i++) {
        if (strcmp(flag, actions[i].flag) != 0) continue;
        ret->action = actions[i].action;
        return true;
    }
    return false;
}

/* Where the value of a flag goes that is no option of the daemon; NULL: it is one, or nothing. */
static char **own_flag(struct arguments *a, const char *name)
{
    const struct {
        const char *name;
        char **value;
    } own[] = {{"config", &a->config_path}, {"from", &a->from}, {"to", &a->to}};
    for (size_t i = 0; i < sizeof own / sizeof own[0]; i++)
        if (strcmp(name, own[i].name) == 0) return own[i].value;
    return NULL;
}

/* One "--name=value", "--name value" or "--switch"; returns how many words it took, 0: an error. */
static int parse_flag(struct arguments *ret, char **argv, int left, struct ischia_error *err)
{
    static char yes[] = "true";
    const struct config_option *option = NULL;
    char *name = argv[0] + 2, *equals = strchr(name, '=');
    if (find_action(name, ret)) return 1;
    if (equals != NULL) *equals = '\0';
    for (char *c = name; *c != '\0'; c++)
        if (*c == '-') *c = '_';
    char **own = own_flag(ret, name), *value = equals == NULL ? NULL : equals + 1;
    int used = 1;
    if (own == NULL && config_find(name, &option, err) != ISCHIA_OK) return 0;
    if (value == NULL && option != NULL && option->kind == CONFIG_BOOLEAN) value = yes;
    if (value == NULL && left > 1) {
        value = argv[1];
        used = 2;
    }
    if (value == NULL) {
        (void)FAIL(err, ISCHIA_E_INPUT, "--%s needs a value", name);
        return 0;
    }
    if (own != NULL) {
        *own = value;
        return used;
    }
    ret->flags[2 * ret->flag_count] = name;
    ret->flags[2 * ret->flag_count + 1] = value;
    ret->flag_count++;
    return used;
}

static enum ischia_code parse_arguments(struct arguments *ret, int argc, char **argv,
                                        struct ischia_error *err)
{
    ret->flags = calloc((size_t)argc * 3, sizeof(char *));
    CHECK(ret->flags != NULL, err, ISCHIA_E_MEMORY, "no memory for the arguments");
    ret->words = ret->flags + 2 * argc;
    for (int i = 1; i < argc;) {
        if (strncmp(argv[i], "--", 2) != 0) {
            ret->words[ret->word_count++] = argv[i++];
            continue;
        }
        const int used = parse_flag(ret, argv + i, argc - i, err);
        if (used == 0) return err->code;
        i += used;
    }
    /* they took two words each */
    if (ret->from != NULL) ret->words[ret->word_count++] = ret->from;
    if (ret->to != NULL) ret->words[ret->word_count++] = ret->to;
    return ISCHIA_OK;
}

/* Default, file, environment, flags: later ones win. */
static enum ischia_code load_config(struct config *ret, const struct arguments *arguments,
                                    struct ischia_error *err)
{
    struct config config = config_default();
    char unknown[256];
    struct log_value quoted;
    if (arguments->config_path != NULL) TRY(config_read_file(&config, arguments->config_path, err));
    TRY(config_read_environment(&config, environ, unknown, sizeof unknown, err));
    if (unknown[0] != '\0')
        LOG_WARNING("environment variables that are no options", "names=%s",
                    log_quote(&quoted, unknown));
    for (int i = 0; i < arguments->flag_count; i++)
        TRY(config_set(&config, arguments->flags[2 * i], arguments->flags[2 * i + 1], err));
    TRY(config_check(&config, err));
    *ret = config;
    return ISCHIA_OK;
}

/* ----------------------------------------------------------------------------- steps */

static bool uses_tls(const struct config *config) { return config->tls_certificate[0] != '\0'; }

static void log_expiry(time_t expires)
{
    struct tm parts;
    char date[32];
    (void)gmtime_r(&expires, &parts);
    (void)strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", &parts);
    log_event(expires < time(NULL) ? LOG_LEVEL_WARNING : LOG_LEVEL_INFO, "certificate loaded",
              "expires=%s", date);
}

/* At start, and again at each reload: those who renew certificates write into the same files. */
static enum ischia_code load_tls(const struct config *config, struct ischia_error *err)
{
    char *certificate = NULL, *key = NULL;
    time_t expires = 0;
    if (!uses_tls(config)) return ISCHIA_OK;
    enum ischia_code code = textfile_read(config->tls_certificate, &certificate, err);
    if (code == ISCHIA_OK) code = textfile_read(config->tls_key, &key, err);
    if (code == ISCHIA_OK) code = tls_set(certificate, key, &expires, err);
    if (code == ISCHIA_OK) log_expiry(expires);
    if (key != NULL) explicit_bzero(key, strlen(key));
    free(certificate);
    free(key);
    return code;
}

/* As many descriptors as the system lets us: each connection is one. */
static void raise_descriptor_limit(void)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
    limit.rlim_cur = limit.rlim_max;
    (void)setrlimit(RLIMIT_NOFILE, &limit);
}

static enum ischia_code enter_state_dir(struct daemon *d, struct ischia_error *err)
{
    const struct config *config = &d->service.config;
    (void)umask(077);
    CHECK(mkdir(config->state_dir, 0700) == 0 || errno == EEXIST, err, ISCHIA_E_IO,
          "cannot make %s: %s", config->state_dir, strerror(errno));
    CHECK(setenv("SQLITE_TMPDIR", config->state_dir, 1) == 0, err, ISCHIA_E_MEMORY,
          "no memory for the environment");
    if (!config->sandbox) return ISCHIA_OK;
    const struct sandbox_report report = sandbox_enter(config->state_dir);
    LOG_INFO("sandbox", "no_new_privileges=%d no_dumps=%d landlock=%d", report.no_new_privileges,
             report.no_dumps, report.landlock);
    return ISCHIA_OK;
}

/* `ischia` beside this program, where a package puts it, or below it, where a build does; else
 * whatever is on the path. */
static void find_worker(struct daemon *d)
{
    static const char *const places[] = {"ischia", "cli/ischia"};
    const char *wish = d->service.config.worker_program;
    char own[PATH_MAX - 16], candidate[PATH_MAX];
    (void)snprintf(d->worker_program, sizeof d->worker_program, "%s",
                   wish[0] == '\0' ? "ischia" : wish);
    const ssize_t n = readlink("/proc/self/exe", own, sizeof own - 1);
    if (wish[0] != '\0' || n <= 0) return;
    own[n] = '\0';
    char *slash = strrchr(own, '/');
    if (slash == NULL) return;
    *slash = '\0';
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        (void)snprintf(candidate, sizeof candidate, "%s/%s", own, places[i]);
        if (access(candidate, X_OK) != 0) continue;
        (void)snprintf(d->worker_program, sizeof d->worker_program, "%s", candidate);
        return;
    }
}

/* A database server may come up after us, after a power cut say. SIGTERM and SIGINT, which are
 * blocked, end the wait; run is not reached then. */
static enum ischia_code open_patiently(const struct store_options *options, struct store **ret,
                                       struct ischia_error *err)
{
    const struct timespec pause = {.tv_sec = 1};
    const int patience_s = store_is_on_server(options->location) ? DATABASE_PATIENCE_S : 0;
    sigset_t ends;
    struct log_value detail;
    (void)sigemptyset(&ends);
    (void)sigaddset(&ends, SIGTERM);
    (void)sigaddset(&ends, SIGINT);
    for (int waited_s = 0;; waited_s++) {
        const enum ischia_code code = store_open(options, ret, err);
        if (code != ISCHIA_E_IO || waited_s >= patience_s) return code;
        LOG_WARNING("waiting for the database", "detail=%s", log_quote(&detail, err->message));
        if (sigtimedwait(&ends, NULL, &pause) > 0) return code;
    }
}

static enum ischia_code open_store(struct daemon *d, struct ischia_error *err)
{
    const struct config *config = &d->service.config;
    const struct store_options options = {
        .location = config->store[0] == '\0' ? config->state_dir : config->store,
        .mode = STORE_SERVE,
    };
    return open_patiently(&options, &d->service.store, err);
}

/* The one that was asked for must be good; one that came with the program and does not fit it only
 * means that there are no estimates. */
static enum ischia_code load_emulator(struct daemon *d, struct ischia_error *err)
{
    struct service *s = &d->service;
    struct log_value quoted;
    const char *wish = s->config.emulator;
    if (strcmp(wish, "none") == 0) return ISCHIA_OK;
    if (wish[0] != '\0')
        (void)snprintf(d->emulator, sizeof d->emulator, "%s", wish);
    else if (!estimator_installed(d->emulator))
        d->emulator[0] = '\0';
    if (d->emulator[0] == '\0') return ISCHIA_OK;
    const enum ischia_code code = estimator_create(&s->estimator, d->emulator, err);
    if (code == ISCHIA_OK || wish[0] != '\0') return code;
    LOG_WARNING("no estimates", "detail=%s", log_quote(&quoted, err->message));
    d->emulator[0] = '\0';
    return ISCHIA_OK;
}

static enum ischia_code create_parts(struct daemon *d, struct ischia_error *err)
{
    struct service *s = &d->service;
    TRY(events_create(&s->events, err));
    TRY(auth_create(&s->auth, s->store, err));
    TRY(audit_create(&s->audit, s->store, err));
    TRY(rate_create(&s->rate, err));
    TRY(load_emulator(d, err));
    if (s->config.cds_issuers[0] != '\0') TRY(trust_create(&s->trust, s->config.cds_issuers, err));
    return documents_create(&s->documents, err);
}

/* Open to this machine alone, or closed by tokens and TLS, or behind somebody who sees to that. */
static enum ischia_code check_access(struct daemon *d, struct ischia_error *err)
{
    struct service *s = &d->service;
    TRY(listen_is_loopback(s->config.listen, &s->on_loopback, err));
    if (s->on_loopback || s->config.behind_proxy) return ISCHIA_OK;
    CHECK(uses_tls(&s->config), err, ISCHIA_E_INPUT,
          "%s is not a loopback address and TLS is off: set tls_certificate and tls_key, or give "
          "--behind-proxy when a reverse proxy does TLS and access control",
          s->config.listen);
    CHECK(auth_has_tokens(s->auth), err, ISCHIA_E_INPUT,
          "%s is not a loopback address and there are no tokens: make one with `ischiad token "
          "create`, or give --behind-proxy when a reverse proxy does access control",
          s->config.listen);
    auth_require(s->auth);
    return ISCHIA_OK;
}

/* ------------------------------------------------------------------ what workers tell */

static void on_note(void *context, const struct pool_note *note)
{
    static const enum log_level levels[POOL_NOTE_KIND_COUNT] = {
        [POOL_NOTE_STARTED] = LOG_LEVEL_DEBUG, [POOL_NOTE_READY] = LOG_LEVEL_INFO,
        [POOL_NOTE_ENDED] = LOG_LEVEL_INFO,    [POOL_NOTE_DIED] = LOG_LEVEL_WARNING,
        [POOL_NOTE_FAILED] = LOG_LEVEL_ERROR,
    };
    static const char *const words[POOL_NOTE_KIND_COUNT] = {
        [POOL_NOTE_STARTED] = "worker started",       [POOL_NOTE_READY] = "worker ready",
        [POOL_NOTE_ENDED] = "worker ended",           [POOL_NOTE_DIED] = "worker died",
        [POOL_NOTE_FAILED] = "worker cannot be used",
    };
    struct log_value detail;
    (void)context;
    if (note->kind == POOL_NOTE_STARTED) metrics_count(METRIC_WORKER_STARTS);
    log_event(levels[note->kind], words[note->kind], "worker=%d pid=%d detail=%s", note->worker,
              note->pid, log_quote(&detail, note->detail));
}

static void on_finished(void *context, const struct uuid *id, enum queue_state state,
                        enum pool_end end, int64_t wall_ms, const char *detail)
{
    static const enum metric_outcome outcomes[QUEUE_STATE_COUNT] = {
        [QUEUE_SUCCEEDED] = OUTCOME_SUCCEEDED,
        [QUEUE_FAILED] = OUTCOME_FAILED,
        [QUEUE_CANCELLED] = OUTCOME_CANCELLED,
    };
    char text[UUID_TEXT_BYTES];
    struct log_value quoted;
    const struct daemon *d = context;
    uuid_format(id, text);
    if (queue_is_final(state)) outbound_wake(d->outbound);
    if (queue_is_final(state)) metrics_solve(outcomes[state], (double)wall_ms / 1e3);
    LOG_INFO("assessment ended", "id=%s status=%s end=%s wall_ms=%lld detail=%s", text,
             queue_state_names[state], pool_end_names[end], (long long)wall_ms,
             log_quote(&quoted, detail == NULL ? "" : detail));
}

static void on_point(void *context, enum queue_state state, enum pool_end end, int64_t wall_ms)
{
    (void)context;
    LOG_DEBUG("point of a study ended", "status=%s end=%s wall_ms=%lld", queue_state_names[state],
              pool_end_names[end], (long long)wall_ms);
    if (queue_is_final(state)) metrics_count(METRIC_STUDY_POINTS);
}

static void on_store_error(void *context, const struct ischia_error *err)
{
    struct log_value message;
    (void)context;
    LOG_ERROR("the store refuses", "detail=%s", log_quote(&message, err->message));
}

static enum ischia_code start_queue(struct daemon *d, struct ischia_error *err)
{
    const struct config *config = &d->service.config;
    const bool emulates = d->emulator[0] != '\0';
    const char *const command[] = {d->worker_program, "worker", emulates ? "--emulator" : NULL,
                                   d->emulator, NULL};
    const struct queue_options options = {
        .pool = {.command = command,
                 .solve_workers = config->workers,
                 .memory_max_bytes = (size_t)config->worker_memory_mib << 20,
                 .solve_deadline_ms = config->worker_time_s * 1000},
        .queued_max = config->queue_limit,
        .emulator = emulates ? d->service.estimator->digest : NULL,
    };
    const struct queue_watcher watcher = {d, on_note, on_finished, on_point, on_store_error};
    return queue_create(d->service.store, d->service.events, &options, &watcher, &d->service.queue,
                        err);
}

static int http_thread_count(const struct config *config)
{
    enum { MOST = 8 };
    if (config->http_threads > 0) return config->http_threads;
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    return cores < 1 ? 1 : cores > MOST ? MOST : (int)cores;
}

/* Connections stop where descriptors would end, with some left for store and workers: a listening
 * socket whose connections cannot be taken keeps a thread busy for nothing. */
static enum ischia_code count_connections(const struct config *config, int *ret,
                                          struct ischia_error *err)
{
    enum { RESERVE = 48, PER_WORKER = 4, PER_THREAD = 4, FEWEST = 16 };
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    const int workers = config->workers > 0 ? config->workers : cores < 1 ? 1 : (int)cores;
    const int reserve = RESERVE + PER_WORKER * workers + PER_THREAD * http_thread_count(config);
    struct rlimit limit;
    *ret = config->connections;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY ||
        limit.rlim_cur >= (rlim_t)config->connections + (rlim_t)reserve)
        return ISCHIA_OK;
    CHECK(limit.rlim_cur >= (rlim_t)(reserve + FEWEST), err, ISCHIA_E_LIMIT,
          "only %llu open files are allowed; with %d workers at least %d are needed: raise the "
          "limit (ulimit -n, LimitNOFILE=)",
          (unsigned long long)limit.rlim_cur, workers, reserve + FEWEST);
    *ret = (int)limit.rlim_cur - reserve;
    LOG_WARNING("fewer connections than configured", "connections=%d open_files=%llu", *ret,
                (unsigned long long)limit.rlim_cur);
    return ISCHIA_OK;
}

static int smaller(int a, int b) { return a < b ? a : b; }

static enum ischia_code start_http(struct daemon *d, struct ischia_error *err)
{
    const struct config *config = &d->service.config;
    int connections;
    TRY(count_connections(config, &connections, err));
    const struct http_options options = {
        .listen = config->listen,
        .threads = http_thread_count(config),
        .connections = connections,
        .connections_per_address = smaller(config->connections_per_address, connections),
        .idle_timeout_s = config->idle_timeout_s,
        .request_timeout_s = config->request_timeout_s,
        .tls = uses_tls(config),
    };
    const struct http_app app = service_app(&d->service);
    return http_start(&d->service.http, &options, &app, err);
}

/* HL7 v2 says nothing about who may send: beyond this machine a certificate has to. */
static enum ischia_code check_hl7_access(const struct config *config, struct ischia_error *err)
{
    bool loopback = false;
    if (config->hl7_listen[0] == '\0') return ISCHIA_OK;
    TRY(listen_is_loopback(config->hl7_listen, &loopback, err));
    CHECK(
        loopback || config->behind_proxy || (config->hl7_tls && config->hl7_client_ca[0] != '\0'),
        err, ISCHIA_E_INPUT,
        "%s is not a loopback address: set hl7_tls and hl7_client_ca, or give --behind-proxy when "
        "something else does access control",
        config->hl7_listen);
    return ISCHIA_OK;
}

static enum ischia_code load_hl7_tls(struct daemon *d, struct ischia_error *err)
{
    const struct config *config = &d->service.config;
    char *certificate = NULL, *key = NULL, *ca = NULL;
    if (!config->hl7_tls) return ISCHIA_OK;
    enum ischia_code code = textfile_read(config->tls_certificate, &certificate, err);
    if (code == ISCHIA_OK) code = textfile_read(config->tls_key, &key, err);
    if (code == ISCHIA_OK && config->hl7_client_ca[0] != '\0')
        code = textfile_read(config->hl7_client_ca, &ca, err);
    if (code == ISCHIA_OK) code = link_tls_create(&d->hl7_tls, certificate, key, ca, err);
    free(certificate);
    free(key);
    free(ca);
    return code;
}

static enum ischia_code start_hl7(struct daemon *d, struct ischia_error *err)
{
    const struct config *config = &d->service.config;
    if (config->hl7_listen[0] == '\0') return ISCHIA_OK;
    TRY(check_hl7_access(config, err));
    TRY(load_hl7_tls(d, err));
    const struct listener_options options = {.listen = config->hl7_listen,
                                             .application = config->hl7_application,
                                             .facility = config->hl7_facility,
                                             .tls = d->hl7_tls,
                                             .queue = d->service.queue,
                                             .audit = d->service.audit};
    return listener_start(&d->hl7, &options, err);
}

/* ------------------------------------------------------------------------------ loop */

static void announce(const struct daemon *d)
{
    const char *scheme = uses_tls(&d->service.config) ? "https" : "http";
    (void)printf("listening on %s://%s\n", scheme, http_address(d->service.http));
    (void)fflush(stdout);
    LOG_INFO("listening", "address=%s://%s version=%s", scheme, http_address(d->service.http),
             ISCHIA_VERSION);
    if (d->hl7 != NULL)
        LOG_INFO("listening", "address=mllp://%s tls=%d", listener_address(d->hl7),
                 d->hl7_tls != NULL);
    (void)notify_manager("READY=1");
}

static void reload(struct daemon *d)
{
    struct config fresh;
    struct ischia_error err;
    char names[512];
    struct log_value quoted;
    (void)notify_reloading();
    if (load_config(&fresh, d->arguments, &err) != ISCHIA_OK) {
        LOG_ERROR("options not reloaded", "detail=%s", log_quote(&quoted, err.message));
    } else {
        const size_t others = config_reload(&d->service.config, &fresh, names, sizeof names);
        service_apply(&d->service);
        if (load_tls(&d->service.config, &err) != ISCHIA_OK)
            LOG_ERROR("certificate not reloaded; the old one stays", "detail=%s",
                      log_quote(&quoted, err.message));
        d->retire_at_ms = 0;
        LOG_INFO("options reloaded", "need_restart=%s",
                 log_quote(&quoted, others == 0 ? "" : names));
    }
    (void)notify_manager("READY=1");
}

/* Erases what the retention rule no longer keeps, a batch at a time so that nobody waits long. */
static void retire(struct daemon *d)
{
    bool study = false;
    const struct config *config = &d->service.config;
    const struct store_retention rule = {
        .age_max_ms = (int64_t)config->retention_days * 24 * 3600 * 1000,
        .count_max = config->retention_count,
    };
    struct ischia_error err;
    int erased = 0;
    if (store_retire(d->service.store, &rule, RETIRE_BATCH, &erased, &err) != ISCHIA_OK)
        on_store_error(d, &err);
    if (store_study_retire(d->service.store, rule.age_max_ms, &study, &err) != ISCHIA_OK)
        on_store_error(d, &err);
    if (erased > 0 || study) LOG_INFO("retention", "erased=%d studies=%d", erased, study);
    d->retire_at_ms =
        http_now_ms() + (erased == RETIRE_BATCH || study ? TICK_MS : RETIRE_EVERY_S * 1000);
}

static void tick(struct daemon *d)
{
    const int64_t now_ms = http_now_ms();
    const int watchdog_ms = notify_watchdog_ms();
    events_sweep(d->service.events, SWEEP_AGE_MS, EVENTS_SILENT_MS);
    if (watchdog_ms > 0 && now_ms >= d->watchdog_at_ms) {
        (void)notify_manager("WATCHDOG=1");
        d->watchdog_at_ms = now_ms + watchdog_ms;
    }
    if (now_ms >= d->retire_at_ms) retire(d);
}

/* Waits at most a tick for a signal of `set`; 0: none came. */
static int next_signal(const sigset_t *set)
{
    const struct timespec wait = {.tv_sec = TICK_MS / 1000, .tv_nsec = 0};
    const int signal = sigtimedwait(set, NULL, &wait);
    return signal < 0 ? 0 : signal;
}

static void run(struct daemon *d, const sigset_t *signals)
{
    for (;;) {
        const int signal = next_signal(signals);
        if (signal == SIGTERM || signal == SIGINT) {
            LOG_INFO("stopping", "signal=%d", signal);
            return;
        }
        if (signal == SIGHUP) reload(d);
        tick(d);
    }
}

/* Takes nothing new, and gives running solves their time; a second signal ends that. */
static void drain(struct daemon *d, const sigset_t *signals)
{
    const int64_t until_ms = http_now_ms() + (int64_t)d->service.config.drain_timeout_s * 1000;
    struct pool_stats stats;
    (void)notify_manager("STOPPING=1");
    atomic_store(&d->service.draining, true);
    queue_drain(d->service.queue);
    for (;;) {
        const struct timespec wait = {.tv_sec = 0, .tv_nsec = 50 * 1000 * 1000};
        pool_stats(queue_pool(d->service.queue), &stats);
        if (stats.busy == 0 || http_now_ms() >= until_ms) return;
        const int signal = sigtimedwait(signals, NULL, &wait);
        if (signal == SIGTERM || signal == SIGINT) return;
    }
}

static enum ischia_code start(struct daemon *d, struct ischia_error *err)
{
    raise_descriptor_limit();
    find_worker(d);
    TRY(load_tls(&d->service.config, err));
    TRY(enter_state_dir(d, err));
    TRY(open_store(d, err));
    TRY(create_parts(d, err));
    service_apply(&d->service);
    TRY(check_access(d, err));
    TRY(outbound_create(&d->outbound, &d->service.config, d->service.store, err));
    TRY(start_queue(d, err));
    TRY(start_hl7(d, err));
    return start_http(d, err);
}

/* The mirror of start; every part may be missing. Requests end first, then solves, then the store,
 * whose thread may still be about to wake a request: their memory goes last. */
static void finish(struct daemon *d)
{
    struct service *s = &d->service;
    http_stop(s->http);
    listener_stop(d->hl7);
    queue_destroy(s->queue, 0);
    outbound_destroy(d->outbound);
    store_close(s->store);
    http_destroy(s->http);
    events_destroy(s->events);
    documents_destroy(s->documents);
    trust_destroy(s->trust);
    estimator_destroy(s->estimator);
    rate_destroy(s->rate);
    audit_destroy(s->audit);
    auth_destroy(s->auth);
    link_tls_destroy(d->hl7_tls);
    tls_clear();
}

static int complain(const struct ischia_error *err)
{
    (void)fprintf(stderr, "ischiad: %s\n", err->message);
    return err->code == ISCHIA_E_INPUT ? EXIT_USAGE : EXIT_FAILURE;
}

static int serve(const struct config *config, struct arguments *arguments)
{
    struct daemon *d = calloc(1, sizeof *d);
    struct ischia_error err = {.code = ISCHIA_E_MEMORY, .message = "no memory to start"};
    sigset_t signals;
    if (d == NULL) return complain(&err);
    d->arguments = arguments;
    d->service.config = *config;
    /* Blocked in every thread from the start: run and drain ask for them. */
    (void)sigemptyset(&signals);
    (void)sigaddset(&signals, SIGTERM);
    (void)sigaddset(&signals, SIGINT);
    (void)sigaddset(&signals, SIGHUP);
    (void)pthread_sigmask(SIG_BLOCK, &signals, NULL);
    (void)signal(SIGPIPE, SIG_IGN);
    const enum ischia_code code = start(d, &err);
    if (code == ISCHIA_OK) {
        announce(d);
        run(d, &signals);
        drain(d, &signals);
    }
    finish(d);
    LOG_INFO("stopped", "");
    log_finish();
    free(d);
    return code == ISCHIA_OK ? EXIT_SUCCESS : complain(&err);
}

/* ------------------------------------------------------------------------------ main */

static int print_help(void)
{
    (void)printf("Usage: ischiad [OPTIONS]            serves until SIGTERM\n"
                 "       ischiad [OPTIONS] COMMAND    administers the store\n\n"
                 "Commands:\n%s\nOptions (also NAME = VALUE in the file, ISCHIA_NAME in the "
                 "environment):\n  --config FILE\n      Reads options from a file.\n",
                 admin_help);
    config_print_help(stdout);
    (void)printf("  --check-config, --print-config, --print-man, --print-routes, --help, "
                 "--version\n");
    return EXIT_SUCCESS;
}

/* What options name has to be there. A worker program without a slash is looked for on the path. */
static enum ischia_code check_files(const struct config *config, struct ischia_error *err)
{
    struct stat status;
    struct estimator *estimator = NULL;
    const char *worker = config->worker_program, *emulator = config->emulator;
    CHECK(stat(config->state_dir, &status) != 0 || S_ISDIR(status.st_mode), err, ISCHIA_E_INPUT,
          "state_dir: %s is not a directory", config->state_dir);
    CHECK(strchr(worker, '/') == NULL || access(worker, X_OK) == 0, err, ISCHIA_E_INPUT,
          "worker_program: cannot run %s: %s", worker, strerror(errno));
    if (emulator[0] == '\0' || strcmp(emulator, "none") == 0) return ISCHIA_OK;
    TRY(estimator_create(&estimator, emulator, err));
    estimator_destroy(estimator);
    return ISCHIA_OK;
}

/* What can be said about the options without starting. */
static int check(const struct config *config)
{
    struct ischia_error err;
    bool loopback = false;
    enum ischia_code code = load_tls(config, &err);
    tls_clear();
    if (code == ISCHIA_OK) code = listen_is_loopback(config->listen, &loopback, &err);
    if (code == ISCHIA_OK && !loopback && !config->behind_proxy && !uses_tls(config))
        code = FAIL(&err, ISCHIA_E_INPUT,
                    "%s is not a loopback address: set tls_certificate and tls_key, or "
                    "behind_proxy",
                    config->listen);
    if (code == ISCHIA_OK) code = check_hl7_access(config, &err);
    if (code == ISCHIA_OK) code = check_files(config, &err);
    if (code != ISCHIA_OK) return complain(&err);
    (void)printf("The options are good.\n");
    return EXIT_SUCCESS;
}

static int act(const struct config *config, struct arguments *arguments)
{
    const enum action action = arguments->action;
    if (action != ACT_SERVE && action != ACT_HELP && arguments->word_count > 0) {
        (void)fprintf(stderr, "ischiad: '%.80s' does not belong there; see ischiad --help\n",
                      arguments->words[0]);
        return EXIT_USAGE;
    }
    switch (action) {
    case ACT_CHECK:
        return check(config);
    case ACT_PRINT:
        config_print(config, stdout);
        return EXIT_SUCCESS;
    case ACT_MAN:
        config_print_man(stdout);
        return EXIT_SUCCESS;
    case ACT_ROUTES:
        routes_print(stdout);
        return EXIT_SUCCESS;
    case ACT_HELP:
        return print_help();
    case ACT_VERSION:
        (void)printf("ischiad %s\n", ISCHIA_VERSION);
        return EXIT_SUCCESS;
    case ACT_SERVE:
        break;
    }
    if (arguments->word_count > 0)
        return admin_run(config, arguments->words, arguments->word_count);
    return serve(config, arguments);
}

int main(int argc, char **argv)
{
    struct arguments arguments = {.action = ACT_SERVE};
    struct config config;
    struct ischia_error err;
    standard_streams_hold();
    log_init(LOG_LEVEL_INFO);
    enum ischia_code code = parse_arguments(&arguments, argc, argv, &err);
    if (code == ISCHIA_OK) code = load_config(&config, &arguments, &err);
    int status = code == ISCHIA_OK ? act(&config, &arguments) : complain(&err);
    free(arguments.flags);
    if (status == EXIT_SUCCESS && standard_output_flush(&err) != ISCHIA_OK) status = complain(&err);
    return status;
}
