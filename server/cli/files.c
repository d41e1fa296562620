/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/cli/files.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

static bool is_dash(const char *path) { return strcmp(path, "-") == 0; }

const char *file_name(const char *path) { return is_dash(path) ? "standard input" : path; }

/* ---- reading ---- */

enum ischia_code file_open(const char *path, FILE **ret, struct ischia_error *err)
{
    struct stat status;
    if (is_dash(path)) {
        *ret = stdin;
        return ISCHIA_OK;
    }
    FILE *in = fopen(path, "re");
    CHECK(in != NULL, err, errno == ENOMEM ? ISCHIA_E_MEMORY : ISCHIA_E_INPUT, "cannot open %s: %s",
          path, strerror(errno));
    if (fstat(fileno(in), &status) == 0 && S_ISDIR(status.st_mode)) {
        (void)fclose(in);
        return FAIL(err, ISCHIA_E_INPUT, "%s is a directory; give a file", path);
    }
    *ret = in;
    return ISCHIA_OK;
}

void file_close(FILE *in)
{
    if (in != NULL && in != stdin) (void)fclose(in);
}

static enum ischia_code read_stream(FILE *in, const char *path, size_t bytes_max, char **ret_text,
                                    size_t *ret_length, struct ischia_error *err)
{
    char *text = malloc(bytes_max + 2); /* one byte more than accepted shows that there is more */
    CHECK(text != NULL, err, ISCHIA_E_MEMORY, "out of memory while reading %s", path);
    const size_t length = fread(text, 1, bytes_max + 1, in);
    if (ferror(in) || length > bytes_max) {
        free(text);
        CHECK(!ferror(in), err, ISCHIA_E_IO, "cannot read %s: %s", path, strerror(errno));
        return FAIL(err, ISCHIA_E_LIMIT, "%s is larger than the accepted %zu KiB", path,
                    bytes_max / 1024);
    }
    text[length] = '\0';
    *ret_text = text;
    *ret_length = length;
    return ISCHIA_OK;
}

enum ischia_code file_read(const char *path, size_t bytes_max, char **ret_text, size_t *ret_length,
                           struct ischia_error *err)
{
    FILE *in = NULL;
    TRY(file_open(path, &in, err));
    const enum ischia_code code =
        read_stream(in, file_name(path), bytes_max, ret_text, ret_length, err);
    file_close(in);
    return code;
}

/* ---- where an output can go ---- */

