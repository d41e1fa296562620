/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Anything a worker could send: frames cut anywhere, and the messages in them. The first byte says
 * how many bytes arrive at a time. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "server/frame.h"
#include "server/message.h"
#include "tests/fuzz/fuzz.h"

static void look_at(const struct frame *frame)
{
    struct message message;
    struct ischia_error err;
    if (frame->kind != FRAME_JSON) return;
    MUST(frame->bytes[frame->size] == '\0' && strlen(frame->bytes) == frame->size);
    if (message_read(frame->bytes, frame->size, &message, &err) == ISCHIA_OK)
        free(message.case_json);
    (void)message_is_object(frame->bytes, frame->size);
}

/* False when the reader has refused the stream, which it must then do for ever. */
static int take_all(struct frame_reader *reader)
{
    struct frame frame;
    struct ischia_error err;
    do {
        if (frame_reader_next(reader, &frame, &err) != ISCHIA_OK) {
            MUST(frame_reader_next(reader, &frame, &err) == ISCHIA_E_INPUT);
            return 0;
        }
        look_at(&frame);
    } while (frame.kind != FRAME_NONE);
    return 1;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const struct frame_limits limits = {.json_max = 4096, .blob_max = 1 << 20};
    struct frame_reader reader;
    if (size == 0) return 0;
    const size_t piece = data[0] % 64 + 1u;
    frame_reader_init(&reader, &limits);
    for (size_t at = 1; at < size;) {
        char *space;
        size_t room;
        if (frame_reader_space(&reader, &space, &room, NULL) != ISCHIA_OK) break;
        size_t part = size - at < piece ? size - at : piece;
        if (part > room) part = room;
        memcpy(space, data + at, part);
        frame_reader_filled(&reader, part);
        at += part;
        if (!take_all(&reader)) break;
    }
    frame_reader_finish(&reader);
    return 0;
}
