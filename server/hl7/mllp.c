/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/hl7/mllp.h"

#include <stdlib.h>
#include <string.h>

void mllp_init(struct mllp *ret, size_t size_max)
{
    *ret = (struct mllp){.size_max = size_max, .state = MLLP_OUTSIDE};
}

void mllp_finish(struct mllp *mllp)
{
    free(mllp->bytes);
    mllp->bytes = NULL;
}

static enum mllp_event keep(struct mllp *m, char c)
{
    if (m->used == m->size_max) return MLLP_TOO_LARGE;
    if (m->used == m->room) {
        const size_t room = m->room == 0 ? 4096 : 2 * m->room;
        char *bytes = realloc(m->bytes, room);
        if (bytes == NULL) return MLLP_NO_MEMORY;
        m->bytes = bytes;
        m->room = room;
    }
    m->bytes[m->used++] = c;
    return MLLP_MORE;
}

static enum mllp_event outside(struct mllp *m, char c)
{
    if (c == MLLP_START) {
        m->state = MLLP_INSIDE;
        m->used = m->junk = 0;
        return MLLP_MORE;
    }
    return ++m->junk > MLLP_JUNK_BYTES_MAX ? MLLP_NOT_MLLP : MLLP_MORE;
}

static enum mllp_event inside(struct mllp *m, char c)
{
    if (c == MLLP_END) {
        m->state = MLLP_CLOSING;
        return MLLP_MORE;
    }
    return keep(m, c);
}

enum mllp_event mllp_take(struct mllp *m, const char *bytes, size_t size, size_t *ret_taken)
{
    enum mllp_event event = MLLP_MORE;
    size_t i = 0;
    while (i < size && event == MLLP_MORE) {
        const char c = bytes[i];
        if (m->state == MLLP_OUTSIDE) {
            event = outside(m, c);
        } else if (m->state == MLLP_INSIDE && c != MLLP_START) {
            event = inside(m, c);
        } else if (m->state == MLLP_CLOSING && c == '\r') {
            m->state = MLLP_OUTSIDE;
            event = MLLP_MESSAGE;
        } else { /* VT inside a frame, or FS without CR */
            m->state = MLLP_OUTSIDE;
            event = MLLP_BROKEN;
            if (c == MLLP_START) break; /* not taken: it begins the next frame */
        }
        i++;
    }
    *ret_taken = i;
    return event;
}

const char *mllp_message(const struct mllp *mllp, size_t *ret_size)
{
    *ret_size = mllp->used;
    return mllp->used == 0 ? "" : mllp->bytes;
}

enum ischia_code mllp_frame(const char *message, size_t size, char **ret, size_t *ret_size,
                            struct ischia_error *err)
{
    char *frame = malloc(size + 3);
    CHECK(frame != NULL, err, ISCHIA_E_MEMORY, "no memory for a message");
    frame[0] = MLLP_START;
    memcpy(frame + 1, message, size);
    frame[size + 1] = MLLP_END;
    frame[size + 2] = '\r';
    *ret = frame;
    *ret_size = size + 3;
    return ISCHIA_OK;
}
