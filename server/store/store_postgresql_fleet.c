/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One daemon among many.
 *
 * Each daemon has a row in the table of the living, and says every second, by the server's clock,
 * that it lives. Whoever finds a row that is older than a lease removes it and puts what its daemon
 * ran back into the queue; work that belongs to no row (a claim whose daemon died in the commit)
 * goes back as well. A daemon that finds its own row gone, after a pause or a cut cable, enters
 * itself anew and stops what it ran: the store refuses what would come of it, because the number of
 * the owner is part of what must match (SQL_STATE, SQL_STUDY_POINT_GET).
 *
 * What the others did is read from the change log; notifications only say that it is worth looking
 * now. One that is lost costs a second, never a change.
 */
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include "server/store/store_postgresql.h"

enum { CHANGES_PAGE = 500, TOLD_MAX = 64, TELL_MS = 250, HOST_BYTES = 65 };

#define LEASE "interval '5 s'" /* STORE_LEASE_MS */
_Static_assert(STORE_LEASE_MS == 5000, "LEASE says the same");

/* A server that has just started gives everybody the time to come back. */
#define DEAD                                                                                       \
    "beat_at < clock_timestamp() - " LEASE                                                         \
    " AND pg_postmaster_start_time() < clock_timestamp() - " LEASE

struct told { /* progress on its way to the others */
    struct uuid id;
    struct store_progress progress;
};

struct fleet {
    struct store *store;
    struct pg_place *place;
    struct db *db;           /* the thread's alone, as what follows */
    int64_t seen_seq;        /* of the change log; < 0: not yet known */
    int64_t beaten_since_ms; /* no beat has failed since; monotonic; 0: the last one did */
    int64_t next_beat_ms, next_tell_ms;
    pthread_t thread;
    bool runs;
    int wake_fd;
    atomic_bool stopping;
    atomic_bool recovering; /* a write of ours is on its way */
    pthread_mutex_t lock;   /* guards the next two; held while the watcher is told */
    bool watched;
    struct store_watcher watcher;
    pthread_mutex_t told_lock; /* guards the rest; never held while the server is asked */
    struct told told[TOLD_MAX];
    int told_count;
};

static int64_t monotonic_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* ------------------------------------------------------------------------- among the living */

static enum ischia_code enter(struct fleet *fleet, struct ischia_error *err)
{
    char host[HOST_BYTES] = "";
    struct query query;
    int64_t number = 0;
    (void)gethostname(host, sizeof host - 1);
    query_begin_text(&query, fleet->db, "INSERT INTO daemon (host) VALUES (?) RETURNING id");
    query_put_text(&query, host);
    TRY(query_number(&query, 0, &number, err));
    atomic_store(&fleet->place->daemon, number);
    return ISCHIA_OK;
}

static void leave(struct fleet *fleet)
{
    struct query query;
    query_begin_text(&query, fleet->db, "DELETE FROM daemon WHERE id = ?");
    query_put_integer(&query, atomic_load(&fleet->place->daemon));
    (void)!query_run(&query, NULL); /* else the lease runs out */
}

static void lose_lease(struct fleet *fleet)
{
    (void)pthread_mutex_lock(&fleet->lock);
    if (fleet->watched && fleet->watcher.on_lease_lost != NULL)
        fleet->watcher.on_lease_lost(fleet->watcher.context);
    (void)pthread_mutex_unlock(&fleet->lock);
}

static enum ischia_code beat(struct fleet *fleet, struct ischia_error *err)
{
    struct query query;
    int64_t number = 0;
    query_begin_text(&query, fleet->db,
                     "UPDATE daemon SET beat_at = clock_timestamp() WHERE id = ? RETURNING id");
    query_put_integer(&query, atomic_load(&fleet->place->daemon));
    TRY(query_number(&query, 0, &number, err));
    if (number != 0) return ISCHIA_OK;
    TRY(enter(fleet, err));
    lose_lease(fleet);
    return ISCHIA_OK;
}

/* ---------------------------------------------------------------------- what the dead held */

struct recovery {
    struct write write;
    struct fleet *fleet;
    int requeued;
};

static enum ischia_code recovery_run(struct store *store, struct db *db, void *operation,
                                     struct ischia_error *err)
{
    struct recovery *recovery = operation;
    struct query query;
    query_begin_text(&query, db, "DELETE FROM daemon WHERE " DEAD);
    TRY(query_run(&query, err));
    return recover_run(store, db, &recovery->requeued, err);
}

static void recovery_done(struct store *store, struct write *write)
{
    struct recovery *recovery = write->operation;
    struct fleet *fleet = recovery->fleet;
    (void)store;
    atomic_store(&fleet->recovering, false);
    free(recovery);
}

