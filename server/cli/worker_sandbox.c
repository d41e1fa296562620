/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/worker_sandbox.h"

#include <errno.h>
#include <seccomp.h>
#include <signal.h>
#include <stdbool.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

/* Memory, time, signals to itself, and the end: all that solving needs. */
static const int allowed[] = {
    SCMP_SYS(brk),
    SCMP_SYS(mmap),
    SCMP_SYS(munmap),
    SCMP_SYS(mremap),
    SCMP_SYS(mprotect),
    SCMP_SYS(madvise),
    SCMP_SYS(futex),
    SCMP_SYS(sched_yield),
    SCMP_SYS(sched_getaffinity),
    SCMP_SYS(clock_gettime),
    SCMP_SYS(gettimeofday),
    SCMP_SYS(time),
    SCMP_SYS(clock_nanosleep),
    SCMP_SYS(nanosleep),
    SCMP_SYS(getrusage),
    SCMP_SYS(getrandom),
    SCMP_SYS(getpid),
    SCMP_SYS(gettid),
    SCMP_SYS(rt_sigaction),
    SCMP_SYS(rt_sigprocmask),
    SCMP_SYS(rt_sigreturn),
    SCMP_SYS(restart_syscall),
    SCMP_SYS(close),
    SCMP_SYS(exit),
    SCMP_SYS(exit_group),
};

/* What no honest worker ever tries. */
static const int fatal[] = {
    SCMP_SYS(execve), SCMP_SYS(execveat), SCMP_SYS(socket), SCMP_SYS(connect),
    SCMP_SYS(bind),   SCMP_SYS(ptrace),   SCMP_SYS(fork),   SCMP_SYS(vfork),
};

/* Allows a call whose first argument is `value`. The library's SCMP_A0 leaves a field out, which
 * clang warns about. */
static int allow_with_first(scmp_filter_ctx filter, int call, scmp_datum_t value)
{
    const struct scmp_arg_cmp first = {.arg = 0, .op = SCMP_CMP_EQ, .datum_a = value, .datum_b = 0};
    return seccomp_rule_add_array(filter, SCMP_ACT_ALLOW, call, 1, &first);
}

static int allow_on(scmp_filter_ctx filter, int call, int descriptor)
{
    return allow_with_first(filter, call, (scmp_datum_t)descriptor);
}

static int allow_to_itself(scmp_filter_ctx filter)
{
    return allow_with_first(filter, SCMP_SYS(tgkill), (scmp_datum_t)getpid());
}

static int fill(scmp_filter_ctx filter, int socket)
{
    int code = 0;
    for (size_t i = 0; code == 0 && i < sizeof allowed / sizeof allowed[0]; i++)
        code = seccomp_rule_add(filter, SCMP_ACT_ALLOW, allowed[i], 0);
    for (size_t i = 0; code == 0 && i < sizeof fatal / sizeof fatal[0]; i++)
        code = seccomp_rule_add(filter, SCMP_ACT_KILL_PROCESS, fatal[i], 0);
    if (code == 0) code = allow_on(filter, SCMP_SYS(read), socket);
    if (code == 0) code = allow_on(filter, SCMP_SYS(sendto), socket);
    if (code == 0) code = allow_on(filter, SCMP_SYS(write), STDERR_FILENO);
    return code == 0 ? allow_to_itself(filter) : code;
}

static enum ischia_code filter_calls(int socket, struct ischia_error *err)
{
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
    CHECK(filter != NULL, err, ISCHIA_E_MEMORY, "no memory for the system call filter");
    int code = fill(filter, socket);
    if (code == 0) code = seccomp_load(filter);
    seccomp_release(filter);
    CHECK(code == 0, err, ISCHIA_E_IO, "the system call filter cannot be set: %s", strerror(-code));
    return ISCHIA_OK;
}

enum ischia_code worker_sandbox_enter(int socket, struct ischia_error *err)
{
    const struct rlimit none = {0, 0};
    /* not RLIMIT_FSIZE: standard error may be a file */
    const bool limited = setrlimit(RLIMIT_CORE, &none) == 0 && setrlimit(RLIMIT_NOFILE, &none) == 0;
    CHECK(limited, err, ISCHIA_E_IO, "the worker's limits cannot be set: %s", strerror(errno));
    CHECK(prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) == 0, err,
          ISCHIA_E_IO, "the worker cannot be tied to the daemon: %s", strerror(errno));
    return filter_calls(socket, err);
}
