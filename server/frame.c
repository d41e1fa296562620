/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/frame.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { READ_ROOM = 64 * 1024, KEEP_MAX = 1024 * 1024, LENGTH_DIGITS_MAX = 12 };

const struct frame_limits frame_limits_default = {.json_max = 1024 * 1024,
                                                  .blob_max = 256 * 1024 * 1024};

/* ------------------------------------------------------------------------------- reading */

void frame_reader_init(struct frame_reader *reader, const struct frame_limits *limits)
{
    *reader = (struct frame_reader){.limits = *limits};
}

void frame_reader_finish(struct frame_reader *reader)
{
    free(reader->buffer);
    *reader = (struct frame_reader){0};
}

/* Moves what is unread to the front, so that frames that were handed out make room. */
static void compact(struct frame_reader *reader)
{
    if (reader->begin == 0) return;
    memmove(reader->buffer, reader->buffer + reader->begin, reader->end - reader->begin);
    reader->end -= reader->begin;
    reader->begin = 0;
}

/* One byte beyond the capacity is kept for the NUL behind a line that ends the buffer. */
static enum ischia_code grow(char **buffer, size_t *capacity, size_t wanted,
                             struct ischia_error *err)
{
    size_t larger = *capacity == 0 ? READ_ROOM : *capacity;
    while (larger < wanted) larger *= 2;
    char *moved = realloc(*buffer, larger + 1);
    CHECK(moved != NULL, err, ISCHIA_E_MEMORY, "no memory for a message of %zu bytes", wanted);
    *buffer = moved;
    *capacity = larger;
    return ISCHIA_OK;
}

enum ischia_code frame_reader_space(struct frame_reader *reader, char **ret_space, size_t *ret_size,
                                    struct ischia_error *err)
{
    compact(reader);
    if (reader->end == 0 && reader->capacity > KEEP_MAX) { /* a large blob has been handed out */
        free(reader->buffer);
        reader->buffer = NULL;
        reader->capacity = 0;
    }
    if (reader->end == reader->capacity)
        TRY(grow(&reader->buffer, &reader->capacity, reader->end + 1, err));
    *ret_space = reader->buffer + reader->end;
    *ret_size = reader->capacity - reader->end;
    return ISCHIA_OK;
}

void frame_reader_filled(struct frame_reader *reader, size_t size)
{
    assert(size <= reader->capacity - reader->end);
    reader->end += size;
}

static enum ischia_code refuse(struct frame_reader *reader, enum ischia_code code,
                               const char *reason, struct ischia_error *err)
{
    reader->broken = true;
    return FAIL(err, code, "the peer broke the protocol: %s", reason);
}

/* A newline at most `most` bytes into the unread ones; NULL if there is none yet. */
static char *find_newline(struct frame_reader *reader, size_t most)
{
    const size_t unread = reader->end - reader->begin;
    const size_t until = unread < most + 1 ? unread : most + 1;
    if (reader->scanned >= until) return NULL;
    char *from = reader->buffer + reader->begin + reader->scanned;
    char *found = memchr(from, '\n', until - reader->scanned);
    if (found == NULL) reader->scanned = until;
    return found;
}

static void hand_out(struct frame_reader *reader, enum frame_kind kind, char *bytes, size_t size,
                     char *after, struct frame *ret_frame)
{
    reader->begin = (size_t)(after - reader->buffer);
    reader->scanned = 0;
    *ret_frame = (struct frame){.kind = kind, .bytes = bytes, .size = size};
}

static enum ischia_code next_line(struct frame_reader *reader, struct frame *ret_frame,
                                  struct ischia_error *err)
{
    char *line = reader->buffer + reader->begin;
    char *newline = find_newline(reader, reader->limits.json_max);
    if (newline == NULL) {
        if (reader->end - reader->begin > reader->limits.json_max)
            return refuse(reader, ISCHIA_E_INPUT, "a line is too long", err);
        return ISCHIA_OK;
    }
    const size_t size = (size_t)(newline - line);
    if (memchr(line, '\0', size) != NULL)
        return refuse(reader, ISCHIA_E_INPUT, "a NUL byte in a line", err);
    *newline = '\0';
    hand_out(reader, FRAME_JSON, line, size, newline + 1, ret_frame);
    return ISCHIA_OK;
}

/* Digits only, no leading zero unless it is all; false when it is not such a number. */
static bool read_length(const char *digits, size_t count, size_t *ret)
{
    size_t value = 0;
    if (count == 0 || count > LENGTH_DIGITS_MAX || (count > 1 && digits[0] == '0')) return false;
    for (size_t i = 0; i < count; i++) {
        if (digits[i] < '0' || digits[i] > '9') return false;
        value = value * 10 + (size_t)(digits[i] - '0');
    }
    *ret = value;
    return true;
}

static enum ischia_code next_blob(struct frame_reader *reader, struct frame *ret_frame,
                                  struct ischia_error *err)
{
    char *digits = reader->buffer + reader->begin + 1;
    char *newline = find_newline(reader, 1 + LENGTH_DIGITS_MAX);
    if (newline == NULL) {
        if (reader->end - reader->begin > 1 + LENGTH_DIGITS_MAX)
            return refuse(reader, ISCHIA_E_INPUT, "a blob's length does not end", err);
        return ISCHIA_OK;
    }
    size_t size = 0;
    if (!read_length(digits, (size_t)(newline - digits), &size))
        return refuse(reader, ISCHIA_E_INPUT, "a blob's length is not a number", err);
    if (size > reader->limits.blob_max)
        return refuse(reader, ISCHIA_E_INPUT, "a blob is too long", err);
    char *bytes = newline + 1;
    if ((size_t)(reader->buffer + reader->end - bytes) < size) {
        reader->scanned = 0; /* its short head is looked at again */
        return ISCHIA_OK;
    }
    hand_out(reader, FRAME_BLOB, bytes, size, bytes + size, ret_frame);
    return ISCHIA_OK;
}