/* Not while one before is on its way: its answer may take as long as the lock of the writers. */
static enum ischia_code recover(struct fleet *fleet, struct ischia_error *err)
{
    if (atomic_exchange(&fleet->recovering, true)) return ISCHIA_OK;
    struct recovery *recovery = calloc(1, sizeof *recovery);
    enum ischia_code code = ISCHIA_E_MEMORY;
    if (recovery != NULL) {
        recovery->fleet = fleet;
        recovery->write =
            (struct write){.run = recovery_run, .operation = recovery, .done = recovery_done};
        code = write_later(fleet->store, &recovery->write, err);
    }
    if (code == ISCHIA_OK) return ISCHIA_OK;
    atomic_store(&fleet->recovering, false);
    free(recovery);
    return code;
}

/* Who could not beat itself must not judge: perhaps the server was away for everybody. */
static bool may_judge(const struct fleet *fleet)
{
    return fleet->beaten_since_ms != 0 &&
           monotonic_ms() - fleet->beaten_since_ms >= STORE_LEASE_MS + STORE_BEAT_MS;
}

static enum ischia_code look_for_the_dead(struct fleet *fleet, struct ischia_error *err)
{
    int64_t found = 0;
    TRY(db_number(fleet->db,
                  "SELECT (SELECT count(*) FROM daemon WHERE " DEAD ") + "
                  "(SELECT count(*) FROM assessment WHERE state = 1 AND "
                  "owner NOT IN (SELECT id FROM daemon)) + "
                  "(SELECT count(*) FROM study_point WHERE state = 1 AND "
                  "owner NOT IN (SELECT id FROM daemon))",
                  &found, err));
    return found > 0 && may_judge(fleet) ? recover(fleet, err) : ISCHIA_OK;
}

/* ------------------------------------------------------------------------ what others did */

static enum ischia_code find_end(struct fleet *fleet, struct ischia_error *err)
{
    if (fleet->seen_seq >= 0) return ISCHIA_OK;
    struct query query;
    query_begin(&query, fleet->db, SQL_CHANGES_LAST);
    return query_number(&query, 0, &fleet->seen_seq, err);
}

static enum ischia_code show_change(struct fleet *fleet, struct query *query,
                                    struct ischia_error *err)
{
    struct store_change change = {.seq = query_integer(query, 0),
                                  .kind = (enum store_change_kind)query_integer(query, 1),
                                  .at_ms = query_integer(query, 3)};
    const bool own = query_integer(query, 4) == atomic_load(&fleet->place->daemon);
    TRY(query_blob(query, 2, change.id.byte, UUID_BYTES, err));
    fleet->seen_seq = change.seq;
    if (!own && fleet->watcher.on_change != NULL)
        fleet->watcher.on_change(fleet->watcher.context, &change);
    return ISCHIA_OK;
}

/* One page; *ret_count: how many it had. */
static enum ischia_code read_page(struct fleet *fleet, int *ret_count, struct ischia_error *err)
{
    struct query query;
    query_begin_text(&query, fleet->db,
                     "SELECT seq, kind, id, at_ms, daemon FROM change WHERE seq > ? "
                     "ORDER BY seq LIMIT ?");
    query_put_integer(&query, fleet->seen_seq);
    query_put_integer(&query, CHANGES_PAGE);
    enum ischia_code code;
    bool row = true;
    for (*ret_count = 0;; ++*ret_count) {
        code = query_step(&query, &row, err);
        if (code == ISCHIA_OK && row) code = show_change(fleet, &query, err);
        if (code != ISCHIA_OK || !row) break;
    }
    query_end(&query);
    return code;
}

/* With the lock. */
static enum ischia_code read_changes(struct fleet *fleet, struct ischia_error *err)
{
    TRY(find_end(fleet, err));
    for (int count = CHANGES_PAGE; count == CHANGES_PAGE;) TRY(read_page(fleet, &count, err));
    return ISCHIA_OK;
}

/* "DAEMON ID FRACTION STEP ITERATION FORCE MESSAGE", as tell_one writes it. */
static bool read_progress(const char *text, int64_t *ret_daemon, struct uuid *ret_id,
                          struct store_progress *ret)
{
    char *end = NULL, id[UUID_TEXT_BYTES];
    *ret_daemon = strtoll(text, &end, 10);
    if (*end != ' ' || strlen(end + 1) < UUID_TEXT_BYTES) return false;
    (void)snprintf(id, sizeof id, "%.*s", UUID_TEXT_BYTES - 1, end + 1);
    if (!uuid_parse(id, ret_id)) return false;
    ret->fraction = strtod(end + UUID_TEXT_BYTES, &end);
    ret->load_step = (int)strtol(end, &end, 10);
    ret->newton_iteration = (int)strtol(end, &end, 10);
    ret->F_N = strtod(end, &end);
    (void)snprintf(ret->message, sizeof ret->message, "%s", *end == ' ' ? end + 1 : end);
    return true;
}

