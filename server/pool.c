/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * One thread, one epoll: the sockets and pidfds of the workers, and an eventfd by which other
 * threads ask for something. A slot goes round down -> starting -> idle <-> busy -> dying -> down;
 * a killed worker's job ends only when the process is reaped, so that "cancelled" means stopped.
 */
#include "server/pool.h"

#include <assert.h>
#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "server/pool_worker.h"

struct cancel {
    bool all;
    struct uuid id;
    struct cancel *next;
};

struct pool {
    struct pool_options options;
    char **command; /* one block with its strings */
    struct pool_host host;
    struct worker *worker; /* [solve_workers + render_workers] */
    int worker_count;
    int epoll_fd, event_fd;
    pthread_t thread;

    pthread_mutex_t lock; /* guards what follows; never held while the host is called */
    bool wanted;          /* there may be a job */
    bool draining, stopping;
    int64_t stop_at_ms; /* when stopping: running jobs are taken back then */
    struct cancel *cancels;
    struct render *renders, **last_render;
    int renders_waiting;
    struct pool_stats stats;

    bool may_have_job; /* the thread's own: ask the host when a worker is idle */
    bool may_press;    /* likewise: ask the host whether a job that yields must go */
    int64_t next_tick_ms;
};

enum { SOURCE_EVENT, SOURCE_SOCKET, SOURCE_PROCESS, SOURCE_COUNT };

/* --------------------------------------------------------------------------------- notes */

static void count(struct pool *pool, uint64_t *counter)
{
    (void)pthread_mutex_lock(&pool->lock);
    ++*counter;
    (void)pthread_mutex_unlock(&pool->lock);
}

static void note(struct pool *pool, enum pool_note_kind kind, const struct worker *worker, int pid,
                 const char *detail)
{
    if (pool->host.on_note == NULL) return;
    const struct pool_note note = {
        .kind = kind, .worker = worker->slot, .pid = pid, .detail = detail};
    pool->host.on_note(pool->host.context, &note);
}

/* -------------------------------------------------------------------------- ends of jobs */

static void end_solve(struct pool *pool, struct worker *worker, struct pool_outcome *outcome)
{
    outcome->wall_ms = worker_now_ms() - worker->begun_ms;
    struct pool_job job = worker->job;
    worker->has_job = false;
    worker->job = (struct pool_job){0};
    pool->host.on_outcome(pool->host.context, &job, outcome);
    free(job.case_json);
}

static void end_render(struct pool *pool, struct render *render, enum ischia_code code,
                       const struct frame *drawing, const char *reason)
{
    struct ischia_error err = {0};
    if (code != ISCHIA_OK) (void)FAIL(&err, code, "%s", reason);
    count(pool, code == ISCHIA_OK ? &pool->stats.renders : &pool->stats.renders_failed);
    render->done(render->context, code,
                 drawing != NULL ? (const unsigned char *)drawing->bytes : NULL,
                 drawing != NULL ? drawing->size : 0, &err);
    render_destroy(render);
}

static void become_idle(struct worker *worker)
{
    worker->state = WORKER_IDLE;
    worker->deadline_ms = 0;
    worker->idle_since_ms = worker_now_ms();
    free(worker->result);
    worker->result = NULL;
}

static void kill_worker(struct worker *worker, enum worker_killed why, const char *words)
{
    if (worker->state == WORKER_DOWN || worker->state == WORKER_DYING) return;
    worker->killed = why;
    worker->state = WORKER_DYING;
    worker->deadline_ms = 0;
    (void)snprintf(worker->why, sizeof worker->why, "%.*s", (int)sizeof worker->why - 1, words);
    spawn_kill(&worker->process);
}

/* How a job ends whose worker is gone, by the reason of its death. */
static const enum pool_end end_of[] = {
    [KILLED_NOT] = POOL_CRASHED,       [KILLED_CANCEL] = POOL_CANCELLED,
    [KILLED_DEADLINE] = POOL_DEADLINE, [KILLED_PROTOCOL] = POOL_CRASHED,
    [KILLED_DRAIN] = POOL_DRAINED,     [KILLED_IDLE] = POOL_CRASHED,
    [KILLED_YIELD] = POOL_YIELDED,     [KILLED_VERSION] = POOL_CRASHED,
};

