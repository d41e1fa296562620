/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_STORE_H
#define ISCHIA_SERVER_STORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/queue_state.h"
#include "server/uuid.h"
#include "solver/error.h"

/*
 * The store: everything that must survive a power cut. Assessments and their results, idempotency
 * keys, the change log, tokens and the audit chain. Nothing in this header knows the engine behind
 * it.
 *
 * Any number of daemons on any machines may share a store on a server. Each holds a lease on what
 * it runs for as long as it says every second that it lives; what belongs to nobody alive goes back
 * into the queue within STORE_LEASE_MS and some, and whoever ran it can then no longer end it.
 *
 * Threads: every function may be called from any thread at any time between open and close. Writes
 * are carried out by one thread of the store, which puts all that are waiting into one transaction;
 * a write returns (or calls back) only after the commit that makes it survive a power cut, so a
 * caller that is told ISCHIA_OK may say 202. Reads run beside writes and see the last commit.
 *
 * Times are Unix milliseconds, UTC; 0 means "not yet" or "never". Text is UTF-8; NULL means absent.
 *
 * Errors common to all: ISCHIA_E_IO when the engine cannot read or write (disk full, read-only,
 * out of descriptors; the engine's words are in the message): nothing of that call is kept, unless
 * the connection to a server was lost in the very commit: then nobody knows, and asking again with
 * the same idempotency key, or attempt, is safe.
 * ISCHIA_E_MEMORY. ISCHIA_E_STATE after store_close has begun. Things that callers are expected to
 * meet (not found, conflict, queue full) are not errors: they are answers, in an enum.
 */

struct store;

enum { STORE_DIGEST_BYTES = 32 };
enum { STORE_PROGRESS_BYTES = 96 };
enum { STORE_LIST_LIMIT_MAX = 500, STORE_CURSOR_BYTES = 40 };
enum { STORE_IDEMPOTENCY_MS = 24 * 60 * 60 * 1000 }; /* the default */
enum { STORE_LEASE_MS = 5000, STORE_BEAT_MS = 1000 };

enum store_answer {
    STORE_DONE,
    STORE_NOT_FOUND, /* no such assessment or token                                   */
    STORE_CONFLICT,  /* the present state does not allow it; nothing was changed      */
    STORE_ANSWER_COUNT
};

enum store_mode {
    STORE_SERVE, /* the daemon: takes the lock that keeps a second daemon off the same store,
                    creates and migrates, runs the integrity check                            */
    STORE_ADMIN  /* a short-lived command beside a running daemon: no lock; creates and migrates
                    only when no daemon holds the lock                                        */
};

struct store_options {
    const char *location; /* a directory, also as sqlite:DIRECTORY: one file in it, for one daemon;
                             or postgresql://...: a server, for any number of daemons       */
    enum store_mode mode;
    int busy_timeout_ms;     /* how long to wait for another process' write; 0: 5000          */
    int64_t idempotency_ms;  /* how long an idempotency key is remembered; 0: 24 h            */
    int64_t (*now_ms)(void); /* the clock; NULL: the system's                                 */
};

/*
 * Opens the store and, when `mode` allows, creates it (directory 0700, files 0600) or brings it to
 * this program's schema version.
 * ISCHIA_E_STATE: another daemon has it; or it was written by a newer program.
 * ISCHIA_E_INPUT: it is damaged, or not a store of ours: the message says what to do;
 * no byte of it was changed.
 * *ret_store is the caller's to close.
 */
ISCHIA_MUST_CHECK enum ischia_code store_open(const struct store_options *options,
                                              struct store **ret_store, struct ischia_error *err);

/* Finishes the writes under way, refuses new ones, closes. No other call may be running in another
 * thread. NULL allowed. */
void store_close(struct store *store);

/* Another idempotency_ms (0: 24 h), for old keys as for new ones. Any thread. */
void store_set_idempotency(struct store *store, int64_t idempotency_ms);

