/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef ISCHIA_SERVER_STORE_STUDIES_H
#define ISCHIA_SERVER_STORE_STUDIES_H

#include "server/store/store.h"

/*
 * Studies: many cases asked for at once. They are kept apart from assessments: a list of
 * assessments, the change log and the outbox do not know them, and retention by count does not
 * count them. Threads, times, texts and errors as in store.h.
 */

struct store_study_point_new {
    const char *cells_json; /* the row as it was given: a JSON array of texts                  */
    const char *case_json;  /* what a worker is given; NULL: refused                           */
    unsigned char case_key[STORE_DIGEST_BYTES]; /* queue_case_key; not of a refused one        */
    const char *problem_json; /* why it is refused; NULL: it is not                            */
};

struct store_study_new {
    const char *name;
    const char *columns_json;    /* names of the cells: a JSON array of texts                  */
    const char *responses_json;  /* names of the results to show; NULL: those of a cohort      */
    const char *client;          /* as in store_new, with the next two                         */
    const char *idempotency_key; /* NULL: none                                                 */
    unsigned char body_digest[STORE_DIGEST_BYTES];
    int64_t waiting_max; /* refuse when more points than these would wait; 0: no limit         */
    size_t count;
    const struct store_study_point_new *point; /* [count], line 1 ...                          */
};

struct store_study_accepted {
    enum store_acceptance acceptance; /* ACCEPTED, REPLAYED, KEY_CONFLICT or FULL              */
    struct uuid id;                   /* valid for ACCEPTED, REPLAYED                          */
    int64_t waiting;                  /* points that wait now, of all studies                  */
};

/* Stores a study and its points durably, all or nothing. */
ISCHIA_MUST_CHECK enum ischia_code
store_study_accept(struct store *store, const struct store_study_new *what,
                   struct store_study_accepted *ret, struct ischia_error *err);

struct store_study {
    struct uuid id;
    int64_t seq; /* order of acceptance                                                        */
    int64_t created_ms, started_ms, finished_ms;
    bool cancelled;
    int64_t count[QUEUE_STATE_COUNT]; /* points by state, refused ones not among them */
    int64_t refused;
    char *name, *columns_json, *responses_json; /* the last is NULL for a cohort               */
};
void store_study_finish(struct store_study *study); /* a zeroed one is allowed */

/* ret's strings are the caller's: store_study_finish. Only STORE_DONE fills *ret. */
ISCHIA_MUST_CHECK enum ischia_code
store_study_get(struct store *store, const struct uuid *id, struct store_study *ret,
                enum store_answer *ret_answer, struct ischia_error *err);

/* Called for each, the newest first; valid during the call. False stops. */
typedef bool store_on_study(void *context, const struct store_study *study);
/* At most limit (1 ... STORE_LIST_LIMIT_MAX) of those accepted before `seq` (0: of all). */
ISCHIA_MUST_CHECK enum ischia_code store_study_list(struct store *store, int64_t seq, int limit,
                                                    store_on_study *on_study, void *context,
                                                    struct ischia_error *err);

struct store_study_point {
    int64_t line;
    enum queue_state state;
    bool refused;
    char *cells_json, *case_json; /* case_json is NULL when refused                            */
    char *outcome_json;           /* succeeded: the result; failed: the problem; else NULL     */
};

/* Called for each point in order of its line; valid during the call. False stops. */
typedef bool store_on_study_point(void *context, const struct store_study_point *point);
ISCHIA_MUST_CHECK enum ischia_code store_study_points(struct store *store, const struct uuid *id,
                                                      store_on_study_point *on_point, void *context,
                                                      struct ischia_error *err);

struct store_study_claim {
    struct uuid study;
    int64_t line, attempt; /* attempt: the fencing number, as of assessments */
    int crashes;
    char *case_json; /* free() */
};

/* Takes the next waiting point, oldest study first: queued -> running. Points whose case has been
 * solved before, for whom ever, are finished from that result on the way. STORE_NOT_FOUND when
 * nothing is left to solve. Errors as of store_claim_next: then the caller owes a
 * store_study_settle to queued. */
ISCHIA_MUST_CHECK enum ischia_code
store_study_claim_next(struct store *store, struct store_study_claim *ret,
                       enum store_answer *ret_answer, struct ischia_error *err);

/* running -> succeeded (outcome_json: the result), failed (the problem), or queued again (NULL;
 * crashed: its worker died, which is counted). STORE_CONFLICT: another attempt, or it is over. */
ISCHIA_MUST_CHECK enum ischia_code
store_study_settle(struct store *store, const struct uuid *id, int64_t line, int64_t attempt,
                   enum queue_state to, const char *outcome_json, bool crashed,
                   enum store_answer *ret_answer, struct ischia_error *err);

/* Whatever is not over yet -> cancelled. STORE_CONFLICT when the study is over, unless it was
 * cancelled: cancelling twice is STORE_DONE. */
ISCHIA_MUST_CHECK enum ischia_code store_study_cancel(struct store *store, const struct uuid *id,
                                                      enum store_answer *ret_answer,
                                                      struct ischia_error *err);

/* Erases a study with its points; the bytes are overwritten. STORE_CONFLICT while any runs. */
ISCHIA_MUST_CHECK enum ischia_code store_study_erase(struct store *store, const struct uuid *id,
                                                     enum store_answer *ret_answer,
                                                     struct ischia_error *err);
/* Erases at most one study that ended longer ago than age_max_ms (0: none); call again while
 * *ret_erased. */
ISCHIA_MUST_CHECK enum ischia_code store_study_retire(struct store *store, int64_t age_max_ms,
                                                      bool *ret_erased, struct ischia_error *err);

/* How many points wait, of all studies. */
ISCHIA_MUST_CHECK enum ischia_code store_study_waiting(struct store *store, int64_t *ret,
                                                       struct ischia_error *err);

#endif
