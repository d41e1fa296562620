/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/log.h"

#include <errno.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

const char *const log_level_names[] = {
    [LOG_LEVEL_DEBUG] = "debug",
    [LOG_LEVEL_INFO] = "info",
    [LOG_LEVEL_WARNING] = "warning",
    [LOG_LEVEL_ERROR] = "error",
    NULL,
};

/* syslog's numbers, which the journal sorts by. */
static const int journal_priority[] = {
    [LOG_LEVEL_DEBUG] = 7,
    [LOG_LEVEL_INFO] = 6,
    [LOG_LEVEL_WARNING] = 4,
    [LOG_LEVEL_ERROR] = 3,
};

enum { LINE_BYTES = 1024 };

static atomic_int least_level = LOG_LEVEL_INFO;
static int journal_socket = -1;

/* systemd.exec(5): $JOURNAL_STREAM is "device:inode" of stderr when that is the journal. */
static bool stderr_is_journal(void)
{
    const char *stream = getenv("JOURNAL_STREAM");
    struct stat status;
    char own[64];
    if (stream == NULL || fstat(STDERR_FILENO, &status) != 0) return false;
    (void)snprintf(own, sizeof own, "%lu:%lu", (unsigned long)status.st_dev,
                   (unsigned long)status.st_ino);
    return strcmp(stream, own) == 0;
}

static int connect_journal(void)
{
    const struct sockaddr_un address = {.sun_family = AF_UNIX,
                                        .sun_path = "/run/systemd/journal/socket"};
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return -1;
    if (connect(fd, (const struct sockaddr *)&address, sizeof address) == 0) return fd;
    (void)close(fd);
    return -1;
}

void log_init(enum log_level least)
{
    log_set_level(least);
    if (journal_socket < 0 && stderr_is_journal()) journal_socket = connect_journal();
}

void log_set_level(enum log_level least) { atomic_store(&least_level, (int)least); }

void log_finish(void)
{
    if (journal_socket >= 0) (void)close(journal_socket);
    journal_socket = -1;
}

static size_t escape(char *to, char c)
{
    static const char hex[] = "0123456789abcdef";
    if (c == '"' || c == '\\') {
        to[0] = '\\';
        to[1] = c;
        return 2;
    }
    if ((unsigned char)c >= 0x20 && c != 0x7f) {
        to[0] = c;
        return 1;
    }
    to[0] = '\\';
    to[1] = 'x';
    to[2] = hex[(unsigned char)c >> 4];
    to[3] = hex[(unsigned char)c & 15];
    return 4;
}

const char *log_quote(struct log_value *ret, const char *value)
{
    size_t used = 0;
    ret->text[used++] = '"';
    for (; *value != '\0' && used < sizeof ret->text - 6; value++)
        used += escape(ret->text + used, *value);
    ret->text[used++] = '"';
    ret->text[used] = '\0';
    return ret->text;
}

static size_t format_time(char *to, size_t size)
{
    struct timespec now;
    struct tm parts;
    char date[32];
    (void)clock_gettime(CLOCK_REALTIME, &now);
    (void)gmtime_r(&now.tv_sec, &parts);
    (void)strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", &parts);
    const int n = snprintf(to, size, "time=%s.%03ldZ ", date, now.tv_nsec / 1000000);
    return n > 0 ? (size_t)n : 0;
}

/* The journal's own format: FIELD=value lines in one datagram. */
static bool send_to_journal(enum log_level level, const char *message)
{
    char datagram[LINE_BYTES + 128];
    const int n =
        snprintf(datagram, sizeof datagram, "PRIORITY=%d\nSYSLOG_IDENTIFIER=ischiad\nMESSAGE=%s\n",
                 journal_priority[level], message);
    if (n <= 0 || (size_t)n >= sizeof datagram) return false;
    return send(journal_socket, datagram, (size_t)n, MSG_NOSIGNAL) == n;
}

void log_event(enum log_level level, const char *event, const char *format, ...)
{
    char line[LINE_BYTES], message[LINE_BYTES - 80];
    struct log_value quoted;
    va_list arguments;
    if ((int)level < atomic_load_explicit(&least_level, memory_order_relaxed)) return;
    int used = snprintf(message, sizeof message, "level=%s event=%s%s", log_level_names[level],
                        log_quote(&quoted, event), format[0] == '\0' ? "" : " ");
    if (used < 0 || (size_t)used >= sizeof message) return;
    va_start(arguments, format);
    (void)vsnprintf(message + used, sizeof message - (size_t)used, format, arguments);
    va_end(arguments);
    if (journal_socket >= 0 && send_to_journal(level, message)) return;
    size_t length = format_time(line, sizeof line);
    const int n = snprintf(line + length, sizeof line - length, "%s\n", message);
    if (n <= 0) return;
    length += (size_t)n < sizeof line - length ? (size_t)n : sizeof line - length - 1;
    /* One write a line keeps lines of several threads apart; a log that cannot be written has
     * nowhere to complain. */
    const ssize_t written = write(STDERR_FILENO, line, length);
    (void)written;
}