static void end_job_of_dead(struct pool *pool, struct worker *worker, const char *words)
{
    if (worker->has_job) {
        struct pool_outcome outcome = {.end = end_of[worker->killed], .detail = words};
        end_solve(pool, worker, &outcome);
    }
    if (worker->render == NULL) return;
    struct render *render = worker->render;
    worker->render = NULL;
    static const enum ischia_code code_of[] = {
        [KILLED_NOT] = ISCHIA_E_IO,         [KILLED_CANCEL] = ISCHIA_E_IO,
        [KILLED_DEADLINE] = ISCHIA_E_LIMIT, [KILLED_PROTOCOL] = ISCHIA_E_IO,
        [KILLED_DRAIN] = ISCHIA_E_STATE,    [KILLED_IDLE] = ISCHIA_E_IO,
        [KILLED_YIELD] = ISCHIA_E_IO,       [KILLED_VERSION] = ISCHIA_E_IO};
    end_render(pool, render, code_of[worker->killed], NULL, words);
}

/* --------------------------------------------------------------------- starting, reaping */

static bool watch(struct pool *pool, int fd, int slot, int source, uint32_t events, int operation)
{
    struct epoll_event event = {.events = events,
                                .data.u64 = (uint64_t)slot * SOURCE_COUNT + (uint64_t)source};
    return epoll_ctl(pool->epoll_fd, operation, fd, &event) == 0;
}

/* The pause before the next start grows while workers die without having done anything. */
static void start_later(struct pool *pool, struct worker *worker)
{
    const int least = pool->options.backoff_min_ms, most = pool->options.backoff_max_ms;
    worker->start_at_ms = worker_now_ms() + worker->backoff_ms;
    worker->backoff_ms = worker->backoff_ms < least ? least : worker->backoff_ms * 2;
    if (worker->backoff_ms > most) worker->backoff_ms = most;
}

static void start_worker(struct pool *pool, struct worker *worker)
{
    struct ischia_error err = {0};
    const enum ischia_code code = spawn_worker(
        (const char *const *)pool->command, pool->options.memory_max_bytes, &worker->process, &err);
    if (code != ISCHIA_OK) {
        note(pool, POOL_NOTE_FAILED, worker, 0, err.message);
        if (worker->backoff_ms == 0) worker->backoff_ms = pool->options.backoff_min_ms;
        start_later(pool, worker);
        return;
    }
    frame_reader_init(&worker->reader, &pool->options.limits);
    worker->killed = KILLED_NOT;
    worker->state = WORKER_STARTING;
    worker->deadline_ms = worker_now_ms() + pool->options.hello_deadline_ms;
    count(pool, &pool->stats.started);
    note(pool, POOL_NOTE_STARTED, worker, worker->process.pid, "");
    const bool watched =
        watch(pool, worker->process.socket, worker->slot, SOURCE_SOCKET, EPOLLIN, EPOLL_CTL_ADD) &&
        watch(pool, worker->process.pid_fd, worker->slot, SOURCE_PROCESS, EPOLLIN, EPOLL_CTL_ADD);
    if (!watched) kill_worker(worker, KILLED_PROTOCOL, "it could not be watched");
}

static void hear(struct pool *pool, struct worker *worker);

/* It ended because we wanted it to, not because anything was wrong with it. */
static bool was_told(const struct worker *worker)
{
    return worker->killed == KILLED_CANCEL || worker->killed == KILLED_DRAIN ||
           worker->killed == KILLED_IDLE || worker->killed == KILLED_YIELD;
}

static void note_death(struct pool *pool, struct worker *worker, int pid, const char *words)
{
    const bool told = was_told(worker);
    if (worker->killed == KILLED_CANCEL) count(pool, &pool->stats.cancelled);
    if (worker->killed == KILLED_YIELD) count(pool, &pool->stats.yielded);
    if (worker->killed == KILLED_DEADLINE) count(pool, &pool->stats.deadlines);
    if (worker->killed == KILLED_PROTOCOL) count(pool, &pool->stats.protocol_errors);
    if (!told) count(pool, &pool->stats.died);
    const enum pool_note_kind failed =
        worker->killed == KILLED_VERSION ? POOL_NOTE_FAILED : POOL_NOTE_DIED;
    note(pool, told ? POOL_NOTE_ENDED : failed, worker, pid, words);
}

