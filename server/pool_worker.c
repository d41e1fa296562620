/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/pool_worker.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "solver/case.h"

const char *const pool_end_names[POOL_END_COUNT] = {
    [POOL_RESULT] = "result",     [POOL_PROBLEM] = "problem", [POOL_CRASHED] = "crashed",
    [POOL_DEADLINE] = "deadline", [POOL_DRAINED] = "drained", [POOL_CANCELLED] = "cancelled",
    [POOL_YIELDED] = "yielded"};
const char *const pool_render_names[POOL_RENDER_KIND_COUNT] = {
    [POOL_RENDER_VTU] = "vtu", [POOL_RENDER_SVG] = "svg"};

int64_t worker_now_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

void render_destroy(struct render *render)
{
    if (render == NULL) return;
    free(render->case_json);
    free(render->field);
    free(render);
}

void worker_reset(struct worker *worker)
{
    frame_reader_finish(&worker->reader);
    frame_writer_finish(&worker->writer);
    free(worker->result);
    worker->result = NULL;
    worker->wants_to_write = false;
    worker->expects = EXPECTS_MESSAGE;
    worker->deadline_ms = 0;
}

bool worker_is_coming_free(const struct worker *worker, int64_t now_ms)
{
    return worker->state == WORKER_IDLE || worker->state == WORKER_STARTING ||
           worker->state == WORKER_DYING ||
           (worker->state == WORKER_DOWN && now_ms >= worker->start_at_ms);
}

bool worker_yields(const struct worker *worker)
{
    return worker->state == WORKER_BUSY && worker->has_job && worker->job.yields;
}

char **worker_copy_command(const char *const *command)
{
    size_t count = 0, bytes = 0;
    for (; command[count] != NULL; count++) bytes += strlen(command[count]) + 1;
    char **copy = malloc((count + 1) * sizeof *copy + bytes);
    if (copy == NULL) return NULL;
    char *text = (char *)(copy + count + 1);
    for (size_t i = 0; i < count; i++) {
        copy[i] = text;
        text = stpcpy(text, command[i]) + 1;
    }
    copy[count] = NULL;
    return copy;
}

/* ------------------------------------------------------------------------------- hearing */

static enum ischia_code hear_hello(struct worker *worker, const struct message *message,
                                   struct worker_report *ret, struct ischia_error *err)
{
    CHECK(worker->state == WORKER_STARTING, err, ISCHIA_E_INPUT, "it said hello twice");
    /* Results of two models must never be mixed under one version. */
    CHECK(message->protocol == FRAME_PROTOCOL_VERSION &&
              message->model_version == ISCHIA_MODEL_VERSION &&
              strcmp(message->model, ISCHIA_MODEL_NAME) == 0,
          err, ISCHIA_E_STATE,
          "the worker program is of another version (protocol %d, model %s-%d; "
          "this daemon: protocol %d, model %s-%d): install both from one build",
          message->protocol, message->model, message->model_version, FRAME_PROTOCOL_VERSION,
          ISCHIA_MODEL_NAME, ISCHIA_MODEL_VERSION);
    ret->news = NEWS_READY;
    (void)stpcpy(ret->text, message->program);
    return ISCHIA_OK;
}

static void hear_progress(const struct message *message, struct worker_report *ret)
{
    ret->news = NEWS_PROGRESS;
    (void)stpcpy(ret->text, message->text);
    ret->progress = (struct pool_progress){.fraction = message->fraction,
                                           .load_step = message->load_step,
                                           .newton_iteration = message->newton_iteration,
                                           .F_N = message->F_N,
                                           .message = ret->text};
}