enum ischia_code frame_reader_next(struct frame_reader *reader, struct frame *ret_frame,
                                   struct ischia_error *err)
{
    CHECK(!reader->broken, err, ISCHIA_E_INPUT, "the peer broke the protocol before");
    *ret_frame = (struct frame){.kind = FRAME_NONE};
    if (reader->begin == reader->end) return ISCHIA_OK;
    switch (reader->buffer[reader->begin]) {
    case '{':
        return next_line(reader, ret_frame, err);
    case '#':
        return next_blob(reader, ret_frame, err);
    default:
        return refuse(reader, ISCHIA_E_INPUT, "neither a JSON object nor a blob", err);
    }
}

enum ischia_code frame_reader_read(struct frame_reader *reader, int fd, size_t *ret_got,
                                   bool *ret_closed, struct ischia_error *err)
{
    char *space;
    size_t room;
    TRY(frame_reader_space(reader, &space, &room, err));
    ssize_t got;
    do got = read(fd, space, room);
    while (got < 0 && errno == EINTR);
    *ret_closed = got == 0;
    *ret_got = got > 0 ? (size_t)got : 0;
    if (got > 0) frame_reader_filled(reader, (size_t)got);
    if (got >= 0 || errno == EAGAIN) return ISCHIA_OK;
    if (errno == ECONNRESET) { /* a peer that died with unread messages */
        *ret_closed = true;
        return ISCHIA_OK;
    }
    return FAIL(err, ISCHIA_E_IO, "the peer cannot be read: %s", strerror(errno));
}

enum ischia_code frame_receive(struct frame_reader *reader, int fd, struct frame *ret_frame,
                               struct ischia_error *err)
{
    size_t got;
    for (bool closed = false;;) {
        TRY(frame_reader_next(reader, ret_frame, err));
        if (ret_frame->kind != FRAME_NONE) return ISCHIA_OK;
        CHECK(!closed || reader->begin == reader->end, err, ISCHIA_E_IO,
              "the peer closed in the middle of a message");
        if (closed) return ISCHIA_OK;
        TRY(frame_reader_read(reader, fd, &got, &closed, err));
    }
}

/* ------------------------------------------------------------------------------- writing */

void frame_writer_finish(struct frame_writer *writer)
{
    free(writer->buffer);
    *writer = (struct frame_writer){0};
}

static enum ischia_code make_room(struct frame_writer *writer, size_t size,
                                  struct ischia_error *err)
{
    if (writer->begin > 0) {
        memmove(writer->buffer, writer->buffer + writer->begin, writer->end - writer->begin);
        writer->end -= writer->begin;
        writer->begin = 0;
    }
    if (writer->capacity - writer->end >= size) return ISCHIA_OK;
    return grow(&writer->buffer, &writer->capacity, writer->end + size, err);
}

static void append(struct frame_writer *writer, const void *bytes, size_t size)
{
    if (size > 0) memcpy(writer->buffer + writer->end, bytes, size);
    writer->end += size;
}

enum ischia_code frame_put_json(struct frame_writer *writer, const char *json, size_t size,
                                struct ischia_error *err)
{
    CHECK(size > 0 && json[0] == '{' && memchr(json, '\n', size) == NULL, err, ISCHIA_E_INPUT,
          "a message must be a JSON object on one line");
    TRY(make_room(writer, size + 1, err));
    append(writer, json, size);
    append(writer, "\n", 1);
    return ISCHIA_OK;
}

enum ischia_code frame_put_blob(struct frame_writer *writer, const void *bytes, size_t size,
                                struct ischia_error *err)
{
    char head[LENGTH_DIGITS_MAX + 16];
    const int length = snprintf(head, sizeof head, "#%zu\n", size);
    CHECK(length > 0 && length <= LENGTH_DIGITS_MAX + 2, err, ISCHIA_E_LIMIT,
          "a blob of %zu bytes is too long to be sent", size);
    TRY(make_room(writer, (size_t)length + size, err));
    append(writer, head, (size_t)length);
    append(writer, bytes, size);
    return ISCHIA_OK;
}

enum ischia_code frame_writer_flush(struct frame_writer *writer, int fd, bool *ret_empty,
                                    struct ischia_error *err)
{
    *ret_empty = false;
    while (writer->begin < writer->end) {
        const ssize_t sent =
            send(fd, writer->buffer + writer->begin, writer->end - writer->begin, MSG_NOSIGNAL);
        if (sent >= 0) {
            writer->begin += (size_t)sent;
            continue;
        }
        if (errno == EINTR) continue;
        if (errno == EAGAIN) return ISCHIA_OK;
        return FAIL(err, ISCHIA_E_IO, "the peer cannot be written to: %s", strerror(errno));
    }
    frame_writer_finish(writer); /* a large job's memory is not kept for the next one */
    *ret_empty = true;
    return ISCHIA_OK;
}