/* Reaps a worker that has ended and settles what it leaves. */
static void bury(struct pool *pool, struct worker *worker, bool wait)
{
    char words[SPAWN_WORDS_BYTES];
    /* what it managed to say before it died still counts */
    if (worker->state != WORKER_DYING && worker->state != WORKER_DOWN) hear(pool, worker);
    const int pid = worker->process.pid;
    if (worker->state == WORKER_DOWN || !spawn_reap(&worker->process, wait, words)) return;
    const char *why = worker->killed == KILLED_NOT ? words : worker->why;
    worker->state = WORKER_DOWN;
    worker_reset(worker);
    if (was_told(worker)) worker->backoff_ms = 0;
    start_later(pool, worker);
    note_death(pool, worker, pid, why);
    end_job_of_dead(pool, worker, why);
    pool->may_have_job = true; /* it may be in the queue again */
}

/* --------------------------------------------------------------------- talking to workers */

static void flush(struct pool *pool, struct worker *worker)
{
    bool empty = false;
    struct ischia_error err;
    if (frame_writer_flush(&worker->writer, worker->process.socket, &empty, &err) != ISCHIA_OK) {
        /* it is gone, or going: its death comes by the other way, with the better words */
        spawn_kill(&worker->process);
        return;
    }
    if (worker->wants_to_write == !empty) return;
    worker->wants_to_write = !empty;
    const uint32_t events = empty ? EPOLLIN : EPOLLIN | EPOLLOUT;
    if (!watch(pool, worker->process.socket, worker->slot, SOURCE_SOCKET, events, EPOLL_CTL_MOD))
        kill_worker(worker, KILLED_PROTOCOL, "it could not be watched");
}

static void act_on_problem(struct pool *pool, struct worker *worker, const struct frame *frame)
{
    if (worker->render != NULL) {
        struct render *render = worker->render;
        worker->render = NULL;
        end_render(pool, render, ISCHIA_E_INPUT, NULL, "the stored field could not be drawn");
        return;
    }
    struct pool_outcome outcome = {.end = POOL_PROBLEM, .document = frame->bytes, .detail = ""};
    end_solve(pool, worker, &outcome);
}

static void act_on_result(struct pool *pool, struct worker *worker, const struct frame *frame)
{
    struct pool_outcome outcome = {.end = POOL_RESULT,
                                   .document = worker->result,
                                   .field = (const unsigned char *)frame->bytes,
                                   .field_size = frame->size,
                                   .detail = ""};
    end_solve(pool, worker, &outcome);
}

static void remember_program(struct pool *pool, const char *program)
{
    (void)pthread_mutex_lock(&pool->lock);
    (void)snprintf(pool->stats.program, sizeof pool->stats.program, "%s", program);
    (void)pthread_mutex_unlock(&pool->lock);
}

static void act_on(struct pool *pool, struct worker *worker, const struct worker_report *report)
{
    switch (report->news) {
    case NEWS_READY:
        remember_program(pool, report->text);
        note(pool, POOL_NOTE_READY, worker, worker->process.pid, report->text);
        become_idle(worker);
        return;
    case NEWS_PROGRESS:
        if (worker->has_job)
            pool->host.on_progress(pool->host.context, &worker->job, &report->progress);
        return;
    case NEWS_RESULT:
        act_on_result(pool, worker, &report->frame);
        break;
    case NEWS_PROBLEM:
        act_on_problem(pool, worker, &report->frame);
        break;
    case NEWS_DRAWING: {
        struct render *render = worker->render;
        worker->render = NULL;
        end_render(pool, render, ISCHIA_OK, &report->frame, "");
        break;
    }
    default:
        return;
    }
    pool->may_have_job = true;
    worker->backoff_ms = 0; /* it has done something: the next death is the first again */
    become_idle(worker);
}