static bool is_same_regular(const struct stat *a, const struct stat *b)
{
    return S_ISREG(a->st_mode) && a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

static enum ischia_code refuse_input(const char *path, struct ischia_error *err)
{
    return FAIL(err, ISCHIA_E_INPUT, "%s is the input; write the results to another file", path);
}

static enum ischia_code check_folder(const char *path, struct ischia_error *err)
{
    const char *slash = strrchr(path, '/');
    char *folder = slash == NULL ? strdup(".") : strndup(path, (size_t)(slash - path) + 1);
    CHECK(folder != NULL, err, ISCHIA_E_MEMORY, "out of memory");
    const int failed = access(folder, W_OK | X_OK);
    const int reason = errno;
    free(folder);
    CHECK(failed == 0, err, ISCHIA_E_IO, "cannot write %s: %s", path, strerror(reason));
    return ISCHIA_OK;
}

enum ischia_code file_out_check(const char *path, const char *const *inputs, size_t count,
                                struct ischia_error *err)
{
    struct stat there, input;
    if (path == NULL || is_dash(path)) return ISCHIA_OK;
    if (stat(path, &there) != 0) return check_folder(path, err);
    CHECK(!S_ISDIR(there.st_mode), err, ISCHIA_E_INPUT, "%s is a directory; give a file", path);
    for (size_t i = 0; i < count; i++)
        if (inputs[i] != NULL && !is_dash(inputs[i]) && stat(inputs[i], &input) == 0 &&
            is_same_regular(&there, &input))
            return refuse_input(path, err);
    return S_ISREG(there.st_mode) ? check_folder(path, err) : ISCHIA_OK;
}

/* ---- a file that appears when it is complete ---- */

/* Whether writing goes straight to what is there already: a device, a pipe, a terminal. */
static bool writes_directly(const char *path)
{
    struct stat status;
    return stat(path, &status) == 0 && !S_ISREG(status.st_mode);
}

static enum ischia_code open_temporary(struct file_out *ret, struct ischia_error *err)
{
    char *name;
    CHECK(asprintf(&name, "%s.XXXXXX", ret->path) >= 0, err, ISCHIA_E_MEMORY, "out of memory");
    const int fd = mkostemp(name, O_CLOEXEC);
    ret->stream = fd >= 0 ? fdopen(fd, "w") : NULL;
    if (ret->stream == NULL) {
        const int reason = errno;
        if (fd >= 0) (void)unlink(name);
        if (fd >= 0) (void)close(fd);
        free(name);
        return FAIL(err, ISCHIA_E_IO, "cannot write %s: %s", ret->path, strerror(reason));
    }
    ret->temporary = name;
    return ISCHIA_OK;
}

enum ischia_code file_out_open(struct file_out *ret, const char *path, struct ischia_error *err)
{
    *ret = (struct file_out){.path = path};
    if (!is_dash(path) && !writes_directly(path)) return open_temporary(ret, err);
    ret->stream = is_dash(path) ? stdout : fopen(path, "we");
    CHECK(ret->stream != NULL, err, ISCHIA_E_IO, "cannot write %s: %s", path, strerror(errno));
    return ISCHIA_OK;
}

/* mkostemp made it readable by its owner alone; the file is to be like any other. */
static int put_in_place(const struct file_out *out)
{
    const mode_t mask = umask(0);
    (void)umask(mask);
    if (chmod(out->temporary, 0666 & ~mask) != 0) return -1;
    return rename(out->temporary, out->path);
}

enum ischia_code file_out_close(struct file_out *out, enum ischia_code code,
                                struct ischia_error *err)
{
    int failed = fflush(out->stream) != 0 || ferror(out->stream);
    if (out->temporary != NULL) failed |= fsync(fileno(out->stream));
    if (out->stream != stdout) failed |= fclose(out->stream);
    if (out->temporary != NULL && code == ISCHIA_OK && !failed) failed = put_in_place(out);
    const int reason = errno;
    if (out->temporary != NULL && (failed || code != ISCHIA_OK)) (void)unlink(out->temporary);
    free(out->temporary);
    if (code == ISCHIA_OK && failed)
        return FAIL(err, ISCHIA_E_IO, "cannot write %s: %s", out->path, strerror(reason));
    return code;
}

/* ---- whole lines ---- */

static bool is_same_file(int fd, FILE *in)
{
    struct stat a, b;
    return in != NULL && fstat(fd, &a) == 0 && fstat(fileno(in), &b) == 0 &&
           is_same_regular(&a, &b);
}

/* Two writers would cut each other's lines. The lock ends with the process. */
static enum ischia_code lock_and_empty(const struct line_out *out, struct ischia_error *err)
{
    if (!out->is_regular) return ISCHIA_OK;
    CHECK(flock(out->fd, LOCK_EX | LOCK_NB) == 0, err, ISCHIA_E_INPUT,
          "%s is being written by another process", out->path);
    CHECK(ftruncate(out->fd, 0) == 0, err, ISCHIA_E_IO, "cannot write %s: %s", out->path,
          strerror(errno));
    return ISCHIA_OK;
}

static enum ischia_code open_lines(struct line_out *out, FILE *in, struct ischia_error *err)
{
    struct stat status;
    out->fd = open(out->path, O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
    CHECK(out->fd >= 0, err, ISCHIA_E_IO, "cannot write %s: %s", out->path, strerror(errno));
    out->is_regular = fstat(out->fd, &status) == 0 && S_ISREG(status.st_mode);
    const enum ischia_code code =
        is_same_file(out->fd, in) ? refuse_input(out->path, err) : lock_and_empty(out, err);
    if (code != ISCHIA_OK) (void)close(out->fd);
    return code;
}

enum ischia_code line_out_open(struct line_out *ret, const char *path, FILE *in,
                               struct ischia_error *err)
{
    struct line_out out = {.fd = STDOUT_FILENO, .path = is_dash(path) ? "standard output" : path};
    if (!is_dash(path)) TRY(open_lines(&out, in, err));
    /* Appending to what is being read would never end. */
    if (is_dash(path) && is_same_file(out.fd, in)) return refuse_input(out.path, err);
    *ret = out;
    return ISCHIA_OK;
}

/* One write for all the lines, so that being killed leaves all or none; a full disk may still take
 * a part of them, which is cut off again. */
enum ischia_code line_out_write(struct line_out *out, const char *lines, size_t length,
                                struct ischia_error *err)
{
    for (size_t done = 0; done < length;) {
        const ssize_t step = write(out->fd, lines + done, length - done);
        if (step >= 0) {
            done += (size_t)step;
        } else if (errno != EINTR) {
            const int reason = errno;
            if (out->is_regular && ftruncate(out->fd, out->whole) != 0)
                return FAIL(err, ISCHIA_E_IO, "cannot write %s: %s; its last line is cut",
                            out->path, strerror(reason));
            return FAIL(err, ISCHIA_E_IO, "cannot write %s: %s", out->path, strerror(reason));
        }
    }
    out->whole += (off_t)length;
    return ISCHIA_OK;
}

enum ischia_code line_out_close(struct line_out *out, struct ischia_error *err)
{
    if (out->fd == STDOUT_FILENO) return ISCHIA_OK;
    const bool synced = !out->is_regular || fsync(out->fd) == 0;
    const int reason = errno;
    CHECK(close(out->fd) == 0 && synced, err, ISCHIA_E_IO, "cannot write %s: %s", out->path,
          strerror(reason));
    return ISCHIA_OK;
}
