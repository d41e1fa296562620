/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/crew.h"

#include <assert.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/cli/run.h"
#include "server/cli/uncertain.h"

struct job {
    long number;
    struct crew_order order;
};

/* ---- the member's side ---- */

static bool receive_all(int fd, void *bytes, size_t length)
{
    ssize_t got;
    do got = recv(fd, bytes, length, MSG_WAITALL);
    while (got < 0 && errno == EINTR);
    return got == (ssize_t)length;
}

static bool send_all(int fd, const void *bytes, size_t length)
{
    const char *at = bytes;
    while (length > 0) {
        const ssize_t sent = send(fd, at, length, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) return false;
        at += sent;
        length -= (size_t)sent;
    }
    return true;
}

/* The solve, and the interval when it is asked for and there is something to put it around. */
static enum ischia_code carry_out(struct ischia_solver *solver, const struct estimator *estimator,
                                  const struct crew_order *order, struct crew_answer *ret,
                                  struct ischia_error *err)
{
    TRY(timed_solve(solver, &order->c, NULL, &ret->result, NULL, err));
    if (!order->has_sd || !ischia_result_converged(&ret->result)) return ISCHIA_OK;
    TRY(uncertain_interval(&ret->uncertainty, estimator, &order->c, order->sd, &ret->result, err));
    ret->has_uncertainty = true;
    return ISCHIA_OK;
}

static void answer(struct ischia_solver *solver, const struct estimator *estimator,
                   const struct job *job, struct crew_answer *ret)
{
    struct ischia_error err;
    memset(ret, 0, sizeof *ret); /* the gaps between members travel too */
    ret->job = job->number;
    ret->code = carry_out(solver, estimator, &job->order, ret, &err);
    if (ret->code != ISCHIA_OK)
        (void)snprintf(ret->message, sizeof ret->message, "%s", err.message);
}

/* Solves what comes until there is nothing more. A solver that cannot be made answers so. */
static void work(int fd, const struct estimator *estimator)
{
    static struct crew_answer reply;
    struct ischia_solver *solver = NULL;
    struct ischia_error err = {0};
    struct job job;
    const enum ischia_code made = ischia_solver_create(&solver, &err);
    while (receive_all(fd, &job, sizeof job)) {
        if (made == ISCHIA_OK) {
            answer(solver, estimator, &job, &reply);
        } else {
            memset(&reply, 0, sizeof reply);
            reply.job = job.number;
            reply.code = made;
            (void)snprintf(reply.message, sizeof reply.message, "%s", err.message);
        }
        if (!send_all(fd, &reply, sizeof reply)) break;
    }
    ischia_solver_destroy(solver);
}

/* ---- our side ---- */

/* In the child: the sockets of the others are not its business, and it ends when we do. */
__attribute__((noreturn)) static void become_member(const struct crew *crew, pid_t parent, int fd)
{
    (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() == parent) {
        for (int i = 0; i < crew->count; i++)
            if (crew->member[i].fd >= 0) (void)close(crew->member[i].fd);
        work(fd, crew->estimator);
    }
    _exit(0);
}

static enum ischia_code start_member(struct crew *crew, struct crew_member *ret,
                                     struct ischia_error *err)
{
    int pair[2];
    const pid_t parent = getpid();
    CHECK(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) == 0, err, ISCHIA_E_IO,
          "cannot start a solver process: %s", strerror(errno));
    const pid_t pid = fork();
    if (pid == 0) {
        (void)close(pair[0]);
        become_member(crew, parent, pair[1]);
    }
    const int reason = errno;
    (void)close(pair[1]);
    if (pid < 0) {
        (void)close(pair[0]);
        return FAIL(err, ISCHIA_E_IO, "cannot start a solver process: %s", strerror(reason));
    }
    *ret = (struct crew_member){.pid = pid, .fd = pair[0], .job = -1};
    return ISCHIA_OK;
}