/* Acts on every whole frame that is there. */
static enum ischia_code take_news(struct pool *pool, struct worker *worker,
                                  struct ischia_error *err)
{
    struct worker_report report;
    do {
        TRY(worker_next(worker, &report, err));
        act_on(pool, worker, &report);
    } while (report.news != NEWS_NONE);
    return ISCHIA_OK;
}

/* At a time, so that one that never stops talking does not keep the others waiting; more than a
 * socket holds. */
enum { READS_MAX = 32 };

/* Reads what has arrived. One that closes its socket is done for, whether or not it still lives. */
static void hear(struct pool *pool, struct worker *worker)
{
    struct ischia_error err = {0};
    bool closed = false;
    size_t got = 1;
    for (int reads = 0; reads < READS_MAX && got > 0 && worker->state != WORKER_DYING; reads++) {
        enum ischia_code code =
            frame_reader_read(&worker->reader, worker->process.socket, &got, &closed, &err);
        if (code == ISCHIA_OK) code = take_news(pool, worker, &err);
        if (code == ISCHIA_OK) continue;
        kill_worker(worker, code == ISCHIA_E_STATE ? KILLED_VERSION : KILLED_PROTOCOL, err.message);
    }
    /* killed_not: the words are those of its own death */
    if (closed && worker->state != WORKER_DYING) spawn_kill(&worker->process);
}

/* --------------------------------------------------------------------------- giving work */

static void begin_job(struct pool *pool, struct worker *worker, enum ischia_code put,
                      int deadline_ms, const struct ischia_error *err)
{
    worker->state = WORKER_BUSY;
    worker->begun_ms = worker_now_ms();
    worker->deadline_ms = worker->begun_ms + deadline_ms;
    if (put == ISCHIA_OK)
        flush(pool, worker);
    else
        kill_worker(worker, KILLED_PROTOCOL, err->message);
}

static void give_solve(struct pool *pool, struct worker *worker)
{
    if (!pool->host.next_job(pool->host.context, &worker->job)) {
        pool->may_have_job = false;
        return;
    }
    struct ischia_error err = {0};
    worker->has_job = true;
    const enum ischia_code put = worker_put_solve(worker, &err);
    begin_job(pool, worker, put, pool->options.solve_deadline_ms, &err);
}

static struct render *take_render(struct pool *pool)
{
    (void)pthread_mutex_lock(&pool->lock);
    struct render *render = pool->renders;
    if (render != NULL) {
        pool->renders = render->next;
        if (pool->renders == NULL) pool->last_render = &pool->renders;
        pool->renders_waiting--;
    }
    (void)pthread_mutex_unlock(&pool->lock);
    return render;
}

static void give_render(struct pool *pool, struct worker *worker)
{
    worker->render = take_render(pool);
    if (worker->render == NULL) return;
    struct ischia_error err = {0};
    const enum ischia_code put = worker_put_render(worker, &err);
    begin_job(pool, worker, put, pool->options.render_deadline_ms, &err);
}

/* Those at the head that nobody could take in time. */
static void expire_renders(struct pool *pool, int64_t now_ms)
{
    for (;;) {
        (void)pthread_mutex_lock(&pool->lock);
        const bool expired = pool->renders != NULL && pool->renders->expires_ms <= now_ms;
        (void)pthread_mutex_unlock(&pool->lock);
        if (!expired) return;
        end_render(pool, take_render(pool), ISCHIA_E_LIMIT, NULL,
                   "no worker could draw it in time");
    }
}

/* ------------------------------------------------------------------------------ the thread */

struct wishes { /* what other threads have asked for */
    bool draining, stopping, has_renders;
    int64_t stop_at_ms;
    struct cancel *cancels;
};

static struct wishes take_wishes(struct pool *pool)
{
    (void)pthread_mutex_lock(&pool->lock);
    const struct wishes wishes = {.draining = pool->draining,
                                  .stopping = pool->stopping,
                                  .has_renders = pool->renders != NULL,
                                  .stop_at_ms = pool->stop_at_ms,
                                  .cancels = pool->cancels};
    pool->cancels = NULL;
    pool->may_have_job |= pool->wanted;
    pool->may_press |= pool->wanted;
    pool->wanted = false;
    (void)pthread_mutex_unlock(&pool->lock);
    return wishes;
}