/* ------------------------------------------------------------------ assessments: accepting */

struct store_new {
    const char *subject;       /* NULL, or the pseudonymous id                                  */
    const char *side;          /* NULL, "left", "right"                                         */
    const char *label;         /* NULL, or free text                                            */
    const char *measured_at;   /* NULL, or RFC 3339 text                                        */
    const char *case_json;     /* parameters, options and resolution: what a worker is given    */
    const char *warnings_json; /* a JSON array, "[]" when there are none                      */
    unsigned char case_key[STORE_DIGEST_BYTES]; /* queue_case_key: case + model and version   */
    enum queue_priority priority;
    const char *client;          /* who asks ("" when nobody is named): scope of the key below */
    const char *idempotency_key; /* NULL: none                                                */
    unsigned char body_digest[STORE_DIGEST_BYTES]; /* of the body as sent; with a key only    */
    int queued_max;          /* refuse when this many are queued already; 0: no limit     */
    const char *reference;   /* the person as a FHIR reference, as given; NULL: none            */
    const char *origin_json; /* what else the sender must be told back; NULL: none              */
};

enum store_acceptance {
    STORE_ACCEPTED,     /* queued                                                             */
    STORE_CACHED,       /* the same case was solved before: stored as succeeded at once       */
    STORE_REPLAYED,     /* same idempotency key and body: the assessment it made, as it is now */
    STORE_KEY_CONFLICT, /* same idempotency key, other body: nothing stored                   */
    STORE_FULL,         /* queued_max reached: nothing stored                                 */
    STORE_ACCEPTANCE_COUNT
};

struct store_accepted {
    enum store_acceptance acceptance;
    struct uuid id;         /* valid for ACCEPTED, CACHED, REPLAYED                           */
    enum queue_state state; /* likewise                                                       */
    int64_t created_ms;     /* likewise                                                       */
    int queued;             /* how many are queued now                                        */
};

/* Stores one request durably. *what is only read during the call. */
ISCHIA_MUST_CHECK enum ischia_code store_accept(struct store *store, const struct store_new *what,
                                                struct store_accepted *ret,
                                                struct ischia_error *err);

/* Told once per store_accept_later, on the store's own thread: be quick, never call the store.
 * code is ISCHIA_OK with *accepted filled, or the error with *err filled. */
typedef void store_accept_done(void *context, enum ischia_code code,
                               const struct store_accepted *accepted,
                               const struct ischia_error *err);

/* The same without waiting: copies what it needs, returns at once, and calls done after the commit
 * (possibly before this call has returned). On a code other than ISCHIA_OK done is never called. */
ISCHIA_MUST_CHECK enum ischia_code
store_accept_later(struct store *store, const struct store_new *what, store_accept_done *done,
                   void *context, struct ischia_error *err);

/* ------------------------------------------------------------------- assessments: reading */

struct store_assessment {
    struct uuid id;
    int64_t seq;        /* order of acceptance                                                */
    int64_t change_seq; /* the latest change to this assessment: good for an ETag             */
    enum queue_state state;
    enum queue_priority priority;
    int64_t created_ms, started_ms, finished_ms;
    int64_t attempt; /* how often it was given to a worker                                    */
    bool cached;     /* its result was taken over from an equal case                          */
    bool has_field;  /* a displacement blob is stored                                         */
    char *subject, *side, *label, *measured_at; /* NULL when absent                           */
    char *case_json, *warnings_json;
    char *result_json;  /* NULL unless succeeded                                              */
    char *problem_json; /* NULL unless failed                                                 */
    char *origin_json;  /* NULL when it came without one                                      */
};

/* ret's strings are the caller's: store_assessment_finish. Only STORE_DONE fills *ret. */
ISCHIA_MUST_CHECK enum ischia_code
store_get(struct store *store, const struct uuid *id, struct store_assessment *ret,
          enum store_answer *ret_answer, struct ischia_error *err);