static void hear_progress(struct fleet *fleet, const char *text)
{
    struct uuid id;
    struct store_progress progress = {0};
    int64_t daemon = 0;
    if (fleet->watcher.on_progress != NULL && read_progress(text, &daemon, &id, &progress) &&
        daemon != atomic_load(&fleet->place->daemon))
        fleet->watcher.on_progress(fleet->watcher.context, &id, &progress);
}

static void hear_study(struct fleet *fleet, const char *hexadecimal)
{
    struct uuid id;
    char text[UUID_TEXT_BYTES];
    const struct store_watcher *watcher = &fleet->watcher;
    if (hexadecimal[0] == '\0') {
        if (watcher->on_work != NULL) watcher->on_work(watcher->context);
        return;
    }
    if (strlen(hexadecimal) != 2 * UUID_BYTES || watcher->on_study_cancelled == NULL) return;
    (void)snprintf(text, sizeof text, "%.8s-%.4s-%.4s-%.4s-%.12s", hexadecimal, hexadecimal + 8,
                   hexadecimal + 12, hexadecimal + 16, hexadecimal + 20);
    if (uuid_parse(text, &id)) watcher->on_study_cancelled(watcher->context, &id);
}

static void hear_nothing(struct fleet *fleet, const char *payload)
{
    (void)fleet, (void)payload; /* the change log is read anyway */
}

static const struct {
    const char *channel;
    void (*hear)(struct fleet *fleet, const char *payload);
} channels[] = {
    {"ischia_change", hear_nothing},
    {"ischia_study", hear_study},
    {"ischia_progress", hear_progress},
};
enum { CHANNEL_COUNT = sizeof channels / sizeof channels[0] };

static enum ischia_code listen(struct fleet *fleet, struct ischia_error *err)
{
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        char text[64];
        (void)snprintf(text, sizeof text, "LISTEN %s", channels[i].channel);
        TRY(pg_execute(fleet->db, text, NULL, err));
    }
    return ISCHIA_OK;
}

/* With the lock. */
static void hear_all(struct fleet *fleet)
{
    PGconn *connection = pg_connection(fleet->db);
    if (connection == NULL || PQconsumeInput(connection) == 0) return;
    for (PGnotify *note; (note = PQnotifies(connection)) != NULL; PQfreemem(note))
        for (int i = 0; i < CHANNEL_COUNT; i++)
            if (strcmp(note->relname, channels[i].channel) == 0)
                channels[i].hear(fleet, note->extra);
}

static enum ischia_code hear_others(struct fleet *fleet, struct ischia_error *err)
{
    enum ischia_code code = ISCHIA_OK;
    (void)pthread_mutex_lock(&fleet->lock);
    if (fleet->watched) {
        hear_all(fleet);
        code = read_changes(fleet, err);
    }
    (void)pthread_mutex_unlock(&fleet->lock);
    return code;
}

/* ------------------------------------------------------------------------------- progress */

static enum ischia_code tell_one(struct fleet *fleet, const struct told *told,
                                 struct ischia_error *err)
{
    char id[UUID_TEXT_BYTES], text[320];
    const struct store_progress *p = &told->progress;
    struct query query;
    uuid_format(&told->id, id);
    (void)snprintf(text, sizeof text, "%lld %s %.6g %d %d %.9g %s",
                   (long long)atomic_load(&fleet->place->daemon), id, p->fraction, p->load_step,
                   p->newton_iteration, p->F_N, p->message);
    query_begin_text(&query, fleet->db, "SELECT pg_notify('ischia_progress', CAST(? AS TEXT))");
    query_put_text(&query, text);
    return query_run(&query, err);
}

static enum ischia_code tell_all(struct fleet *fleet, struct ischia_error *err)
{
    struct told told[TOLD_MAX];
    (void)pthread_mutex_lock(&fleet->told_lock);
    const int count = fleet->told_count;
    memcpy(told, fleet->told, (size_t)count * sizeof told[0]);
    fleet->told_count = 0;
    (void)pthread_mutex_unlock(&fleet->told_lock);
    for (int i = 0; i < count; i++) TRY(tell_one(fleet, &told[i], err));
    return ISCHIA_OK;
}