static void cancel_all(struct pool *pool, struct cancel *cancels)
{
    while (cancels != NULL) {
        struct cancel *cancel = cancels;
        cancels = cancel->next;
        for (int i = 0; i < pool->worker_count; i++) {
            struct worker *worker = &pool->worker[i];
            const bool meant = cancel->all || uuid_equal(&worker->job.id, &cancel->id);
            if (worker->has_job && meant) kill_worker(worker, KILLED_CANCEL, "cancelled");
        }
        free(cancel);
    }
}

static void mind_deadline(struct worker *worker, int64_t now_ms)
{
    if (worker->deadline_ms == 0 || now_ms < worker->deadline_ms) return;
    char words[80];
    if (worker->state == WORKER_STARTING)
        (void)snprintf(words, sizeof words, "it did not say hello in time");
    else
        (void)snprintf(words, sizeof words, "it took longer than the %lld s allowed",
                       (long long)((worker->deadline_ms - worker->begun_ms + 999) / 1000));
    kill_worker(worker, KILLED_DEADLINE, words);
}

static void mind_worker(struct pool *pool, struct worker *worker, const struct wishes *wishes)
{
    const int64_t now_ms = worker_now_ms();
    mind_deadline(worker, now_ms);
    const bool wanted = !wishes->stopping && (!worker->renders || wishes->has_renders);
    if (worker->state == WORKER_DOWN && wanted && now_ms >= worker->start_at_ms)
        start_worker(pool, worker);
    if (worker->state != WORKER_IDLE) return;
    if (worker->renders && !wishes->stopping) give_render(pool, worker);
    if (!worker->renders && !wishes->draining && pool->may_have_job) give_solve(pool, worker);
    if (worker->state == WORKER_IDLE && worker->renders &&
        now_ms - worker->idle_since_ms >= pool->options.render_idle_ms)
        kill_worker(worker, KILLED_IDLE, "idle");
}

/* ------------------------------------------------------------------------- making room */

/* The one that has worked for the shortest time: the least is lost. NULL: none. */
static struct worker *latest_that_yields(struct pool *pool)
{
    struct worker *latest = NULL;
    for (int i = 0; i < pool->options.solve_workers; i++) {
        struct worker *worker = &pool->worker[i];
        if (worker_yields(worker) && (latest == NULL || worker->begun_ms > latest->begun_ms))
            latest = worker;
    }
    return latest;
}

/* Ends as many solves that yield as there are pressing jobs without a worker in sight. */
static void make_room(struct pool *pool, const struct wishes *wishes)
{
    struct worker *latest = latest_that_yields(pool);
    const int64_t now_ms = worker_now_ms();
    if (!pool->may_press || pool->host.pressing == NULL || wishes->draining || latest == NULL)
        return;
    pool->may_press = false;
    int64_t needed = pool->host.pressing(pool->host.context);
    for (int i = 0; i < pool->options.solve_workers; i++)
        needed -= worker_is_coming_free(&pool->worker[i], now_ms);
    for (; needed > 0 && latest != NULL; needed--) {
        kill_worker(latest, KILLED_YIELD, "its worker is needed for a job that may not wait");
        latest = latest_that_yields(pool);
    }
}

static void update_stats(struct pool *pool)
{
    int ready = 0, busy = 0;
    for (int i = 0; i < pool->options.solve_workers; i++) {
        ready += pool->worker[i].state == WORKER_IDLE;
        busy += pool->worker[i].state == WORKER_BUSY;
    }
    (void)pthread_mutex_lock(&pool->lock);
    pool->stats.ready = ready;
    pool->stats.busy = busy;
    (void)pthread_mutex_unlock(&pool->lock);
}

static int64_t earlier(int64_t a, int64_t b) { return a < b ? a : b; }

