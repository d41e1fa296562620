/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <stdlib.h>
#include <string.h>

#include "api/problem_doc.h"
#include "server/http/reply.h"
#include "server/http/routes.h"

/* The deformed model as a file, drawn by a render worker from what the store keeps of it. */

struct drawing {
    enum pool_render_kind kind;
    const char *type, *suffix;
    bool has_words;
};

/* A file without words is one file, whoever asks. */
static enum language drawing_language(const struct call *call, const struct drawing *drawing)
{
    return drawing->has_words ? reply_language(call->request) : LANGUAGE_EN;
}

static void on_drawn(void *context, enum ischia_code code, const unsigned char *bytes, size_t size,
                     const struct ischia_error *err)
{
    struct deferred *deferred = context;
    deferred->code = code;
    if (code != ISCHIA_OK) {
        deferred->err = *err;
    } else {
        deferred->bytes = malloc(size + 1);
        deferred->size = size;
        if (deferred->bytes != NULL)
            memcpy(deferred->bytes, bytes, size);
        else
            deferred->code = FAIL(&deferred->err, ISCHIA_E_MEMORY, "no memory for a drawing");
    }
    deferred_complete(deferred);
}

static void refuse_unfinished(struct call *call, enum queue_state state, struct http_response *ret)
{
    if (queue_is_final(state))
        reply_refusal(
            call->request, ret, PROBLEM_CONFLICT, WORD_DAEMON_REFUSAL_NO_FIELD,
            WORDS(word_text("status", reply_state(reply_language(call->request), state))));
    else
        reply_refusal(
            call->request, ret, PROBLEM_CONFLICT, WORD_DAEMON_REFUSAL_FIELD_LATER,
            WORDS(word_text("status", reply_state(reply_language(call->request), state))));
}

static void reply_render_failure(struct call *call, const struct ischia_error *err,
                                 struct http_response *ret)
{
    if (err->code != ISCHIA_E_LIMIT) {
        reply_failure(call->request, ret, err);
        return;
    }
    http_header_static(ret, "Retry-After", "5");
    reply_refusal(call->request, ret, PROBLEM_UNAVAILABLE, WORD_DAEMON_REFUSAL_DRAWINGS, NULL);
}

/* Gives the render worker its work; `row` is the assessment. */
static void ask_for_drawing(struct call *call, const struct store_assessment *row,
                            const struct drawing *drawing, struct http_response *ret)
{
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    unsigned char *field = NULL;
    size_t size = 0;
    enum ischia_code code =
        store_get_field(call->service->store, &call->id, &field, &size, &answer, &err);
    if (code == ISCHIA_OK && answer != STORE_DONE) {
        refuse_unfinished(call, row->state, ret);
        return;
    }
    struct deferred *deferred = code == ISCHIA_OK ? deferred_create(call) : NULL;
    if (code == ISCHIA_OK && deferred == NULL)
        code = FAIL(&err, ISCHIA_E_MEMORY, "no memory for a drawing");
    if (code == ISCHIA_OK) {
        code = pool_render(queue_pool(call->service->queue), drawing->kind,
                           language_tags[drawing_language(call, drawing)], row->case_json, field,
                           size, on_drawn, deferred, &err);
        if (code != ISCHIA_OK) { /* the callback will not come: give up its share */
            http_release(deferred->exchange);
            deferred_drop(deferred);
        }
    }
    free(field);
    if (code != ISCHIA_OK) {
        reply_render_failure(call, &err, ret);
        return;
    }
    ret->action = HTTP_WAIT;
    ret->wake_at_ms = INT64_MAX / 4; /* the pool has its own deadline and always answers */
}

static void put_tag(const struct call *call, const struct drawing *drawing,
                    struct http_response *ret)
{
    /* A finished field never changes, but a newer program may draw it otherwise. */
    (void)snprintf(ret->etag, sizeof ret->etag, "\"%s-%s-%s-%s\"", call->id_text, drawing->suffix,
                   language_tags[drawing_language(call, drawing)], ISCHIA_VERSION);
    if (drawing->has_words) reply_put_language(call->request, ret);
    http_header_static(ret, "Cache-Control", "no-cache, private");
}

static void begin_drawing(struct call *call, const struct drawing *drawing,
                          struct http_response *ret)
{
    struct store_assessment row;
    struct ischia_error err;
    enum store_answer answer = STORE_DONE;
    memset(&row, 0, sizeof row);
    if (store_get(call->service->store, &call->id, &row, &answer, &err) != ISCHIA_OK) {
        reply_failure(call->request, ret, &err);
        return;
    }
    if (answer != STORE_DONE) {
        reply_no_assessment(call, ret);
        return;
    }
    if (row.state != QUEUE_SUCCEEDED) {
        refuse_unfinished(call, row.state, ret);
    } else {
        put_tag(call, drawing, ret);
        if (!reply_not_modified(call->request, ret)) ask_for_drawing(call, &row, drawing, ret);
    }
    store_assessment_finish(&row);
}

static void finish_drawing(struct call *call, const struct drawing *drawing,
                           struct http_response *ret)
{
    struct deferred *deferred = call->deferred;
    if (deferred->code != ISCHIA_OK) {
        reply_render_failure(call, &deferred->err, ret);
        return;
    }
    put_tag(call, drawing, ret);
    http_header(ret, "Content-Disposition", "%s; filename=\"%s.%s\"",
                drawing->kind == POOL_RENDER_SVG ? "inline" : "attachment", call->id_text,
                drawing->suffix);
    http_body(ret, drawing->type, deferred->bytes, deferred->size);
    deferred->bytes = NULL;
}

static void draw(struct call *call, const struct drawing *drawing, struct http_response *ret)
{
    if (call->deferred == NULL) {
        begin_drawing(call, drawing, ret);
    } else if (atomic_load(&call->deferred->done)) {
        finish_drawing(call, drawing, ret);
    } else if (http_is_stopping(call->service->http)) {
        reply_refusal(call->request, ret, PROBLEM_UNAVAILABLE, WORD_DAEMON_REFUSAL_SHUTTING_DOWN,
                      NULL);
    } else {
        ret->action = HTTP_WAIT;
        ret->wake_at_ms = INT64_MAX / 4;
    }
}

void handle_field(struct call *call, struct http_response *ret)
{
    static const struct drawing vtu = {POOL_RENDER_VTU, "application/vnd.vtk.vtu", "vtu", false};
    draw(call, &vtu, ret);
}

void handle_section(struct call *call, struct http_response *ret)
{
    static const struct drawing svg = {POOL_RENDER_SVG, "image/svg+xml", "svg", true};
    draw(call, &svg, ret);
}