/* The latest of each id; when there are too many, the rest is left out. */
void fleet_tell_progress(struct store *store, const struct uuid *id,
                         const struct store_progress *progress)
{
    struct fleet *fleet = ((struct pg_place *)store->place)->fleet;
    int i = 0;
    if (fleet == NULL) return;
    (void)pthread_mutex_lock(&fleet->told_lock);
    while (i < fleet->told_count && !uuid_equal(&fleet->told[i].id, id)) i++;
    if (i < TOLD_MAX) fleet->told[i] = (struct told){*id, *progress};
    if (i == fleet->told_count && i < TOLD_MAX) fleet->told_count++;
    (void)pthread_mutex_unlock(&fleet->told_lock);
}

/* ----------------------------------------------------------------------------- the thread */

static enum ischia_code live(struct fleet *fleet, struct ischia_error *err)
{
    bool fresh = false;
    const int64_t now_ms = monotonic_ms();
    TRY(pg_ensure(fleet->db, &fresh, err));
    if (fresh) TRY(listen(fleet, err));
    if (now_ms >= fleet->next_beat_ms) {
        TRY(beat(fleet, err));
        fleet->next_beat_ms = now_ms + STORE_BEAT_MS;
        if (fleet->beaten_since_ms == 0) fleet->beaten_since_ms = now_ms;
        TRY(look_for_the_dead(fleet, err));
    }
    TRY(hear_others(fleet, err));
    if (now_ms < fleet->next_tell_ms) return ISCHIA_OK;
    fleet->next_tell_ms = now_ms + TELL_MS;
    return tell_all(fleet, err);
}

static void rest(struct fleet *fleet)
{
    PGconn *connection = pg_connection(fleet->db);
    struct pollfd ready[] = {
        {.fd = fleet->wake_fd, .events = POLLIN},
        {.fd = connection == NULL ? -1 : PQsocket(connection), .events = POLLIN},
    };
    (void)poll(ready, 2, TELL_MS);
}

static void *fleet_main(void *argument)
{
    struct fleet *fleet = argument;
    int failures = 0; /* in a row */
    sigset_t all;     /* signals are the main thread's */
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_BLOCK, &all, NULL);
    while (!atomic_load(&fleet->stopping)) {
        failures = live(fleet, NULL) == ISCHIA_OK ? 0 : failures + 1;
        if (failures > 0) fleet->beaten_since_ms = 0;
        /* one may be a connection that was lost: it comes back with the next attempt, or not */
        atomic_store(&fleet->place->is_down, failures > 1 && pg_is_lost(fleet->db));
        if (failures != 1) rest(fleet);
    }
    return NULL;
}

void fleet_watch(struct store *store, const struct store_watcher *watcher)
{
    struct fleet *fleet = ((struct pg_place *)store->place)->fleet;
    if (fleet == NULL) return;
    (void)pthread_mutex_lock(&fleet->lock);
    fleet->watched = watcher != NULL;
    if (watcher != NULL) fleet->watcher = *watcher;
    (void)pthread_mutex_unlock(&fleet->lock);
}

static void destroy(struct fleet *fleet)
{
    pg_close(fleet->db);
    if (fleet->wake_fd >= 0) (void)close(fleet->wake_fd);
    (void)pthread_mutex_destroy(&fleet->told_lock);
    (void)pthread_mutex_destroy(&fleet->lock);
    free(fleet);
}

static enum ischia_code start_thread(struct fleet *fleet, struct ischia_error *err)
{
    TRY(pg_open(fleet->place, PG_BEAT, &fleet->db, err));
    TRY(enter(fleet, err));
    CHECK(fleet->wake_fd >= 0, err, ISCHIA_E_IO, "no descriptor for the store's thread");
    const int failed = pthread_create(&fleet->thread, NULL, fleet_main, fleet);
    CHECK(failed == 0, err, ISCHIA_E_MEMORY, "the store's thread cannot start: %s",
          strerror(failed));
    fleet->runs = true;
    return ISCHIA_OK;
}

enum ischia_code fleet_start(struct store *store, struct ischia_error *err)
{
    struct fleet *fleet = calloc(1, sizeof *fleet);
    CHECK(fleet != NULL, err, ISCHIA_E_MEMORY, "no memory for the store's thread");
    fleet->store = store;
    fleet->place = store->place;
    fleet->seen_seq = -1;
    fleet->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    (void)pthread_mutex_init(&fleet->lock, NULL);
    (void)pthread_mutex_init(&fleet->told_lock, NULL);
    fleet->place->fleet = fleet;
    return start_thread(fleet, err);
}

/* The writer has stopped: no recovery is on its way any more. */
void fleet_stop(struct fleet *fleet)
{
    const uint64_t one = 1;
    if (fleet == NULL) return;
    atomic_store(&fleet->stopping, true);
    if (fleet->runs) {
        (void)!write(fleet->wake_fd, &one, sizeof one);
        (void)pthread_join(fleet->thread, NULL);
        leave(fleet);
    }
    destroy(fleet);
}