static enum ischia_code hear_message(struct worker *worker, const struct frame *frame,
                                     struct worker_report *ret, struct ischia_error *err)
{
    struct message message;
    CHECK(frame->kind == FRAME_JSON, err, ISCHIA_E_INPUT, "a blob where a message was due");
    TRY(message_read(frame->bytes, frame->size, &message, err));
    free(message.case_json == NULL ? NULL : message.case_json); /* no worker's message has one */
    if (message.kind == MESSAGE_HELLO) return hear_hello(worker, &message, ret, err);
    CHECK(worker->state == WORKER_BUSY && message.job == worker->job_number, err, ISCHIA_E_INPUT,
          "it spoke of a job that it does not have");
    if (message.kind == MESSAGE_PROGRESS) {
        hear_progress(&message, ret);
        return ISCHIA_OK;
    }
    const bool renders = worker->render != NULL;
    if (message.kind == MESSAGE_PROBLEM)
        worker->expects = EXPECTS_PROBLEM;
    else if (message.kind == MESSAGE_RESULT && !renders)
        worker->expects = EXPECTS_RESULT;
    else if (message.kind == MESSAGE_RENDERED && renders)
        worker->expects = EXPECTS_DRAWING;
    else
        return FAIL(err, ISCHIA_E_INPUT, "it answered what was not asked");
    return ISCHIA_OK;
}

static enum ischia_code hear_result(struct worker *worker, const struct frame *frame,
                                    struct ischia_error *err)
{
    worker->result = strdup(frame->bytes);
    CHECK(worker->result != NULL, err, ISCHIA_E_MEMORY, "no memory for a result");
    worker->expects = EXPECTS_FIELD;
    return ISCHIA_OK;
}

/* The frame that follows a message. */
static enum ischia_code hear_rest(struct worker *worker, const struct frame *frame,
                                  struct worker_report *ret, struct ischia_error *err)
{
    static const enum worker_news news_of[] = {[EXPECTS_FIELD] = NEWS_RESULT,
                                               [EXPECTS_PROBLEM] = NEWS_PROBLEM,
                                               [EXPECTS_DRAWING] = NEWS_DRAWING};
    const bool wants_json = worker->expects == EXPECTS_RESULT || worker->expects == EXPECTS_PROBLEM;
    CHECK(frame->kind == (wants_json ? FRAME_JSON : FRAME_BLOB), err, ISCHIA_E_INPUT,
          "what followed its message was of the wrong kind");
    CHECK(!wants_json || message_is_object(frame->bytes, frame->size), err, ISCHIA_E_INPUT,
          "what followed its message is not a JSON object");
    if (worker->expects == EXPECTS_RESULT) return hear_result(worker, frame, err);
    ret->news = news_of[worker->expects];
    ret->frame = *frame;
    worker->expects = EXPECTS_MESSAGE;
    return ISCHIA_OK;
}

enum ischia_code worker_next(struct worker *worker, struct worker_report *ret,
                             struct ischia_error *err)
{
    *ret = (struct worker_report){.news = NEWS_NONE};
    while (ret->news == NEWS_NONE) {
        struct frame frame;
        TRY(frame_reader_next(&worker->reader, &frame, err));
        if (frame.kind == FRAME_NONE) return ISCHIA_OK;
        if (worker->expects == EXPECTS_MESSAGE)
            TRY(hear_message(worker, &frame, ret, err));
        else
            TRY(hear_rest(worker, &frame, ret, err));
    }
    return ISCHIA_OK;
}

/* ------------------------------------------------------------------------------ speaking */

static enum ischia_code put_message(struct worker *worker, const struct message *message,
                                    struct ischia_error *err)
{
    char *json = NULL;
    size_t size = 0;
    TRY(message_write(message, &json, &size, err));
    const enum ischia_code code = frame_put_json(&worker->writer, json, size, err);
    free(json);
    return code;
}

static int next_number(struct worker *worker)
{
    worker->job_number = worker->job_number % MESSAGE_JOB_MAX + 1;
    return worker->job_number;
}

enum ischia_code worker_put_solve(struct worker *worker, struct ischia_error *err)
{
    const struct message message = {
        .kind = MESSAGE_SOLVE, .job = next_number(worker), .case_json = worker->job.case_json};
    return put_message(worker, &message, err);
}

enum ischia_code worker_put_render(struct worker *worker, struct ischia_error *err)
{
    const struct render *render = worker->render;
    struct message message = {
        .kind = MESSAGE_RENDER, .job = next_number(worker), .case_json = render->case_json};
    (void)stpcpy(message.as, pool_render_names[render->kind]);
    (void)snprintf(message.language, sizeof message.language, "%s", render->language);
    TRY(put_message(worker, &message, err));
    return frame_put_blob(&worker->writer, render->field, render->field_size, err);
}
