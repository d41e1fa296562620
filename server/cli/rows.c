/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Parent and worker talk over a SOCK_SEQPACKET pair, one message a struct (both are the same
 * program, and neither struct holds pointers): a case goes down, an outcome comes up. End of file
 * is the worker's order to leave and the parent's news that the worker is gone.
 */
#include "server/cli/rows.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "solver/solver.h"

enum { TICK_MS = 1000 };

struct worker {
    pid_t pid; /* 0: none */
    int fd;
    bool busy;
    bool second_try;
    size_t row;
    struct ischia_case values;
};

struct pool {
    const struct rows_task *task;
    int count;
    struct worker worker[ROWS_PROCESSES_MAX];
    struct rows_outcome outcome; /* large: not on the stack of each call */
    bool exhausted;              /* task->next said so */
};

int rows_processes_default(void)
{
    const long online = sysconf(_SC_NPROCESSORS_ONLN);
    if (online < 1) return 1;
    return online > ROWS_PROCESSES_MAX ? ROWS_PROCESSES_MAX : (int)online;
}

/* ---- in the worker ---- */

static double seconds_of(clockid_t clock)
{
    struct timespec now;
    (void)clock_gettime(clock, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

static void solve_one(struct ischia_solver *solver, const struct ischia_case *c,
                      struct rows_outcome *ret)
{
    const double wall = seconds_of(CLOCK_MONOTONIC), cpu = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
    memset(ret, 0, sizeof *ret);
    ret->code = ischia_solve(solver, c, NULL, &ret->result, NULL, &ret->error);
    ret->result.numerics.wall_s = seconds_of(CLOCK_MONOTONIC) - wall;
    ret->result.numerics.cpu_s = seconds_of(CLOCK_PROCESS_CPUTIME_ID) - cpu;
}

static int worker_main(int fd)
{
    static struct rows_outcome outcome;
    struct ischia_solver *solver;
    struct ischia_case values;
    int status = 0;
    if (ischia_solver_create(&solver, NULL) != ISCHIA_OK) return 1;
    for (;;) {
        const ssize_t got = recv(fd, &values, sizeof values, 0);
        if (got < 0 && errno == EINTR) continue;
        if (got != sizeof values) break;
        solve_one(solver, &values, &outcome);
        if (send(fd, &outcome, sizeof outcome, MSG_NOSIGNAL) != sizeof outcome) {
            status = 1;
            break;
        }
    }
    ischia_solver_destroy(solver);
    return status;
}

/* ---- in the parent ---- */

/* The fork's part: the other workers' sockets are closed so that each sees its parent leave. */
static _Noreturn void become_worker(const struct pool *pool, int fd, pid_t parent)
{
    (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(1);
    for (int i = 0; i < pool->count; i++)
        if (pool->worker[i].pid != 0) (void)close(pool->worker[i].fd);
    _exit(worker_main(fd));
}

static enum ischia_code spawn(struct pool *pool, struct worker *w, struct ischia_error *err)
{
    int fd[2];
    const pid_t parent = getpid();
    CHECK(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, fd) == 0, err, ISCHIA_E_IO,
          "a socket for a worker process could not be made: %s", strerror(errno));
    const pid_t pid = fork();
    if (pid == 0) {
        (void)close(fd[0]);
        become_worker(pool, fd[1], parent);
    }
    (void)close(fd[1]);
    if (pid < 0) {
        const int cause = errno;
        (void)close(fd[0]);
        return FAIL(err, ISCHIA_E_IO, "a worker process could not be started: %s", strerror(cause));
    }
    w->pid = pid;
    w->fd = fd[0];
    return ISCHIA_OK;
}

/* Ends a worker and returns its wait status. */
static int reap(struct worker *w, bool kill_first)
{
    int status = 0;
    (void)close(w->fd);
    if (kill_first) (void)kill(w->pid, SIGKILL);
    while (waitpid(w->pid, &status, 0) < 0 && errno == EINTR) {
    }
    w->pid = 0;
    return status;
}

/* A worker that died meanwhile is found by poll, so a failed send needs no answer here. */
static void give(struct worker *w)
{
    w->busy = true;
    (void)send(w->fd, &w->values, sizeof w->values, MSG_NOSIGNAL);
}

static enum ischia_code feed(struct pool *pool, struct worker *w, struct ischia_error *err)
{
    if (w->busy || pool->exhausted) return ISCHIA_OK;
    if (!pool->task->next(pool->task->context, &w->row, &w->values)) {
        pool->exhausted = true;
        return ISCHIA_OK;
    }
    if (w->pid == 0) TRY(spawn(pool, w, err));
    w->second_try = false;
    give(w);
    return ISCHIA_OK;
}

static enum ischia_code finish_row(struct pool *pool, struct worker *w, struct ischia_error *err)
{
    w->busy = false;
    TRY(pool->task->done(pool->task->context, w->row, &pool->outcome, err));
    if (pool->task->tick != NULL) pool->task->tick(pool->task->context);
    return feed(pool, w, err);
}

static void describe_death(struct rows_outcome *ret, int status)
{
    memset(ret, 0, sizeof *ret);
    if (WIFSIGNALED(status)) {
        ret->code = FAIL(&ret->error, ISCHIA_E_STATE, "the solving process was ended by signal %d",
                         WTERMSIG(status));
    } else {
        ret->code = FAIL(&ret->error, ISCHIA_E_STATE, "the solving process ended with status %d",
                         WEXITSTATUS(status));
    }
}

static enum ischia_code after_death(struct pool *pool, struct worker *w, struct ischia_error *err)
{
    const int status = reap(w, false);
    if (!w->busy) return ISCHIA_OK;
    if (w->second_try) {
        describe_death(&pool->outcome, status);
        return finish_row(pool, w, err);
    }
    TRY(spawn(pool, w, err));
    w->second_try = true;
    give(w);
    return ISCHIA_OK;
}

static enum ischia_code hear(struct pool *pool, struct worker *w, struct ischia_error *err)
{
    const ssize_t got = recv(w->fd, &pool->outcome, sizeof pool->outcome, MSG_DONTWAIT);
    if (got < 0 && (errno == EINTR || errno == EAGAIN)) return ISCHIA_OK;
    if (got != sizeof pool->outcome) return after_death(pool, w, err);
    return finish_row(pool, w, err);
}

/* Waits for news from busy workers; *ret_busy is how many there were. */
static enum ischia_code wait_for_news(struct pool *pool, int *ret_busy, struct ischia_error *err)
{
    struct pollfd poll_fd[ROWS_PROCESSES_MAX];
    struct worker *of[ROWS_PROCESSES_MAX];
    nfds_t busy = 0;
    for (int i = 0; i < pool->count; i++) {
        if (!pool->worker[i].busy) continue;
        of[busy] = &pool->worker[i];
        poll_fd[busy++] = (struct pollfd){.fd = pool->worker[i].fd, .events = POLLIN};
    }
    *ret_busy = (int)busy;
    if (busy == 0) return ISCHIA_OK;
    const int ready = poll(poll_fd, busy, TICK_MS);
    CHECK(ready >= 0 || errno == EINTR, err, ISCHIA_E_IO, "waiting for worker processes failed: %s",
          strerror(errno));
    for (nfds_t i = 0; ready > 0 && i < busy; i++)
        if (poll_fd[i].revents != 0) TRY(hear(pool, of[i], err));
    if (pool->task->tick != NULL) pool->task->tick(pool->task->context);
    return ISCHIA_OK;
}

static enum ischia_code run(struct pool *pool, struct ischia_error *err)
{
    int busy;
    for (int i = 0; i < pool->count; i++) TRY(feed(pool, &pool->worker[i], err));
    do {
        TRY(wait_for_news(pool, &busy, err));
    } while (busy > 0);
    return ISCHIA_OK;
}

enum ischia_code rows_solve(const struct rows_task *task, struct ischia_error *err)
{
    struct pool *pool = calloc(1, sizeof *pool);
    CHECK(pool != NULL, err, ISCHIA_E_MEMORY, "no memory for %d worker processes", task->processes);
    pool->task = task;
    pool->count = task->processes;
    const enum ischia_code code = run(pool, err);
    for (int i = 0; i < pool->count; i++)
        if (pool->worker[i].pid != 0) (void)reap(&pool->worker[i], pool->worker[i].busy);
    free(pool);
    return code;
}