void store_assessment_finish(struct store_assessment *a); /* a zeroed one is allowed */

/* State, attempt and change_seq only (strings NULL): the cheap question of waits and ETags. */
ISCHIA_MUST_CHECK enum ischia_code
store_peek(struct store *store, const struct uuid *id, struct store_assessment *ret,
           enum store_answer *ret_answer, struct ischia_error *err);

/* The displacement blob of a succeeded assessment, as the worker made it; free(*ret_bytes).
 * STORE_CONFLICT when it has none (not succeeded). */
ISCHIA_MUST_CHECK enum ischia_code
store_get_field(struct store *store, const struct uuid *id, unsigned char **ret_bytes,
                size_t *ret_size, enum store_answer *ret_answer, struct ischia_error *err);

/* One thing that may hold of an assessment, with what of the members it takes. */
enum store_alternative_kind {
    STORE_HAS_ID,    /* id                                                                 */
    STORE_OF_PERSON, /* subject, reference: either fits                                    */
    STORE_IN_STATES, /* states                                                             */
    STORE_ENDED,     /* from_ms, before_ms: when; what has not ended fits no bound         */
    STORE_CHANGED,   /* from_ms, before_ms: when last                                      */
    STORE_ALTERNATIVE_KIND_COUNT
};

struct store_alternative {
    enum store_alternative_kind kind;
    int condition; /* whose alternative it is; those of one stand together                */
    struct uuid id;
    const char *subject, *reference;
    unsigned states;            /* bits of enum queue_state                                 */
    int64_t from_ms, before_ms; /* 0: no bound                                              */
};

enum { STORE_ALTERNATIVES_MAX = 32 };

struct store_filter {
    const char *subject; /* NULL: any                                                      */
    const char *side;    /* NULL: any                                                      */
    bool by_state;       /* false: any                                                     */
    enum queue_state state;
    /* Of each condition one alternative has to hold. */
    const struct store_alternative *alternative;
    int alternative_count; /* at most STORE_ALTERNATIVES_MAX                               */
    int limit;             /* 1 ... STORE_LIST_LIMIT_MAX                                   */
    const char *cursor;    /* NULL: from the newest; else what an earlier page returned    */
    bool with_results;     /* false: result_json and problem_json stay NULL                */
};

/* Called for each row, newest first; the row is valid during the call. False stops the listing. */
typedef bool store_on_assessment(void *context, const struct store_assessment *row);

/*
 * One page, newest first. ret_cursor is "" when this was the last page. Rows accepted after the
 * first page was read never shift the pages that follow.
 * ISCHIA_E_INPUT: the cursor is not one of ours, limit is out of range, or there are too many
 * alternatives.
 */
ISCHIA_MUST_CHECK enum ischia_code
store_list(struct store *store, const struct store_filter *filter, store_on_assessment *on_row,
           void *context, char ret_cursor[STORE_CURSOR_BYTES], struct ischia_error *err);

enum store_change_kind {
    STORE_CHANGE_CREATED,
    STORE_CHANGE_STARTED,
    STORE_CHANGE_REQUEUED,
    STORE_CHANGE_SUCCEEDED,
    STORE_CHANGE_FAILED,
    STORE_CHANGE_CANCELLED,
    STORE_CHANGE_ERASED,
    STORE_CHANGE_KIND_COUNT
};
extern const char *const store_change_names[STORE_CHANGE_KIND_COUNT]; /* "created", ... */

struct store_change {
    int64_t seq; /* increases in commit order: a reader that has seen seq misses nothing before */
    enum store_change_kind kind;
    struct uuid id;
    int64_t at_ms;
};

/* Called in order of seq; false stops. */
typedef bool store_on_change(void *context, const struct store_change *change);

/* The changes after `since` (0: from the first), at most limit (1 ... STORE_LIST_LIMIT_MAX).
 * *ret_last is the largest seq there is now. */
