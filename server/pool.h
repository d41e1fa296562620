/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_POOL_H
#define ISCHIA_SERVER_POOL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/frame.h"
#include "server/uuid.h"
#include "solver/error.h"

/*
 * The worker processes: one thread starts them, gives them jobs, watches time, and reaps them. The
 * pool knows nothing of the store: a host (queue.c, or a test) gives it jobs and takes outcomes.
 *
 * Each worker is a child with a minimal environment, one socket, a memory limit and a deadline for
 * each job; it is a process group of its own and dies with the daemon. A worker that dies, hangs,
 * or talks nonsense is replaced, with a growing pause when that happens again and again. A job that
 * yields is stopped, and given back to the host, when one that may not wait finds no worker.
 * Solves and renders have separate workers, so that a drawing never waits for a solve; render
 * workers start when the first drawing is asked for and leave when idle.
 */

struct pool;

struct pool_options {
    const char *const *command; /* argv of a worker, NULL at the end; "--fd" "3" is appended  */
    int solve_workers;          /* 0: one per online core                                     */
    int render_workers;         /* 0: 1                                                       */
    size_t memory_max_bytes;    /* RLIMIT_DATA of each worker; 0: no limit                    */
    int solve_deadline_ms;      /* from the job's sending to its outcome; 0: 15 minutes       */
    int render_deadline_ms;     /* 0: 60 s                                                    */
    int hello_deadline_ms;      /* from start to hello; 0: 30 s                               */
    int backoff_min_ms;         /* pause after a worker's death, doubled while they keep dying */
    int backoff_max_ms;         /* 0, 0: 100 ms, 10 s                                         */
    int render_idle_ms;         /* an idle render worker leaves after this; 0: 60 s           */
    int renders_waiting_max;    /* 0: 64                                                      */
    int poll_ms;                /* how often an idle pool asks for jobs unprompted; 0: 1 s    */
    struct frame_limits limits; /* zeroed: frame_limits_default                               */
};

struct pool_job {
    struct uuid id;
    int64_t line; /* this and the next two are the host's: the pool only carries them         */
    int64_t attempt;
    int crashes;
    bool yields;     /* may be taken back for one that may not wait (pool_host.pressing)      */
    char *case_json; /* owned by the pool once handed over                                    */
};

struct pool_progress {
    double fraction;
    int load_step, newton_iteration;
    double F_N;
    const char *message; /* valid during the call                                             */
};

enum pool_end {
    POOL_RESULT,    /* the worker solved it                                                    */
    POOL_PROBLEM,   /* the worker says why there is no result                                  */
    POOL_CRASHED,   /* the worker died or talked nonsense; detail says how                     */
    POOL_DEADLINE,  /* it took longer than allowed and was killed                              */
    POOL_DRAINED,   /* the pool is stopping and took it back                                   */
    POOL_CANCELLED, /* pool_cancel; its worker is dead                                        */
    POOL_YIELDED,   /* taken back for a job that may not wait; its worker is dead             */
    POOL_END_COUNT
};
extern const char *const pool_end_names[POOL_END_COUNT];

struct pool_outcome {
    enum pool_end end;
    const char *document; /* POOL_RESULT, POOL_PROBLEM: one JSON object, NUL-terminated       */
    const unsigned char *field; /* POOL_RESULT: the displacement blob                         */
    size_t field_size;
    const char *detail; /* one line for people: "killed by signal 11 (Segmentation fault)"    */
    int64_t wall_ms;    /* from sending to end                                                */
};

enum pool_note_kind {
    POOL_NOTE_STARTED, /* a worker was started                                                */
    POOL_NOTE_READY,   /* ... and said hello                                                  */
    POOL_NOTE_ENDED,   /* a worker ended as it was told to (drain, cancel, idle)              */
    POOL_NOTE_DIED,    /* a worker ended on its own, or had to be killed                      */
    POOL_NOTE_FAILED,  /* a worker could not be started, or is of another model version       */
    POOL_NOTE_KIND_COUNT
};

