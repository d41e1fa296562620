/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_MLLP_H
#define ISCHIA_SERVER_MLLP_H

#include <stddef.h>

#include "solver/error.h"

/*
 * The Minimal Lower Layer Protocol: a message between VT (0x0B) and FS CR (0x1C 0x0D). Bytes go in
 * as they come, in pieces of any size; whole messages come out. No sockets here.
 */
enum { MLLP_START = 0x0B, MLLP_END = 0x1C, MLLP_JUNK_BYTES_MAX = 4096 };

enum mllp_event {
    MLLP_MORE,      /* all was taken, and no message is complete            */
    MLLP_MESSAGE,   /* one is complete: mllp_message                        */
    MLLP_BROKEN,    /* a frame that cannot be used; what there is of it: mllp_message */
    MLLP_TOO_LARGE, /* a frame larger than size_max: close the connection   */
    MLLP_NO_MEMORY,
    MLLP_NOT_MLLP /* too many bytes outside of any frame: close            */
};

struct mllp {
    char *bytes;
    size_t used, room, size_max;
    size_t junk; /* bytes outside of frames since the last one */
    enum { MLLP_OUTSIDE, MLLP_INSIDE, MLLP_CLOSING } state;
};

/* Outside of any frame. size_max: of one message. */
void mllp_init(struct mllp *ret, size_t size_max);
void mllp_finish(struct mllp *mllp);

/* Takes bytes until a message is complete or all are taken; *ret_taken: how many. A VT inside a
 * frame begins a new one (BROKEN first). After MESSAGE or BROKEN the next call begins afresh. */
enum mllp_event mllp_take(struct mllp *mllp, const char *bytes, size_t size, size_t *ret_taken);

/* The message of the last event, *ret_size bytes, valid until the next mllp_take. */
const char *mllp_message(const struct mllp *mllp, size_t *ret_size);

/* The frame of a message, the caller's to free. */
ISCHIA_MUST_CHECK enum ischia_code mllp_frame(const char *message, size_t size, char **ret,
                                              size_t *ret_size, struct ischia_error *err);

#endif