ISCHIA_MUST_CHECK enum ischia_code store_changes(struct store *store, int64_t since, int limit,
                                                 store_on_change *on_change, void *context,
                                                 int64_t *ret_last, struct ischia_error *err);

/* ----------------------------------------------------- assessments: the life of a job
 * `attempt` is the fencing number: it is given out by store_claim and only its holder can finish
 * that attempt. Whoever comes late, or twice, gets STORE_CONFLICT and changes nothing. */

struct store_claim {
    struct uuid id;
    int64_t attempt;
    int crashes;     /* how many workers have died on it before                               */
    char *case_json; /* free()                                                                */
};

/* Takes the first queued job (highest priority, then oldest): queued -> running. A queued job whose
 * case has been solved meanwhile is finished from that result on the way (told to on_cached, on the
 * calling thread, after the commit). STORE_NOT_FOUND when nothing is left to solve. On an error
 * ret->attempt other than 0 says that ret->id may have been claimed all the same: then the caller
 * owes a store_requeue of it. */
ISCHIA_MUST_CHECK enum ischia_code
store_claim_next(struct store *store, void (*on_cached)(void *context, const struct uuid *id),
                 void *context, struct store_claim *ret, enum store_answer *ret_answer,
                 struct ischia_error *err);

/* running -> succeeded. field may be NULL with size 0. */
ISCHIA_MUST_CHECK enum ischia_code
store_succeed(struct store *store, const struct uuid *id, int64_t attempt, const char *result_json,
              const unsigned char *field, size_t field_size, enum store_answer *ret_answer,
              struct ischia_error *err);

/* running -> failed, with the problem document. */
ISCHIA_MUST_CHECK enum ischia_code
store_fail(struct store *store, const struct uuid *id, int64_t attempt, const char *problem_json,
           enum store_answer *ret_answer, struct ischia_error *err);

/* running -> queued: a drain (crashed false) or the death of its worker (true: counted). */
ISCHIA_MUST_CHECK enum ischia_code
store_requeue(struct store *store, const struct uuid *id, int64_t attempt, bool crashed,
              enum store_answer *ret_answer, struct ischia_error *err);

/* queued or running -> cancelled. *ret_was is the state before (also with STORE_CONFLICT). */
ISCHIA_MUST_CHECK enum ischia_code
store_cancel(struct store *store, const struct uuid *id, enum queue_state *ret_was,
             enum store_answer *ret_answer, struct ischia_error *err);

/* At start, before the first claim: every running one that no living daemon holds -> queued,
 * attempts and crashes kept. */
ISCHIA_MUST_CHECK enum ischia_code store_recover(struct store *store, int *ret_requeued,
                                                 struct ischia_error *err);

/* Erases an assessment, its idempotency keys, and its result and field unless another assessment
 * of the same case still uses them. In a file the bytes are overwritten, in its log too; on a
 * server they go when that cleans up. The change log keeps the id and "erased". STORE_CONFLICT
 * while it runs. */
ISCHIA_MUST_CHECK enum ischia_code store_erase(struct store *store, const struct uuid *id,
                                               enum store_answer *ret_answer,
                                               struct ischia_error *err);

struct store_retention {
    int64_t age_max_ms; /* finished longer ago than this: erased; 0: keep                     */
    int64_t count_max;  /* finished ones beyond the newest this many: erased; 0: keep         */
};

/* Erases at most `batch` finished assessments that the rule no longer keeps, and the idempotency
 * keys that have expired; call again while *ret_erased == batch. */
ISCHIA_MUST_CHECK enum ischia_code store_retire(struct store *store,
                                                const struct store_retention *rule, int batch,
                                                int *ret_erased, struct ischia_error *err);

/* ------------------------------------------------------------------------------- outbox
 * Who is to be told how assessments ended. A target reads the change log once, from the moment it
 * is first opened, into rows of its own; a row leaves when the target has confirmed it. */

