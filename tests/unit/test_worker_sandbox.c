/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What a shut-in worker may still do, and what happens when it tries more: each attempt in a child
 * of its own. */
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "server/cli/worker_sandbox.h"

enum { MAY = 0, MAY_NOT = 1, NOT_SHUT_IN = 2, NO_ROOM = 3 };

/* What an attempt is given: opened before the worker shut itself in. */
struct means {
    int socket, file;
    char path[64]; /* of a file that is not there */
};

/* Does not return, but does not say so: AddressSanitizer tidies up before what does, by calls that
 * are no longer allowed. */
static void leave(int status) { (void)syscall(SYS_exit_group, status); }

static bool refused(long result) { return result < 0 && errno == EPERM; }

static int try_to_serve(const struct means *means)
{
    char byte = 0;
    struct timespec now;
    volatile unsigned char *room = malloc(8u << 20);
    if (room == NULL) return NO_ROOM;
    memset((unsigned char *)(uintptr_t)room, 1, 8u << 20);
    const bool works = send(means->socket, "x", 1, MSG_NOSIGNAL) == 1 &&
                       read(means->socket, &byte, 1) == 1 && byte == 'y' &&
                       clock_gettime(CLOCK_MONOTONIC, &now) == 0 && room[4096] == 1;
    free((unsigned char *)(uintptr_t)room);
    return works ? MAY : MAY_NOT;
}

static int try_to_read_a_file(const struct means *means)
{
    (void)means;
    return refused(open("/etc/passwd", O_RDONLY)) ? MAY_NOT : MAY;
}

static int try_to_make_a_file(const struct means *means)
{
    return refused(open(means->path, O_WRONLY | O_CREAT, 0600)) ? MAY_NOT : MAY;
}

static int try_to_write_an_open_file(const struct means *means)
{
    return refused(write(means->file, "x", 1)) ? MAY_NOT : MAY;
}

static int try_to_remove_a_file(const struct means *means)
{
    (void)means;
    return refused(unlink("/tmp/ischia-nothing-here")) ? MAY_NOT : MAY;
}

static int try_to_end_another(const struct means *means)
{
    (void)means;
    return refused(kill(getppid(), SIGTERM)) ? MAY_NOT : MAY;
}

static int try_to_make_a_descriptor(const struct means *means)
{
    return refused(dup(means->socket)) ? MAY_NOT : MAY;
}

static int try_the_network(const struct means *means)
{
    (void)means;
    return socket(AF_INET, SOCK_STREAM, 0) >= 0 ? MAY : MAY_NOT;
}

static int try_to_connect(const struct means *means)
{
    const struct sockaddr_in where = {.sin_family = AF_INET};
    return connect(means->socket, (const struct sockaddr *)(const void *)&where, sizeof where) == 0
               ? MAY
               : MAY_NOT;
}

static int try_to_run_a_program(const struct means *means)
{
    static char name[] = "/bin/true";
    char *const argument[] = {name, NULL}, *const none[] = {NULL};
    (void)means;
    (void)execve(name, argument, none);
    return MAY_NOT;
}

static int try_to_fork(const struct means *means)
{
    (void)means;
    const long pid = syscall(SYS_fork);
    if (pid == 0) leave(0);
    return pid > 0 ? MAY : MAY_NOT;
}

/* How a child that shut itself in and tried ends: waitpid's status. */
static int end_of(int (*attempt)(const struct means *means))
{
    int pair[2], status;
    struct means means = {.path = "/tmp/ischia-sandbox-XXXXXX"};
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    means.file = mkstemp(means.path);
    assert_true(means.file >= 0);
    assert_int_equal(unlink(means.path), 0);
    assert_int_equal(write(pair[0], "y", 1), 1);
    means.socket = pair[1];
    const pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        struct ischia_error err;
        if (worker_sandbox_enter(means.socket, &err) != ISCHIA_OK) leave(NOT_SHUT_IN);
        leave(attempt(&means));
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(access(means.path, F_OK), -1);
    assert_int_equal(lseek(means.file, 0, SEEK_END), 0);
    (void)close(pair[0]);
    (void)close(pair[1]);
    (void)close(means.file);
    return status;
}

static void expect_exit(int (*attempt)(const struct means *means), int status)
{
    const int end = end_of(attempt);
    assert_true(WIFEXITED(end));
    assert_int_equal(WEXITSTATUS(end), status);
}

static void expect_death(int (*attempt)(const struct means *means))
{
    const int end = end_of(attempt);
    assert_true(WIFSIGNALED(end));
    assert_int_equal(WTERMSIG(end), SIGSYS);
}

static void test_it_can_serve(void **state)
{
    (void)state;
    expect_exit(try_to_serve, MAY);
}

static void test_files_are_out_of_reach(void **state)
{
    (void)state;
    expect_exit(try_to_read_a_file, MAY_NOT);
    expect_exit(try_to_make_a_file, MAY_NOT);
    expect_exit(try_to_write_an_open_file, MAY_NOT);
    expect_exit(try_to_remove_a_file, MAY_NOT);
    expect_exit(try_to_make_a_descriptor, MAY_NOT);
}

static void test_other_processes_are_out_of_reach(void **state)
{
    (void)state;
    expect_exit(try_to_end_another, MAY_NOT);
}

static void test_network_and_programs_are_fatal(void **state)
{
    (void)state;
    expect_death(try_the_network);
    expect_death(try_to_connect);
    expect_death(try_to_run_a_program);
    expect_death(try_to_fork);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_it_can_serve),
        cmocka_unit_test(test_files_are_out_of_reach),
        cmocka_unit_test(test_other_processes_are_out_of_reach),
        cmocka_unit_test(test_network_and_programs_are_fatal),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