/* How long nothing can be due, in ms. */
static int time_to_sleep(const struct pool *pool, const struct wishes *wishes)
{
    int64_t due = pool->next_tick_ms;
    if (wishes->stopping) due = earlier(due, wishes->stop_at_ms);
    for (int i = 0; i < pool->worker_count; i++) {
        const struct worker *worker = &pool->worker[i];
        if (worker->deadline_ms != 0) due = earlier(due, worker->deadline_ms);
        const bool wanted = !wishes->stopping && (!worker->renders || wishes->has_renders);
        if (worker->state == WORKER_DOWN && wanted) due = earlier(due, worker->start_at_ms);
    }
    const int64_t rest = due - worker_now_ms();
    return rest < 0 ? 0 : (int)earlier(rest, 60000);
}

static void tick(struct pool *pool)
{
    const int64_t now_ms = worker_now_ms();
    if (now_ms < pool->next_tick_ms) return;
    pool->next_tick_ms = now_ms + pool->options.poll_ms;
    pool->may_have_job = true; /* another process may have put one in */
    pool->may_press = true;
    expire_renders(pool, now_ms);
    if (pool->host.on_tick != NULL) pool->host.on_tick(pool->host.context);
}

static void take_event(struct pool *pool, const struct epoll_event *event)
{
    const int slot = (int)(event->data.u64 / SOURCE_COUNT);
    const int source = (int)(event->data.u64 % SOURCE_COUNT);
    uint64_t ignored;
    if (source == SOURCE_EVENT) {
        (void)!read(pool->event_fd, &ignored, sizeof ignored); /* nonblocking; only wakes */
        return;
    }
    struct worker *worker = &pool->worker[slot];
    if (source == SOURCE_PROCESS) bury(pool, worker, false);
    if (source != SOURCE_SOCKET || worker->state == WORKER_DOWN) return;
    if ((event->events & EPOLLOUT) != 0 && worker->state != WORKER_DYING) flush(pool, worker);
    if (worker->state != WORKER_DYING) hear(pool, worker);
    /* a dead one's socket stays readable: it is not looked at again until it is reaped */
    if ((event->events & EPOLLHUP) != 0 || worker->state == WORKER_DYING)
        (void)epoll_ctl(pool->epoll_fd, EPOLL_CTL_DEL, worker->process.socket, NULL);
}

static bool is_done(const struct pool *pool, const struct wishes *wishes)
{
    bool solving = false;
    for (int i = 0; i < pool->worker_count; i++) solving |= pool->worker[i].has_job;
    return wishes->stopping && (!solving || worker_now_ms() >= wishes->stop_at_ms);
}

static void end_all(struct pool *pool)
{
    for (int i = 0; i < pool->worker_count; i++)
        kill_worker(&pool->worker[i], KILLED_DRAIN, "the daemon is stopping");
    for (int i = 0; i < pool->worker_count; i++) bury(pool, &pool->worker[i], true);
    for (struct render *render; (render = take_render(pool)) != NULL;)
        end_render(pool, render, ISCHIA_E_STATE, NULL, "the daemon is stopping");
}

static void *pool_main(void *argument)
{
    struct pool *pool = argument;
    enum { EVENTS_MAX = 64 };
    sigset_t all; /* signals are the main thread's */
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_BLOCK, &all, NULL);
    for (;;) {
        const struct wishes wishes = take_wishes(pool);
        cancel_all(pool, wishes.cancels);
        if (is_done(pool, &wishes)) break;
        tick(pool);
        for (int i = 0; i < pool->worker_count; i++) mind_worker(pool, &pool->worker[i], &wishes);
        make_room(pool, &wishes);
        update_stats(pool);
        struct epoll_event event[EVENTS_MAX];
        const int timeout_ms = time_to_sleep(pool, &wishes);
        const int events = epoll_wait(pool->epoll_fd, event, EVENTS_MAX, timeout_ms);
        for (int i = 0; i < events; i++) take_event(pool, &event[i]);
    }
    end_all(pool);
    update_stats(pool);
    return NULL;
}

/* ------------------------------------------------------------------------- create, destroy */

static int default_to(int value, int otherwise) { return value > 0 ? value : otherwise; }