enum { STORE_TARGET_BYTES = 16, STORE_OUTBOX_PROBLEM_BYTES = 200 };

struct store_delivery {
    int64_t seq; /* of the row */
    int64_t change_seq;
    struct uuid id;
    enum store_change_kind kind; /* succeeded, failed, cancelled */
    int64_t created_ms;          /* when the assessment ended    */
    int attempts;                /* so far                       */
};

/* Opens a target: from now on every end of an assessment is for it too. Idempotent. */
ISCHIA_MUST_CHECK enum ischia_code store_outbox_open(struct store *store, const char *target,
                                                     struct ischia_error *err);
/* Forgets a target that is no longer configured, with what waits for it. */
ISCHIA_MUST_CHECK enum ischia_code store_outbox_close(struct store *store, const char *target,
                                                      struct ischia_error *err);
/* Takes what ended since the last call into the target's rows. */
ISCHIA_MUST_CHECK enum ischia_code store_outbox_fill(struct store *store, const char *target,
                                                     struct ischia_error *err);
/* The row that is due first, by now_ms; STORE_NOT_FOUND when none is: *ret_due_ms is then when the
 * next one will be, 0 when there is none. */
ISCHIA_MUST_CHECK enum ischia_code
store_outbox_next(struct store *store, const char *target, int64_t now_ms,
                  struct store_delivery *ret, int64_t *ret_due_ms, enum store_answer *ret_answer,
                  struct ischia_error *err);
/* The target has confirmed the row. */
ISCHIA_MUST_CHECK enum ischia_code store_outbox_done(struct store *store, int64_t seq,
                                                     struct ischia_error *err);
/* It has not: again at due_ms, or never (given up). problem: for the operator. */
ISCHIA_MUST_CHECK enum ischia_code
store_outbox_retry(struct store *store, int64_t seq, int64_t due_ms, bool give_up,
                   const char *problem, struct ischia_error *err);

struct store_outbox_row {
    struct store_delivery delivery;
    char target[STORE_TARGET_BYTES];
    int64_t due_ms;
    bool given_up;
    char problem[STORE_OUTBOX_PROBLEM_BYTES];
};

/* Called for each row; false stops. */
typedef bool store_on_outbox(void *context, const struct store_outbox_row *row);
/* Every row, oldest first. */
ISCHIA_MUST_CHECK enum ischia_code store_outbox_list(struct store *store, store_on_outbox *on_row,
                                                     void *context, struct ischia_error *err);
/* Makes every row due now, also those given up; *ret_count: how many. */
ISCHIA_MUST_CHECK enum ischia_code store_outbox_revive(struct store *store, int *ret_count,
                                                       struct ischia_error *err);

/* ----------------------------------------------------------------------------- feedback */

struct store_feedback {
    int64_t at_ms; /* filled in by the store */
    const char *service;
    struct uuid card; /* the assessment that the card showed */
    const char *document;
};

/* Stores `count` answers at once, durably. */
ISCHIA_MUST_CHECK enum ischia_code store_feedback_add(struct store *store,
                                                      const struct store_feedback *rows,
                                                      size_t count, struct ischia_error *err);
/* Called for each row; false stops. */
typedef bool store_on_feedback(void *context, const struct store_feedback *row);
/* Every answer, oldest first. */
ISCHIA_MUST_CHECK enum ischia_code store_feedback_list(struct store *store,
                                                       store_on_feedback *on_row, void *context,
                                                       struct ischia_error *err);

/* ------------------------------------------------------------------------------- tokens */

struct store_token {
    char id[40];   /* public part, shown in lists and in the audit log                        */
    char name[80]; /* what it is for                                                          */
    unsigned char digest[STORE_DIGEST_BYTES]; /* of the secret part                           */
    uint32_t scopes;    /* bits; their meaning is auth's                                      */
    int64_t created_ms; /* filled in by the store                                             */
    int64_t expires_ms; /* 0: never                                                           */
    int64_t revoked_ms; /* 0: not revoked                                                     */
};

