/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/spawn.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/pidfd.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/blas_environment.h"

enum { WORKER_FD = 3, EXIT_NOT_EXECUTABLE = 127, EXIT_NOT_SET_UP = 126 };

static const char *const fixed_environment[] = {"PATH=/usr/bin:/bin", "LANG=C.UTF-8"};
/* What sanitizer and coverage builds need to be told, and what else OpenBLAS heeds: the command
 * line does so too, and a side has the same bits from both. */
static const char *const passed_environment[] = {"ASAN_OPTIONS",      "UBSAN_OPTIONS",
                                                 "TSAN_OPTIONS",      "LSAN_OPTIONS",
                                                 "LLVM_PROFILE_FILE", "OPENBLAS_L2_SIZE"};
enum {
    FIXED = sizeof fixed_environment / sizeof fixed_environment[0],
    PASSED = sizeof passed_environment / sizeof passed_environment[0]
};

/* Everything the child needs, made before the fork: after it, in a program with threads, only
 * calls that are safe in a signal handler are allowed. */
struct plan {
    char *argument[SPAWN_COMMAND_MAX + 1];
    char *environment[FIXED + PASSED + BLAS_SETTINGS_MAX + 1];
    char *passed[PASSED + BLAS_SETTINGS_MAX]; /* "NAME=value", malloc'ed */
    size_t passed_count;
    size_t memory_max_bytes;
    int socket; /* the child's end */
    pid_t parent;
};

static enum ischia_code plan_arguments(struct plan *plan, const char *const *command,
                                       struct ischia_error *err)
{
    size_t count = 0;
    for (; command[count] != NULL; count++) {
        CHECK(count < SPAWN_COMMAND_MAX - 2, err, ISCHIA_E_LIMIT,
              "the worker's command has too many arguments");
        plan->argument[count] = (char *)(uintptr_t)command[count];
    }
    CHECK(count > 0, err, ISCHIA_E_INPUT, "the worker's command is empty");
    static char fd_option[] = "--fd", fd_number[] = "3";
    plan->argument[count++] = fd_option;
    plan->argument[count++] = fd_number;
    plan->argument[count] = NULL;
    return ISCHIA_OK;
}

static enum ischia_code pass_on(struct plan *plan, const char *name, const char *value,
                                struct ischia_error *err)
{
    char *pair;
    const int length = asprintf(&pair, "%s=%s", name, value);
    CHECK(length >= 0, err, ISCHIA_E_MEMORY, "no memory for a worker's environment");
    plan->passed[plan->passed_count++] = pair;
    return ISCHIA_OK;
}

static enum ischia_code plan_environment(struct plan *plan, struct ischia_error *err)
{
    size_t count = 0;
    for (int i = 0; i < FIXED; i++)
        plan->environment[count++] = (char *)(uintptr_t)fixed_environment[i];
    struct blas_setting blas[BLAS_SETTINGS_MAX];
    const size_t blas_count = blas_environment(blas);
    for (size_t i = 0; i < blas_count; i++) TRY(pass_on(plan, blas[i].name, blas[i].value, err));
    for (int i = 0; i < PASSED; i++) {
        const char *value = getenv(passed_environment[i]);
        if (value != NULL) TRY(pass_on(plan, passed_environment[i], value, err));
    }
    memcpy(plan->environment + count, plan->passed, sizeof(char *) * plan->passed_count);
    plan->environment[count + plan->passed_count] = NULL;
    return ISCHIA_OK;
}

static void plan_finish(struct plan *plan)
{
    for (size_t i = 0; i < plan->passed_count; i++) free(plan->passed[i]);
}

/* ------------------------------------------------------------------------- in the child */

static bool set_up_descriptors(int socket)
{
    const int null_fd = open("/dev/null", O_RDWR);
    if (null_fd < 0 || dup2(null_fd, STDIN_FILENO) < 0 || dup2(null_fd, STDOUT_FILENO) < 0)
        return false;
    /* dup2 onto itself would leave close-on-exec set */
    if (socket == WORKER_FD ? fcntl(socket, F_SETFD, 0) < 0 : dup2(socket, WORKER_FD) < 0)
        return false;
    return close_range(WORKER_FD + 1, ~0U, 0) == 0;
}

static bool set_up_limits(const struct plan *plan)
{
    /* no core files: they would hold what people sent */
    const struct rlimit none = {0, 0};
    const struct rlimit data = {plan->memory_max_bytes, plan->memory_max_bytes};
    if (setrlimit(RLIMIT_CORE, &none) != 0) return false;
    return plan->memory_max_bytes == 0 || setrlimit(RLIMIT_DATA, &data) == 0;
}

