/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/file.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static enum ischia_code read_stream(FILE *in, const char *path, size_t bytes_max, char **ret_text,
                                    size_t *ret_length, struct ischia_error *err)
{
    size_t length = 0, capacity = 4096;
    char *text = malloc(capacity);
    for (;;) {
        if (text == NULL) return FAIL(err, ISCHIA_E_MEMORY, "no memory to read %s", path);
        length += fread(text + length, 1, capacity - length - 1, in);
        if (length + 1 < capacity || length > bytes_max) break;
        char *larger = realloc(text, capacity *= 2);
        if (larger == NULL) free(text);
        text = larger;
    }
    enum ischia_code code = ISCHIA_OK;
    if (ferror(in)) code = FAIL(err, ISCHIA_E_IO, "reading %s failed: %s", path, strerror(errno));
    if (length > bytes_max)
        code = FAIL(err, ISCHIA_E_LIMIT, "%s is larger than %zu bytes", path, bytes_max);
    if (code != ISCHIA_OK) {
        free(text);
        return code;
    }
    text[length] = '\0';
    *ret_text = text;
    *ret_length = length;
    return ISCHIA_OK;
}

enum ischia_code file_read(const char *path, size_t bytes_max, char **ret_text, size_t *ret_length,
                           struct ischia_error *err)
{
    if (strcmp(path, "-") == 0)
        return read_stream(stdin, "standard input", bytes_max, ret_text, ret_length, err);
    FILE *in = fopen(path, "re");
    CHECK(in != NULL, err, ISCHIA_E_IO, "%s cannot be read: %s", path, strerror(errno));
    const enum ischia_code code = read_stream(in, path, bytes_max, ret_text, ret_length, err);
    (void)fclose(in);
    return code;
}

/* The rename itself is on disk only once its directory is. */
static void sync_directory_of(const char *path)
{
    char copy[PATH_MAX];
    (void)snprintf(copy, sizeof copy, "%s", path);
    const int fd = open(dirname(copy), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) return;
    (void)fsync(fd);
    (void)close(fd);
}

static enum ischia_code write_and_close(FILE *out, const char *path, const char *text,
                                        size_t length, struct ischia_error *err)
{
    const bool written =
        fwrite(text, 1, length, out) == length && fflush(out) == 0 && fsync(fileno(out)) == 0;
    const int cause = errno;
    const bool closed = fclose(out) == 0;
    CHECK(written && closed, err, ISCHIA_E_IO, "writing %s failed: %s", path,
          strerror(written ? errno : cause));
    return ISCHIA_OK;
}

static enum ischia_code write_stdout(const char *text, size_t length, struct ischia_error *err)
{
    CHECK(fwrite(text, 1, length, stdout) == length && fflush(stdout) == 0, err, ISCHIA_E_IO,
          "writing to standard output failed: %s", strerror(errno));
    return ISCHIA_OK;
}

enum ischia_code file_replace(const char *path, const char *text, size_t length,
                              struct ischia_error *err)
{
    char part[PATH_MAX];
    if (path == NULL || strcmp(path, "-") == 0) return write_stdout(text, length, err);
    const int needed = snprintf(part, sizeof part, "%s.part", path);
    CHECK(needed > 0 && (size_t)needed < sizeof part, err, ISCHIA_E_LIMIT,
          "the path %s is too long", path);
    FILE *out = fopen(part, "we");
    CHECK(out != NULL, err, ISCHIA_E_IO, "%s cannot be written: %s", part, strerror(errno));
    enum ischia_code code = write_and_close(out, part, text, length, err);
    if (code == ISCHIA_OK && rename(part, path) != 0)
        code = FAIL(err, ISCHIA_E_IO, "%s cannot be replaced: %s", path, strerror(errno));
    if (code != ISCHIA_OK) {
        (void)unlink(part);
    } else {
        sync_directory_of(path);
    }
    return code;
}