struct pool_note {
    enum pool_note_kind kind;
    int worker; /* slot number                                                        */
    int pid;
    const char *detail; /* one line; "" if there is nothing to say; never patient data        */
};

/* All are called on the pool's thread, one at a time; they may call pool_wake, pool_cancel. */
struct pool_host {
    void *context;
    /* Fills *ret and returns true when there is a job to solve. */
    bool (*next_job)(void *context, struct pool_job *ret);
    /* How many jobs wait that are not to wait for one that yields. Asked only while one of those is
     * being solved. May be NULL: none. */
    int64_t (*pressing)(void *context);
    void (*on_progress)(void *context, const struct pool_job *job,
                        const struct pool_progress *progress);
    /* Exactly once for each job handed over. */
    void (*on_outcome)(void *context, const struct pool_job *job,
                       const struct pool_outcome *outcome);
    void (*on_note)(void *context, const struct pool_note *note); /* may be NULL              */
    void (*on_tick)(void *context); /* about every poll_ms; may be NULL                       */
};

/* Starts the thread and the solve workers. options and host are copied, the strings of the command
 * too. Blocks SIGPIPE nowhere and installs no signal handler: children are watched by pidfd. */
ISCHIA_MUST_CHECK enum ischia_code pool_create(const struct pool_options *options,
                                               const struct pool_host *host, struct pool **ret_pool,
                                               struct ischia_error *err);

/* There may be a new job. Cheap; any thread. */
void pool_wake(struct pool *pool);

/* If this job is with a worker now, ends that worker: on_outcome(POOL_CANCELLED) follows. Otherwise
 * nothing happens. Any thread, does not wait. */
void pool_cancel(struct pool *pool, const struct uuid *id);

/* The same for every job that is with a worker now. */
void pool_cancel_all(struct pool *pool);

enum pool_render_kind { POOL_RENDER_VTU, POOL_RENDER_SVG, POOL_RENDER_KIND_COUNT };
extern const char *const pool_render_names[POOL_RENDER_KIND_COUNT]; /* "vtu", "svg" */

/* On the pool's thread. ISCHIA_OK: bytes are valid during the call. Otherwise *err says why:
 * ISCHIA_E_STATE when the pool is stopping, ISCHIA_E_LIMIT for time, ISCHIA_E_IO for a dead worker,
 * ISCHIA_E_INPUT when the worker refused the field. */
typedef void pool_render_done(void *context, enum ischia_code code, const unsigned char *bytes,
                              size_t size, const struct ischia_error *err);

/* Asks a render worker to draw, with words of the language (its tag, static storage); copies its
 * other inputs; does not wait. done is called exactly once if and only if this returns ISCHIA_OK.
 * ISCHIA_E_LIMIT: too many wait. ISCHIA_E_STATE: stopping. */
ISCHIA_MUST_CHECK enum ischia_code
pool_render(struct pool *pool, enum pool_render_kind kind, const char *language,
            const char *case_json, const unsigned char *field, size_t field_size,
            pool_render_done *done, void *context, struct ischia_error *err);

enum { POOL_PROGRAM_BYTES = 96 };

struct pool_stats {
    int workers; /* solve workers wanted                                                     */
    int ready;   /* of them, idle after hello                                                */
    int busy;    /* of them, solving                                                         */
    uint64_t started, died, cancelled, yielded, deadlines, protocol_errors; /* since create   */
    uint64_t renders, renders_failed;
    int renders_waiting;
    char program[POOL_PROGRAM_BYTES]; /* what the worker that came last calls itself: program and
                                         libraries; "" before the first hello           */
};

/* What the pool is doing now and has done since it was created. Any thread. */
void pool_stats(struct pool *pool, struct pool_stats *ret);

/* Takes no new jobs from now on; running ones may end. Does not wait. */
void pool_drain(struct pool *pool);

/* Drains, waits at most grace_ms for running jobs, takes the rest back (POOL_DRAINED), ends all
 * workers and the thread. No callback runs after it. NULL allowed. */
void pool_destroy(struct pool *pool, int grace_ms);

#endif