enum ischia_code crew_start(struct crew *ret, int count, const struct estimator *estimator,
                            struct ischia_error *err)
{
    assert(count >= 1 && count <= CREW_MEMBERS_MAX);
    ret->count = 0;
    ret->estimator = estimator;
    while (ret->count < count) {
        const enum ischia_code code = start_member(ret, &ret->member[ret->count], err);
        if (code != ISCHIA_OK) {
            crew_stop(ret);
            return code;
        }
        ret->count++;
    }
    return ISCHIA_OK;
}

/* Ends one member and says how it ended, as waitpid does. */
static int end_member(struct crew_member *member)
{
    int status = 0;
    (void)close(member->fd);
    member->fd = -1;
    while (waitpid(member->pid, &status, 0) < 0 && errno == EINTR) {
    }
    return status;
}

void crew_stop(struct crew *crew)
{
    for (int i = 0; i < crew->count; i++) {
        if (crew->member[i].fd < 0) continue;
        if (crew->member[i].job >= 0) (void)kill(crew->member[i].pid, SIGKILL);
        (void)end_member(&crew->member[i]);
    }
    crew->count = 0;
}

bool crew_is_idle(const struct crew *crew, int member) { return crew->member[member].job < 0; }

int crew_idle(const struct crew *crew)
{
    for (int i = 0; i < crew->count; i++)
        if (crew_is_idle(crew, i)) return i;
    return CREW_NOBODY;
}

bool crew_is_working(const struct crew *crew)
{
    for (int i = 0; i < crew->count; i++)
        if (crew->member[i].job >= 0) return true;
    return false;
}

enum ischia_code crew_give(struct crew *crew, int number, long job, const struct crew_order *order,
                           struct ischia_error *err)
{
    struct job message;
    assert(number >= 0 && number < crew->count && crew_is_idle(crew, number) && job >= 0);
    struct crew_member *member = &crew->member[number];
    memset(&message, 0, sizeof message);
    message.number = job;
    message.order = *order;
    if (!send_all(member->fd, &message, sizeof message)) { /* it died while idle: one new try */
        (void)end_member(member);
        TRY(start_member(crew, member, err));
        CHECK(send_all(member->fd, &message, sizeof message), err, ISCHIA_E_IO,
              "cannot reach a solver process: %s", strerror(errno));
    }
    member->job = job;
    return ISCHIA_OK;
}

/* The answer in place of a member that died at work. */
static void obituary(struct crew_answer *ret, long job, int status)
{
    memset(ret, 0, sizeof *ret);
    ret->job = job;
    ret->code = ISCHIA_E_STATE;
    if (WIFSIGNALED(status))
        (void)snprintf(ret->message, sizeof ret->message, "the solver process died: %s",
                       strsignal(WTERMSIG(status)));
    else
        (void)snprintf(ret->message, sizeof ret->message, "the solver process ended with status %d",
                       WEXITSTATUS(status));
}

static enum ischia_code hear(struct crew *crew, struct crew_member *member, struct crew_answer *ret,
                             struct ischia_error *err)
{
    const long job = member->job;
    member->job = -1;
    if (receive_all(member->fd, ret, sizeof *ret)) return ISCHIA_OK;
    obituary(ret, job, end_member(member));
    return start_member(crew, member, err);
}

enum ischia_code crew_wait(struct crew *crew, struct crew_answer *ret, struct ischia_error *err)
{
    struct pollfd polled[CREW_MEMBERS_MAX];
    int ready;
    assert(crew_is_working(crew));
    for (int i = 0; i < crew->count; i++) {
        const bool working = crew->member[i].job >= 0;
        polled[i] = (struct pollfd){.fd = working ? crew->member[i].fd : -1, .events = POLLIN};
    }
    do ready = poll(polled, (nfds_t)crew->count, -1);
    while (ready < 0 && errno == EINTR);
    CHECK(ready > 0, err, ISCHIA_E_IO, "cannot wait for solver processes: %s", strerror(errno));
    int first = 0;
    while (polled[first].revents == 0) first++;
    TRY(hear(crew, &crew->member[first], ret, err));
    ret->member = first;
    return ISCHIA_OK;
}