static struct pool_options with_defaults(const struct pool_options *given)
{
    struct pool_options options = *given;
    options.solve_workers = default_to(given->solve_workers, (int)sysconf(_SC_NPROCESSORS_ONLN));
    options.solve_workers = default_to(options.solve_workers, 1);
    options.render_workers = default_to(given->render_workers, 1);
    options.solve_deadline_ms = default_to(given->solve_deadline_ms, 15 * 60 * 1000);
    options.render_deadline_ms = default_to(given->render_deadline_ms, 60 * 1000);
    options.hello_deadline_ms = default_to(given->hello_deadline_ms, 30 * 1000);
    options.backoff_min_ms = default_to(given->backoff_min_ms, 100);
    options.backoff_max_ms = default_to(given->backoff_max_ms, 10 * 1000);
    options.render_idle_ms = default_to(given->render_idle_ms, 60 * 1000);
    options.renders_waiting_max = default_to(given->renders_waiting_max, 64);
    options.poll_ms = default_to(given->poll_ms, 1000);
    if (options.limits.json_max == 0) options.limits = frame_limits_default;
    return options;
}

static void set_up_workers(struct pool *pool)
{
    for (int i = 0; i < pool->worker_count; i++)
        pool->worker[i] = (struct worker){.slot = i,
                                          .renders = i >= pool->options.solve_workers,
                                          .process = {.pid = -1, .pid_fd = -1, .socket = -1}};
}

static void free_pool(struct pool *pool)
{
    if (pool->epoll_fd >= 0) (void)close(pool->epoll_fd);
    if (pool->event_fd >= 0) (void)close(pool->event_fd);
    while (pool->cancels != NULL) {
        struct cancel *cancel = pool->cancels;
        pool->cancels = cancel->next;
        free(cancel);
    }
    (void)pthread_mutex_destroy(&pool->lock);
    free(pool->worker);
    free(pool->command);
    free(pool);
}

static enum ischia_code set_up(struct pool *pool, const char *const *command,
                               struct ischia_error *err)
{
    pool->worker_count = pool->options.solve_workers + pool->options.render_workers;
    pool->worker = calloc((size_t)pool->worker_count, sizeof *pool->worker);
    pool->command = worker_copy_command(command);
    CHECK(pool->worker != NULL && pool->command != NULL, err, ISCHIA_E_MEMORY,
          "no memory for the worker pool");
    set_up_workers(pool);
    CHECK(pool->epoll_fd >= 0 && pool->event_fd >= 0, err, ISCHIA_E_IO,
          "no descriptors for the worker pool: %s", strerror(errno));
    CHECK(watch(pool, pool->event_fd, 0, SOURCE_EVENT, EPOLLIN, EPOLL_CTL_ADD), err, ISCHIA_E_IO,
          "the worker pool cannot be set up: %s", strerror(errno));
    const int code = pthread_create(&pool->thread, NULL, pool_main, pool);
    CHECK(code == 0, err, ISCHIA_E_MEMORY, "the pool's thread cannot start: %s", strerror(code));
    return ISCHIA_OK;
}

enum ischia_code pool_create(const struct pool_options *options, const struct pool_host *host,
                             struct pool **ret_pool, struct ischia_error *err)
{
    CHECK(options->command != NULL && options->command[0] != NULL, err, ISCHIA_E_INPUT,
          "the worker's command is empty");
    CHECK(access(options->command[0], X_OK) == 0, err, ISCHIA_E_IO,
          "the worker program %s cannot be executed: %s", options->command[0], strerror(errno));
    struct pool *pool = calloc(1, sizeof *pool);
    CHECK(pool != NULL, err, ISCHIA_E_MEMORY, "no memory for the worker pool");
    pool->options = with_defaults(options);
    pool->host = *host;
    pool->epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    pool->event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    pool->last_render = &pool->renders;
    pool->may_have_job = true;
    pool->stats.workers = pool->options.solve_workers;
    (void)pthread_mutex_init(&pool->lock, NULL);
    const enum ischia_code code = set_up(pool, options->command, err);
    if (code != ISCHIA_OK) {
        free_pool(pool);
        return code;
    }
    *ret_pool = pool;
    return ISCHIA_OK;
}

static void wake_thread(struct pool *pool)
{
    const uint64_t one = 1;
    (void)!write(pool->event_fd, &one, sizeof one); /* full means that it will wake anyway */
}