/* STORE_CONFLICT when the id exists. */
ISCHIA_MUST_CHECK enum ischia_code
store_token_add(struct store *store, const struct store_token *token, enum store_answer *ret_answer,
                struct ischia_error *err);
/* Also finds revoked and expired ones: judging is the caller's. */
ISCHIA_MUST_CHECK enum ischia_code
store_token_get(struct store *store, const char *id, struct store_token *ret,
                enum store_answer *ret_answer, struct ischia_error *err);
/* STORE_CONFLICT when it was revoked before. */
ISCHIA_MUST_CHECK enum ischia_code store_token_revoke(struct store *store, const char *id,
                                                      enum store_answer *ret_answer,
                                                      struct ischia_error *err);
/* Erases those that are revoked or expired; *ret_count: how many. */
ISCHIA_MUST_CHECK enum ischia_code store_token_forget(struct store *store, int64_t *ret_count,
                                                      struct ischia_error *err);
typedef bool store_on_token(void *context, const struct store_token *token);
ISCHIA_MUST_CHECK enum ischia_code store_token_list(struct store *store, store_on_token *on_token,
                                                    void *context, struct ischia_error *err);
/* A number that changes whenever a token does, also by another process: for caches. */
ISCHIA_MUST_CHECK enum ischia_code store_token_epoch(struct store *store, int64_t *ret_epoch,
                                                     struct ischia_error *err);

/* -------------------------------------------------------------------------------- audit
 * Rows are chained: each carries SHA-256 over its own fields and the hash before it, so that a row
 * changed, removed or put in later breaks the chain from there on. What a chain cannot show is that
 * its newest rows were cut off; whoever must show that notes seq and hash of the head elsewhere. */

struct store_audit {
    int64_t seq;         /* filled in by the store                                            */
    int64_t at_ms;       /* filled in by the store                                            */
    const char *who;     /* token id, "local", "admin"; never NULL, as the rest: "" if none   */
    const char *what;    /* "assessment.create", "token.revoke", ...                          */
    const char *subject; /* the id that it was done to                                        */
    const char *outcome; /* "ok", "denied", "202", ...                                        */
    const char *detail;  /* never anything that identifies a person                           */
    unsigned char hash[STORE_DIGEST_BYTES]; /* filled in by the store                         */
};

/* Appends one row durably. */
ISCHIA_MUST_CHECK enum ischia_code
store_audit_append(struct store *store, const struct store_audit *row, struct ischia_error *err);
/* The same without waiting for the disk: ordered with the other writes of the calling thread, so
 * that a write made and awaited after it implies it. A failure shows in store_stats. */
ISCHIA_MUST_CHECK enum ischia_code store_audit_append_later(struct store *store,
                                                            const struct store_audit *row,
                                                            struct ischia_error *err);

typedef bool store_on_audit(void *context, const struct store_audit *row);

/* Rows after `since` in order. */
ISCHIA_MUST_CHECK enum ischia_code store_audit_list(struct store *store, int64_t since,
                                                    store_on_audit *on_row, void *context,
                                                    struct ischia_error *err);

struct store_audit_report {
    int64_t rows;
    int64_t first_bad_seq; /* 0: the chain holds                                              */
    int64_t head_seq;
    unsigned char head_hash[STORE_DIGEST_BYTES];
};

/* Walks the chain. ISCHIA_OK also for a broken one: look at first_bad_seq. */
ISCHIA_MUST_CHECK enum ischia_code
store_audit_verify(struct store *store, struct store_audit_report *ret, struct ischia_error *err);

/* --------------------------------------------------------------------------- operations */

