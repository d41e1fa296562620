/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_FRAME_H
#define ISCHIA_SERVER_FRAME_H

#include <stdbool.h>
#include <stddef.h>

#include "solver/error.h"

/*
 * What travels on the socketpair between ischiad and a worker: a stream of frames of two kinds.
 *
 *   JSON line   {...}\n            one JSON object without line breaks, at most json_max bytes
 *   blob        #LENGTH\n BYTES    LENGTH in decimal, no sign, no leading zero, at most blob_max
 *
 * The messages (see docs/WORKER.md):
 *   to the worker    {"op":"solve","job":N,"case":{...}}
 *                    {"op":"render","job":N,"as":"vtu"|"svg","lang":"en",
 *                     "case":{...}}  then the field's blob
 *   from the worker  {"say":"hello","protocol":2,"program":"...","model":"...","model_version":1}
 *                    {"say":"progress","job":N,"fraction":0.5,"load_step":3,"newton_iteration":2,
 *                     "F_N":100.0,"message":"..."}
 *                    {"say":"result","job":N}   then the result object as a line, then the blob
 *                    {"say":"problem","job":N}  then the problem object as a line
 *                    {"say":"rendered","job":N} then the file as a blob
 *
 * The reader trusts nothing: a peer that breaks the form, or a limit, is not listened to again.
 * Whether a line is JSON at all is the business of api/json; here it only begins with '{'.
 */

enum { FRAME_PROTOCOL_VERSION = 2 };

struct frame_limits {
    size_t json_max; /* bytes of a line without its newline      */
    size_t blob_max; /* bytes of a blob                          */
};
extern const struct frame_limits frame_limits_default; /* 1 MiB, 256 MiB */

enum frame_kind { FRAME_NONE, FRAME_JSON, FRAME_BLOB };

struct frame {
    enum frame_kind kind;
    const char
        *bytes;  /* of a JSON frame: NUL-terminated; valid until the next call on the reader */
    size_t size; /* without newline and NUL                                                  */
};

/* Collects bytes and hands out whole frames. Zeroed is not initialised: use frame_reader_init. */
struct frame_reader {
    struct frame_limits limits;
    char *buffer;
    size_t begin, end, capacity; /* unread bytes are buffer[begin, end)   */
    size_t scanned;              /* of these, known to hold no newline    */
    bool broken;                 /* the peer broke the form: sticky       */
};

void frame_reader_init(struct frame_reader *reader, const struct frame_limits *limits);
void frame_reader_finish(struct frame_reader *reader); /* NULL-safe members; may be re-inited */

/* Room for at least one more byte: where to write (*ret_space) and how much. Memory grows with what
 * has really arrived, never with what a header promises. */
ISCHIA_MUST_CHECK enum ischia_code frame_reader_space(struct frame_reader *reader, char **ret_space,
                                                      size_t *ret_size, struct ischia_error *err);
void frame_reader_filled(struct frame_reader *reader, size_t size);

/* The next whole frame, or kind FRAME_NONE when more bytes are needed. ISCHIA_E_INPUT: the peer
 * broke the form or a limit (from then on always). */
ISCHIA_MUST_CHECK enum ischia_code
frame_reader_next(struct frame_reader *reader, struct frame *ret_frame, struct ischia_error *err);

/* One read(2) into the reader. *ret_closed: end of file. *ret_got: bytes read; 0 also when a
 * nonblocking descriptor has none now. */
ISCHIA_MUST_CHECK enum ischia_code frame_reader_read(struct frame_reader *reader, int fd,
                                                     size_t *ret_got, bool *ret_closed,
                                                     struct ischia_error *err);

/* Blocks until a frame is there. FRAME_NONE: the peer closed between frames; closing inside one is
 * ISCHIA_E_IO. */
ISCHIA_MUST_CHECK enum ischia_code frame_receive(struct frame_reader *reader, int fd,
                                                 struct frame *ret_frame, struct ischia_error *err);

/* Outgoing bytes that the peer has not taken yet. Zeroed is empty. */
struct frame_writer {
    char *buffer;
    size_t begin, end, capacity;
};
void frame_writer_finish(struct frame_writer *writer);

/* Append whole frames. json must not hold a line break (ISCHIA_E_INPUT). On error nothing is
 * appended. */
ISCHIA_MUST_CHECK enum ischia_code frame_put_json(struct frame_writer *writer, const char *json,
                                                  size_t size, struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code frame_put_blob(struct frame_writer *writer, const void *bytes,
                                                  size_t size, struct ischia_error *err);

/* Writes what the descriptor takes. *ret_empty: all of it is gone. A nonblocking descriptor that is
 * full is ISCHIA_OK with *ret_empty false; a blocking one is written to the end. Never raises
 * SIGPIPE on a socket. */
ISCHIA_MUST_CHECK enum ischia_code frame_writer_flush(struct frame_writer *writer, int fd,
                                                      bool *ret_empty, struct ischia_error *err);

#endif