void pool_wake(struct pool *pool)
{
    (void)pthread_mutex_lock(&pool->lock);
    const bool was_wanted = pool->wanted;
    pool->wanted = true;
    (void)pthread_mutex_unlock(&pool->lock);
    if (!was_wanted) wake_thread(pool);
}

static void add_cancel(struct pool *pool, struct cancel what)
{
    struct cancel *cancel = malloc(sizeof *cancel);
    if (cancel == NULL) return; /* the solve runs on; the store refuses what comes of it */
    (void)pthread_mutex_lock(&pool->lock);
    what.next = pool->cancels;
    *cancel = what;
    pool->cancels = cancel;
    (void)pthread_mutex_unlock(&pool->lock);
    wake_thread(pool);
}

void pool_cancel(struct pool *pool, const struct uuid *id)
{
    add_cancel(pool, (struct cancel){.id = *id});
}

void pool_cancel_all(struct pool *pool) { add_cancel(pool, (struct cancel){.all = true}); }

/* NULL when there is no memory. */
static struct render *make_render(const char *case_json, const unsigned char *field,
                                  size_t field_size)
{
    struct render *render = calloc(1, sizeof *render);
    if (render == NULL) return NULL;
    render->case_json = strdup(case_json);
    render->field = malloc(field_size > 0 ? field_size : 1);
    if (render->case_json == NULL || render->field == NULL) {
        render_destroy(render);
        return NULL;
    }
    if (field_size > 0) memcpy(render->field, field, field_size);
    render->field_size = field_size;
    return render;
}

/* Puts it at the end of those that wait, if it may. */
static enum ischia_code enqueue_render(struct pool *pool, struct render *render)
{
    enum ischia_code code = ISCHIA_OK;
    (void)pthread_mutex_lock(&pool->lock);
    if (pool->stopping || pool->draining)
        code = ISCHIA_E_STATE;
    else if (pool->renders_waiting >= pool->options.renders_waiting_max)
        code = ISCHIA_E_LIMIT;
    if (code == ISCHIA_OK) {
        *pool->last_render = render;
        pool->last_render = &render->next;
        pool->renders_waiting++;
    }
    (void)pthread_mutex_unlock(&pool->lock);
    return code;
}

enum ischia_code pool_render(struct pool *pool, enum pool_render_kind kind, const char *language,
                             const char *case_json, const unsigned char *field, size_t field_size,
                             pool_render_done *done, void *context, struct ischia_error *err)
{
    struct render *render = make_render(case_json, field, field_size);
    CHECK(render != NULL, err, ISCHIA_E_MEMORY, "no memory for a drawing");
    render->kind = kind;
    render->language = language;
    render->done = done;
    render->context = context;
    render->expires_ms = worker_now_ms() + 2 * (int64_t)pool->options.render_deadline_ms;
    const enum ischia_code code = enqueue_render(pool, render);
    if (code != ISCHIA_OK) {
        render_destroy(render);
        return FAIL(err, code,
                    code == ISCHIA_E_LIMIT ? "too many drawings are waiting"
                                           : "the daemon is stopping");
    }
    wake_thread(pool);
    return ISCHIA_OK;
}

void pool_stats(struct pool *pool, struct pool_stats *ret)
{
    (void)pthread_mutex_lock(&pool->lock);
    *ret = pool->stats;
    ret->renders_waiting = pool->renders_waiting;
    (void)pthread_mutex_unlock(&pool->lock);
}

void pool_drain(struct pool *pool)
{
    (void)pthread_mutex_lock(&pool->lock);
    pool->draining = true;
    (void)pthread_mutex_unlock(&pool->lock);
    wake_thread(pool);
}

void pool_destroy(struct pool *pool, int grace_ms)
{
    if (pool == NULL) return;
    (void)pthread_mutex_lock(&pool->lock);
    pool->draining = true;
    pool->stopping = true;
    pool->stop_at_ms = worker_now_ms() + grace_ms;
    (void)pthread_mutex_unlock(&pool->lock);
    wake_thread(pool);
    (void)pthread_join(pool->thread, NULL);
    free_pool(pool);
}