static bool set_up_signals(void)
{
    sigset_t none;
    return sigemptyset(&none) == 0 && sigprocmask(SIG_SETMASK, &none, NULL) == 0 &&
           signal(SIGPIPE, SIG_DFL) != SIG_ERR;
}

_Noreturn static void become_worker(const struct plan *plan)
{
    const bool tied = setpgid(0, 0) == 0 && prctl(PR_SET_PDEATHSIG, SIGKILL) == 0;
    /* the parent may have died before it was watched */
    if (!tied || getppid() != plan->parent || !set_up_signals() || !set_up_limits(plan) ||
        !set_up_descriptors(plan->socket))
        _exit(EXIT_NOT_SET_UP);
    (void)execve(plan->argument[0], plan->argument, plan->environment);
    _exit(EXIT_NOT_EXECUTABLE);
}

/* ------------------------------------------------------------------------ in the parent */

static enum ischia_code start(const struct plan *plan, struct spawned *ret,
                              struct ischia_error *err)
{
    const pid_t pid = fork();
    CHECK(pid >= 0, err, ISCHIA_E_IO, "no process for a worker: %s", strerror(errno));
    if (pid == 0) become_worker(plan);
    ret->pid = pid;
    ret->pid_fd = pidfd_open(pid, 0);
    if (ret->pid_fd >= 0) return ISCHIA_OK;
    const int saved = errno;
    (void)kill(pid, SIGKILL);
    while (waitpid(pid, NULL, 0) < 0 && errno == EINTR) continue;
    return FAIL(err, ISCHIA_E_IO, "a worker cannot be watched: %s", strerror(saved));
}

static enum ischia_code start_with_socket(struct plan *plan, struct spawned *ret,
                                          struct ischia_error *err)
{
    int pair[2];
    CHECK(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) == 0, err, ISCHIA_E_IO,
          "no socket for a worker: %s", strerror(errno));
    plan->socket = pair[1];
    struct spawned process = {.socket = pair[0]};
    enum ischia_code code = ISCHIA_OK;
    if (fcntl(pair[0], F_SETFL, O_NONBLOCK) != 0)
        code = FAIL(err, ISCHIA_E_IO, "a worker's socket cannot be set up: %s", strerror(errno));
    if (code == ISCHIA_OK) code = start(plan, &process, err);
    (void)close(pair[1]);
    if (code != ISCHIA_OK)
        (void)close(pair[0]);
    else
        *ret = process;
    return code;
}

enum ischia_code spawn_worker(const char *const *command, size_t memory_max_bytes,
                              struct spawned *ret, struct ischia_error *err)
{
    struct plan plan = {.memory_max_bytes = memory_max_bytes, .parent = getpid()};
    enum ischia_code code = plan_arguments(&plan, command, err);
    if (code == ISCHIA_OK) code = plan_environment(&plan, err);
    if (code == ISCHIA_OK) code = start_with_socket(&plan, ret, err);
    plan_finish(&plan);
    return code;
}

void spawn_kill(const struct spawned *process)
{
    /* not yet reaped, so the number is still its own; before its setpgid there is no group */
    (void)kill(-process->pid, SIGKILL);
    (void)kill(process->pid, SIGKILL);
}

static void describe(const siginfo_t *info, char ret_words[SPAWN_WORDS_BYTES])
{
    if (info->si_code == CLD_EXITED && info->si_status == EXIT_NOT_EXECUTABLE)
        (void)snprintf(ret_words, SPAWN_WORDS_BYTES, "the worker program could not be executed");
    else if (info->si_code == CLD_EXITED)
        (void)snprintf(ret_words, SPAWN_WORDS_BYTES, "exited with status %d", info->si_status);
    else
        (void)snprintf(ret_words, SPAWN_WORDS_BYTES, "killed by signal %d (%s)%s", info->si_status,
                       sigdescr_np(info->si_status) != NULL ? sigdescr_np(info->si_status)
                                                            : "unknown",
                       info->si_status == SIGKILL ? ", perhaps for want of memory" : "");
}

bool spawn_reap(struct spawned *process, bool wait, char ret_words[SPAWN_WORDS_BYTES])
{
    siginfo_t info = {0};
    int result;
    do result = waitid(P_PIDFD, (id_t)process->pid_fd, &info, WEXITED | (wait ? 0 : WNOHANG));
    while (result != 0 && errno == EINTR);
    if (result == 0 && info.si_pid == 0) return false;
    describe(&info, ret_words);
    (void)kill(-process->pid, SIGKILL); /* what it may have started */
    (void)close(process->pid_fd);
    (void)close(process->socket);
    *process = (struct spawned){.pid = -1, .pid_fd = -1, .socket = -1};
    return true;
}