/* Upper bounds in ms of the commit latency histogram; the last bucket is unbounded. */
enum { STORE_LATENCY_BUCKETS = 12 };
extern const double store_latency_bound_ms[STORE_LATENCY_BUCKETS - 1];

/* ----------------------------------------------------------------- what other daemons do */

struct store_progress {
    double fraction;
    int load_step, newton_iteration;
    double F_N;
    char message[STORE_PROGRESS_BYTES];
};

/* Called on a thread of the store: be quick; only pool_wake, pool_cancel and events are for them.
 * Any may be NULL. */
struct store_watcher {
    void *context;
    /* Another daemon made this change; in order of seq, none left out, within a second or so. */
    void (*on_change)(void *context, const struct store_change *change);
    /* How far another daemon's solve is; some are left out. */
    void (*on_progress)(void *context, const struct uuid *id,
                        const struct store_progress *progress);
    /* There may be new work, of any kind. */
    void (*on_work)(void *context);
    /* A study was cancelled by another daemon. May be missed: what comes of it is refused then. */
    void (*on_study_cancelled)(void *context, const struct uuid *id);
    /* The lease on all that this daemon runs was lost: others may be solving it. */
    void (*on_lease_lost)(void *context);
};

/* From now on the watcher is told; *watcher is copied. NULL: no longer, and when this returns none
 * of its functions is running. Does nothing where no other daemon can be. */
void store_watch(struct store *store, const struct store_watcher *watcher);

/* Tells the watchers of other daemons; the latest of each id, a few times a second. */
void store_tell_progress(struct store *store, const struct uuid *id,
                         const struct store_progress *progress);

struct store_stats {
    int64_t count[QUEUE_STATE_COUNT]; /* assessments by state                                 */
    int64_t oldest_queued_ms;         /* created_ms of the oldest queued; 0: none             */
    int64_t size_bytes;               /* of the store's files                                 */
    uint64_t writes, commits, write_failures, audit_failures; /* since open                   */
    uint64_t latency_count[STORE_LATENCY_BUCKETS]; /* write calls by time from call to commit */
    double latency_sum_ms;
};

/* Numbers for metrics; cheap however many assessments there are. */
ISCHIA_MUST_CHECK enum ischia_code store_stats(struct store *store, struct store_stats *ret,
                                               struct ischia_error *err);

/* Proves that the store can commit now: for /readyz. Writes a few bytes. */
ISCHIA_MUST_CHECK enum ischia_code store_probe(struct store *store, struct ischia_error *err);

/* A consistent copy of the whole store in one new file, made while others read and write. The file
 * appears under its name only when it is complete and on disk; ISCHIA_E_STATE when it exists. */
ISCHIA_MUST_CHECK enum ischia_code store_backup(struct store *store, const char *path,
                                                struct ischia_error *err);

/*
 * Replaces the whole content of the store at `location` by that of a backup file, in one
 * transaction, whether or not a daemon is serving it; running jobs of the backup become queued.
 * ISCHIA_E_INPUT: the file is damaged, not a store, or newer than this program: nothing changed.
 */
ISCHIA_MUST_CHECK enum ischia_code store_restore(const char *location, const char *backup_path,
                                                 struct ischia_error *err);

/* Name and version of the engine, for /version: "SQLite 3.40.1". Lives as long as the store. */
const char *store_engine(const struct store *store);
/* Whether a location is on a server: other daemons may share it, and it may be away for a while. */
bool store_is_on_server(const char *location);

/*
 * Copies everything from one store into another, of whichever kinds, which must be empty: in one
 * transaction, from one consistent state. What ran becomes queued. *ret_rows: how many rows.
 * ISCHIA_E_STATE: there is something in `to`, or a daemon has one of them.
 */
ISCHIA_MUST_CHECK enum ischia_code store_move(const char *from, const char *to, int64_t *ret_rows,
                                              struct ischia_error *err);
int store_schema_version(void); /* that this program writes */

#endif
