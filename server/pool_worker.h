/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_POOL_WORKER_H
#define ISCHIA_SERVER_POOL_WORKER_H

#include "server/message.h"
#include "server/pool.h"
#include "server/spawn.h"

/*
 * Internal to the pool: one worker's slot and its conversation. Everything here belongs to the
 * pool's thread; times are CLOCK_MONOTONIC milliseconds. pool.c decides who works on what.
 */

/* A drawing that was asked for. */
struct render {
    enum pool_render_kind kind;
    const char *language; /* static storage */
    char *case_json;
    unsigned char *field;
    size_t field_size;
    pool_render_done *done;
    void *context;
    int64_t expires_ms; /* given up when no worker has taken it by then */
    struct render *next;
};
void render_destroy(struct render *render); /* NULL allowed */

enum worker_state {
    WORKER_DOWN,     /* no process; may start at start_at_ms       */
    WORKER_STARTING, /* no hello yet                               */
    WORKER_IDLE,
    WORKER_BUSY,
    WORKER_DYING /* killed, not yet reaped                         */
};

/* What the next frame must be. */
enum worker_expects {
    EXPECTS_MESSAGE,
    EXPECTS_RESULT,
    EXPECTS_FIELD,
    EXPECTS_PROBLEM,
    EXPECTS_DRAWING
};

/* Why a worker was killed; KILLED_NOT when it went by itself. */
enum worker_killed {
    KILLED_NOT,
    KILLED_CANCEL,
    KILLED_DEADLINE,
    KILLED_PROTOCOL,
    KILLED_DRAIN,
    KILLED_IDLE,
    KILLED_YIELD,
    KILLED_VERSION
};

struct worker {
    int slot;
    bool renders; /* else solves */
    enum worker_state state;
    enum worker_killed killed;
    enum worker_expects expects;
    struct spawned process;
    struct frame_reader reader;
    struct frame_writer writer;
    bool wants_to_write; /* the socket was full */

    bool has_job; /* a solve */
    struct pool_job job;
    struct render *render; /* a drawing; NULL: none */
    int job_number;        /* on the wire */
    char *result;          /* the result object, until its field has come */
    int64_t begun_ms;      /* of the job */
    int64_t deadline_ms;   /* of the hello or the job; 0: none */
    int64_t idle_since_ms;
    int64_t start_at_ms; /* when down */
    int backoff_ms;      /* the next pause after a death */
    char why[160];       /* what was wrong, when it was killed for it */
};

/* What a worker's frames amount to. */
enum worker_news {
    NEWS_NONE,
    NEWS_READY,    /* it said hello                               */
    NEWS_PROGRESS, /* *progress                                   */
    NEWS_RESULT,   /* worker->result and *frame, the field        */
    NEWS_PROBLEM,  /* *frame, the problem object                  */
    NEWS_DRAWING   /* *frame, the file                            */
};

struct worker_report {
    enum worker_news news;
    struct pool_progress progress;
    char text[MESSAGE_TEXT_BYTES]; /* of progress; of what a ready worker calls itself   */
    struct frame frame;
};

/* The next piece of news among the frames that have arrived. ISCHIA_E_INPUT: the worker broke the
 * protocol; ISCHIA_E_STATE: it is of another protocol or model version. *ret->frame is valid until
 * the reader is used again. */
ISCHIA_MUST_CHECK enum ischia_code worker_next(struct worker *worker, struct worker_report *ret,
                                               struct ischia_error *err);

/* Puts a solve or a drawing on the wire (to be flushed by the caller). */
ISCHIA_MUST_CHECK enum ischia_code worker_put_solve(struct worker *worker,
                                                    struct ischia_error *err);
ISCHIA_MUST_CHECK enum ischia_code worker_put_render(struct worker *worker,
                                                     struct ischia_error *err);

/* Forgets the conversation of a worker that was reaped. */
void worker_reset(struct worker *worker);

/* It will ask for a job without anybody's doing anything, and soon. */
bool worker_is_coming_free(const struct worker *worker, int64_t now_ms);
/* It solves something that may be taken back. */
bool worker_yields(const struct worker *worker);

/* A copy of an argv in one block, with its strings; NULL when there is no memory. */
char **worker_copy_command(const char *const *command);

int64_t worker_now_ms(void); /* CLOCK_MONOTONIC */

#endif
