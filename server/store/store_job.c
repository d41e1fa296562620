/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Accepting requests and the life of a job. Every change of state reads the present state, asks
 * the table in queue_state.c, and writes the new state and its change-log row, in one transaction.
 */
#include <stdlib.h>
#include <string.h>

#include "server/store/engine.h"

const char *const store_change_names[STORE_CHANGE_KIND_COUNT] = {
    [STORE_CHANGE_CREATED] = "created",   [STORE_CHANGE_STARTED] = "started",
    [STORE_CHANGE_REQUEUED] = "requeued", [STORE_CHANGE_SUCCEEDED] = "succeeded",
    [STORE_CHANGE_FAILED] = "failed",     [STORE_CHANGE_CANCELLED] = "cancelled",
    [STORE_CHANGE_ERASED] = "erased",
};

enum ischia_code change_add(struct store *store, struct db *db, enum store_change_kind kind,
                            const struct uuid *id, int64_t *ret_seq, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_CHANGE_ADD);
    query_put_integer(&query, (int64_t)kind);
    query_put_blob(&query, id->byte, UUID_BYTES);
    query_put_integer(&query, store_now_ms(store));
    return query_number(&query, 0, ret_seq, err);
}

/* *ret_rowid is 0 when the case has not been solved. */
static enum ischia_code find_solution(struct db *db, const unsigned char *case_key,
                                      int64_t *ret_rowid, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_SOLUTION_FIND);
    query_put_blob(&query, case_key, STORE_DIGEST_BYTES);
    return query_number(&query, 0, ret_rowid, err);
}

static enum ischia_code count_queued(struct db *db, int *ret, struct ischia_error *err)
{
    struct query query;
    int64_t queued = 0;
    query_begin(&query, db, SQL_QUEUED);
    TRY(query_number(&query, 0, &queued, err));
    *ret = (int)queued;
    return ISCHIA_OK;
}

/* find_solution and count_queued at once. */
static enum ischia_code look_before_accepting(struct db *db, const unsigned char *case_key,
                                              int64_t *ret_rowid, int *ret_queued,
                                              struct ischia_error *err)
{
    struct query query;
    bool row = false;
    query_begin(&query, db, SQL_ACCEPT_LOOK);
    query_put_blob(&query, case_key, STORE_DIGEST_BYTES);
    const enum ischia_code code = query_step(&query, &row, err);
    *ret_queued = code == ISCHIA_OK && row ? (int)query_integer(&query, 0) : 0;
    *ret_rowid = code == ISCHIA_OK && row ? query_integer(&query, 1) : 0;
    query_end(&query);
    return code;
}

/* ---------------------------------------------------------------------------- accepting */

struct accept {
    struct store_new what; /* its texts: the caller's, or copies behind this struct */
    struct uuid id;
    struct store_accepted accepted;
    store_accept_done *done; /* store_accept_later */
    void *context;
    struct write write;
};

/* *ret_answered: the key was used before, and accept->accepted says with what. */
static enum ischia_code look_up_key(struct store *store, struct db *db, struct accept *accept,
                                    bool *ret_answered, struct ischia_error *err)
{
    *ret_answered = false;
    if (accept->what.idempotency_key == NULL) return ISCHIA_OK;
    struct query query;
    query_begin(&query, db, SQL_KEY_FIND);
    query_put_text(&query, accept->what.client);
    query_put_text(&query, accept->what.idempotency_key);
    query_put_integer(&query, store_now_ms(store) - store->idempotency_ms);
    unsigned char digest[STORE_DIGEST_BYTES];
    struct store_accepted *ret = &accept->accepted;
    enum ischia_code code = query_step(&query, ret_answered, err);
    if (code == ISCHIA_OK && *ret_answered) {
        code = query_blob(&query, 0, digest, sizeof digest, err);
        if (code == ISCHIA_OK) code = query_blob(&query, 1, ret->id.byte, UUID_BYTES, err);
        ret->state = (enum queue_state)query_integer(&query, 2);
        ret->created_ms = query_integer(&query, 3);
    }
    query_end(&query);
    if (code != ISCHIA_OK || !*ret_answered) return code;
    const bool same = memcmp(digest, accept->what.body_digest, sizeof digest) == 0;
    ret->acceptance = same ? STORE_REPLAYED : STORE_KEY_CONFLICT;
    return ISCHIA_OK;
}

static enum ischia_code remember_key(struct db *db, const struct accept *accept, int64_t seq,
                                     struct ischia_error *err)
{
    if (accept->what.idempotency_key == NULL) return ISCHIA_OK;
    struct query query;
    query_begin(&query, db, SQL_KEY_PUT);
    query_put_text(&query, accept->what.client);
    query_put_text(&query, accept->what.idempotency_key);
    query_put_blob(&query, accept->what.body_digest, STORE_DIGEST_BYTES);
    query_put_integer(&query, accept->accepted.created_ms);
    query_put_integer(&query, seq);
    return query_run(&query, err);
}

static enum ischia_code insert_assessment(struct db *db, const struct accept *accept, int64_t seq,
                                          int64_t change_seq, int64_t solution,
                                          struct ischia_error *err)
{
    const struct store_new *what = &accept->what;
    const int64_t now_ms = accept->accepted.created_ms;
    struct query query;
    query_begin(&query, db, SQL_ACCEPT);
    query_put_integer(&query, seq);
    query_put_blob(&query, accept->id.byte, UUID_BYTES);
    query_put_integer(&query, (int64_t)accept->accepted.state);
    query_put_integer(&query, (int64_t)what->priority);
    query_put_integer(&query, solution != 0);
    query_put_integer(&query, change_seq);
    query_put_integer(&query, now_ms);
    query_put_integer(&query, solution != 0 ? now_ms : 0);
    query_put_integer(&query, solution != 0 ? now_ms : 0);
    if (solution != 0)
        query_put_integer(&query, solution);
    else
        query_put_text(&query, NULL);
    query_put_blob(&query, what->case_key, STORE_DIGEST_BYTES);
    query_put_text(&query, what->subject);
    query_put_text(&query, what->side);
    query_put_text(&query, what->label);
    query_put_text(&query, what->measured_at);
    query_put_text(&query, what->case_json);
    query_put_text(&query, what->warnings_json);
    return query_run(&query, err);
}

static enum ischia_code insert_origin(struct db *db, const struct store_new *what, int64_t seq,
                                      struct ischia_error *err)
{
    struct query query;
    if (what->origin_json == NULL) return ISCHIA_OK;
    query_begin(&query, db, SQL_ORIGIN_ADD);
    query_put_integer(&query, seq);
    query_put_text(&query, what->reference);
    query_put_text(&query, what->origin_json);
    return query_run(&query, err);
}

static enum ischia_code accept_new(struct store *store, struct db *db, struct accept *accept,
                                   int64_t solution, struct ischia_error *err)
{
    struct store_accepted *ret = &accept->accepted;
    ret->acceptance = solution != 0 ? STORE_CACHED : STORE_ACCEPTED;
    ret->state = solution != 0 ? QUEUE_SUCCEEDED : QUEUE_QUEUED;
    ret->id = accept->id;
    ret->created_ms = store_now_ms(store);
    int64_t seq = 0;
    TRY(change_add(store, db, STORE_CHANGE_CREATED, &accept->id, &seq, err));
    int64_t change_seq = seq;
    if (solution != 0)
        TRY(change_add(store, db, STORE_CHANGE_SUCCEEDED, &accept->id, &change_seq, err));
    TRY(insert_assessment(db, accept, seq, change_seq, solution, err));
    TRY(insert_origin(db, &accept->what, seq, err));
    return remember_key(db, accept, seq, err);
}

static enum ischia_code accept_run(struct store *store, struct db *db, void *operation,
                                   struct ischia_error *err)
{
    struct accept *accept = operation;
    accept->accepted = (struct store_accepted){0};
    bool answered = false;
    TRY(look_up_key(store, db, accept, &answered, err));
    if (answered) return count_queued(db, &accept->accepted.queued, err);
    int64_t solution = 0;
    int queued = 0;
    TRY(look_before_accepting(db, accept->what.case_key, &solution, &queued, err));
    const int queued_max = accept->what.queued_max;
    if (solution == 0 && queued_max > 0 && queued >= queued_max) {
        accept->accepted.acceptance = STORE_FULL;
        accept->accepted.queued = queued;
        return ISCHIA_OK;
    }
    TRY(accept_new(store, db, accept, solution, err));
    accept->accepted.queued = queued + (solution == 0);
    return ISCHIA_OK;
}

enum ischia_code store_accept(struct store *store, const struct store_new *what,
                              struct store_accepted *ret, struct ischia_error *err)
{
    struct accept accept = {.what = *what};
    accept.write = (struct write){.run = accept_run, .operation = &accept};
    if (accept.what.client == NULL) accept.what.client = "";
    TRY(uuid_make(store_now_ms(store), &accept.id, err));
    TRY(write_run(store, &accept.write, err));
    *ret = accept.accepted;
    return ISCHIA_OK;
}

static void accept_done(struct store *store, struct write *write)
{
    (void)store;
    struct accept *accept = write->operation;
    accept->done(accept->context, write->code, &accept->accepted, &write->err);
    free(accept);
}

enum { NEW_TEXTS = 10 };

static void list_texts(struct store_new *what, const char **ret[NEW_TEXTS])
{
    const char **const texts[NEW_TEXTS] = {
        &what->subject,   &what->side,          &what->label,  &what->measured_at,
        &what->case_json, &what->warnings_json, &what->client, &what->idempotency_key,
        &what->reference, &what->origin_json};
    memcpy(ret, texts, sizeof texts);
}

/* One block: the struct, then its texts. NULL when there is no memory. */
static struct accept *copy_accept(const struct store_new *what)
{
    struct store_new copy = *what;
    if (copy.client == NULL) copy.client = "";
    const char **texts[NEW_TEXTS];
    list_texts(&copy, texts);
    size_t room = 0;
    for (int i = 0; i < NEW_TEXTS; i++) room += *texts[i] == NULL ? 0 : strlen(*texts[i]) + 1;
    struct accept *accept = malloc(sizeof *accept + room);
    if (accept == NULL) return NULL;
    char *free_text = (char *)(accept + 1);
    for (int i = 0; i < NEW_TEXTS; i++) {
        if (*texts[i] == NULL) continue;
        const char *source = *texts[i];
        *texts[i] = free_text;
        free_text = stpcpy(free_text, source) + 1;
    }
    *accept = (struct accept){.what = copy};
    return accept;
}

enum ischia_code store_accept_later(struct store *store, const struct store_new *what,
                                    store_accept_done *done, void *context,
                                    struct ischia_error *err)
{
    struct accept *accept = copy_accept(what);
    CHECK(accept != NULL, err, ISCHIA_E_MEMORY, "no memory for a request");
    accept->done = done;
    accept->context = context;
    accept->write = (struct write){.run = accept_run, .operation = accept, .done = accept_done};
    enum ischia_code code = uuid_make(store_now_ms(store), &accept->id, err);
    if (code == ISCHIA_OK) code = write_later(store, &accept->write, err);
    if (code != ISCHIA_OK) free(accept);
    return code;
}

/* --------------------------------------------------------------------- changes of state */

struct present { /* what a job is before a step */
    int64_t seq, attempt, solution;
    int crashes;
    enum queue_state state;
    unsigned char case_key[STORE_DIGEST_BYTES];
};

static enum ischia_code find_present(struct db *db, const struct uuid *id, struct present *ret,
                                     bool *ret_found, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STATE);
    query_put_blob(&query, id->byte, UUID_BYTES);
    enum ischia_code code = query_step(&query, ret_found, err);
    if (code == ISCHIA_OK && *ret_found) {
        ret->seq = query_integer(&query, 0);
        ret->state = (enum queue_state)query_integer(&query, 1);
        ret->attempt = query_integer(&query, 2);
        code = query_blob(&query, 3, ret->case_key, STORE_DIGEST_BYTES, err);
        ret->crashes = (int)query_integer(&query, 4);
        ret->solution = query_integer(&query, 5);
    }
    query_end(&query);
    return code;
}

enum { ANY_ATTEMPT = -1 };

struct step {
    struct uuid id;
    enum queue_state to;
    int64_t attempt;  /* that the job must be in; ANY_ATTEMPT */
    const char *text; /* result or problem document */
    const unsigned char *field;
    size_t field_size;
    bool crashed;
    enum queue_state was;
    enum store_answer answer;
};

static const enum store_change_kind change_of[QUEUE_STATE_COUNT] = {
    [QUEUE_QUEUED] = STORE_CHANGE_REQUEUED,     [QUEUE_RUNNING] = STORE_CHANGE_STARTED,
    [QUEUE_SUCCEEDED] = STORE_CHANGE_SUCCEEDED, [QUEUE_FAILED] = STORE_CHANGE_FAILED,
    [QUEUE_CANCELLED] = STORE_CHANGE_CANCELLED,
};

/* An equal case may have been solved by another worker at the same time: the same bits, so the
 * first stays. */
static enum ischia_code put_solution(struct store *store, struct db *db,
                                     const unsigned char *case_key, const struct step *step,
                                     int64_t *ret_rowid, struct ischia_error *err)
{
    TRY(find_solution(db, case_key, ret_rowid, err));
    if (*ret_rowid != 0) return ISCHIA_OK;
    struct query query;
    query_begin(&query, db, SQL_SOLUTION_ADD);
    query_put_blob(&query, case_key, STORE_DIGEST_BYTES);
    query_put_integer(&query, store_now_ms(store));
    query_put_text(&query, step->text);
    query_put_blob(&query, step->field, step->field_size);
    return query_number(&query, 0, ret_rowid, err);
}

/* What was solved before begins and ends now. */
static enum ischia_code mark_succeeded(struct store *store, struct db *db, int64_t seq,
                                       int64_t change_seq, int64_t solution, bool cached,
                                       struct ischia_error *err)
{
    const int64_t now_ms = store_now_ms(store);
    struct query query;
    query_begin(&query, db, SQL_SUCCEED);
    query_put_integer(&query, solution);
    query_put_integer(&query, cached);
    if (cached)
        query_put_integer(&query, now_ms);
    else
        query_put_text(&query, NULL);
    query_put_integer(&query, now_ms);
    query_put_integer(&query, change_seq);
    query_put_integer(&query, seq);
    return query_run(&query, err);
}

static enum ischia_code write_step(struct store *store, struct db *db, const struct present *now,
                                   const struct step *step, int64_t change_seq,
                                   struct ischia_error *err)
{
    struct query query;
    int64_t solution = 0;
    switch (step->to) {
    case QUEUE_SUCCEEDED:
        TRY(put_solution(store, db, now->case_key, step, &solution, err));
        return mark_succeeded(store, db, now->seq, change_seq, solution, false, err);
    case QUEUE_FAILED:
        query_begin(&query, db, SQL_FAIL);
        query_put_text(&query, step->text);
        query_put_integer(&query, store_now_ms(store));
        break;
    case QUEUE_CANCELLED:
        query_begin(&query, db, SQL_CANCEL);
        query_put_integer(&query, store_now_ms(store));
        break;
    default: /* QUEUE_QUEUED: back into the queue */
        query_begin(&query, db, SQL_REQUEUE);
        query_put_integer(&query, step->crashed);
        break;
    }
    query_put_integer(&query, change_seq);
    query_put_integer(&query, now->seq);
    return query_run(&query, err);
}

static enum ischia_code step_run(struct store *store, struct db *db, void *operation,
                                 struct ischia_error *err)
{
    struct step *step = operation;
    struct present now = {0};
    bool found = false;
    TRY(find_present(db, &step->id, &now, &found, err));
    step->was = now.state;
    step->answer = STORE_NOT_FOUND;
    if (!found) return ISCHIA_OK;
    step->answer = STORE_CONFLICT;
    if (!queue_may_follow(now.state, step->to)) return ISCHIA_OK;
    const bool fenced = step->attempt != ANY_ATTEMPT;
    if (fenced && (now.state != QUEUE_RUNNING || now.attempt != step->attempt)) return ISCHIA_OK;
    int64_t change_seq = 0;
    TRY(change_add(store, db, change_of[step->to], &step->id, &change_seq, err));
    TRY(write_step(store, db, &now, step, change_seq, err));
    step->answer = STORE_DONE;
    return ISCHIA_OK;
}

static enum ischia_code take_step(struct store *store, struct step *step,
                                  enum store_answer *ret_answer, struct ischia_error *err)
{
    struct write write = {.run = step_run, .operation = step};
    TRY(write_run(store, &write, err));
    *ret_answer = step->answer;
    return ISCHIA_OK;
}

enum ischia_code store_succeed(struct store *store, const struct uuid *id, int64_t attempt,
                               const char *result_json, const unsigned char *field,
                               size_t field_size, enum store_answer *ret_answer,
                               struct ischia_error *err)
{
    struct step step = {.id = *id,
                        .to = QUEUE_SUCCEEDED,
                        .attempt = attempt,
                        .text = result_json,
                        .field = field,
                        .field_size = field_size};
    return take_step(store, &step, ret_answer, err);
}

enum ischia_code store_fail(struct store *store, const struct uuid *id, int64_t attempt,
                            const char *problem_json, enum store_answer *ret_answer,
                            struct ischia_error *err)
{
    struct step step = {.id = *id, .to = QUEUE_FAILED, .attempt = attempt, .text = problem_json};
    return take_step(store, &step, ret_answer, err);
}

enum ischia_code store_requeue(struct store *store, const struct uuid *id, int64_t attempt,
                               bool crashed, enum store_answer *ret_answer,
                               struct ischia_error *err)
{
    struct step step = {.id = *id, .to = QUEUE_QUEUED, .attempt = attempt, .crashed = crashed};
    return take_step(store, &step, ret_answer, err);
}

enum ischia_code store_cancel(struct store *store, const struct uuid *id, enum queue_state *ret_was,
                              enum store_answer *ret_answer, struct ischia_error *err)
{
    struct step step = {.id = *id, .to = QUEUE_CANCELLED, .attempt = ANY_ATTEMPT};
    TRY(take_step(store, &step, ret_answer, err));
    *ret_was = step.was;
    return ISCHIA_OK;
}

/* ------------------------------------------------------------------------------ claiming */

enum { CACHED_MAX = 64 }; /* finished from the cache in one transaction */

struct claim {
    struct store_claim claim;
    bool found;
    struct uuid cached[CACHED_MAX];
    int cached_count;
};

struct next {
    int64_t seq;
    unsigned char case_key[STORE_DIGEST_BYTES];
};

static enum ischia_code find_next(struct db *db, struct claim *claim, struct next *ret,
                                  struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_NEXT);
    enum ischia_code code = query_step(&query, &claim->found, err);
    if (code == ISCHIA_OK && claim->found) {
        code = query_blob(&query, 0, claim->claim.id.byte, UUID_BYTES, err);
        ret->seq = query_integer(&query, 1);
        claim->claim.attempt = query_integer(&query, 2) + 1;
        claim->claim.crashes = (int)query_integer(&query, 3);
        if (code == ISCHIA_OK) code = query_blob(&query, 4, ret->case_key, STORE_DIGEST_BYTES, err);
        if (code == ISCHIA_OK) code = query_text(&query, 5, &claim->claim.case_json, err);
    }
    query_end(&query);
    return code;
}

static enum ischia_code start_job(struct store *store, struct db *db, const struct claim *claim,
                                  int64_t seq, struct ischia_error *err)
{
    int64_t change_seq = 0;
    TRY(change_add(store, db, STORE_CHANGE_STARTED, &claim->claim.id, &change_seq, err));
    struct query query;
    query_begin(&query, db, SQL_START);
    query_put_integer(&query, store_now_ms(store));
    query_put_integer(&query, change_seq);
    query_put_integer(&query, seq);
    return query_run(&query, err);
}

static enum ischia_code finish_cached(struct store *store, struct db *db, struct claim *claim,
                                      int64_t seq, int64_t solution, struct ischia_error *err)
{
    int64_t change_seq = 0;
    TRY(change_add(store, db, STORE_CHANGE_SUCCEEDED, &claim->claim.id, &change_seq, err));
    TRY(mark_succeeded(store, db, seq, change_seq, solution, true, err));
    claim->cached[claim->cached_count++] = claim->claim.id;
    return ISCHIA_OK;
}

static void forget_claim(struct claim *claim)
{
    free(claim->claim.case_json);
    claim->claim.case_json = NULL;
    claim->found = false;
}

static enum ischia_code claim_run(struct store *store, struct db *db, void *operation,
                                  struct ischia_error *err)
{
    struct claim *claim = operation;
    forget_claim(claim);
    for (claim->cached_count = 0; claim->cached_count < CACHED_MAX;) {
        struct next next = {0};
        int64_t solution = 0;
        TRY(find_next(db, claim, &next, err));
        if (!claim->found) return ISCHIA_OK;
        TRY(find_solution(db, next.case_key, &solution, err));
        if (solution == 0) return start_job(store, db, claim, next.seq, err);
        TRY(finish_cached(store, db, claim, next.seq, solution, err));
        forget_claim(claim);
    }
    return ISCHIA_OK;
}

enum ischia_code store_claim_next(struct store *store,
                                  void (*on_cached)(void *context, const struct uuid *id),
                                  void *context, struct store_claim *ret,
                                  enum store_answer *ret_answer, struct ischia_error *err)
{
    struct claim claim = {0};
    do {
        struct write write = {.run = claim_run, .operation = &claim};
        const enum ischia_code code = write_run(store, &write, err);
        if (code != ISCHIA_OK) {
            if (claim.found) *ret = claim.claim; /* perhaps it was committed all the same */
            forget_claim(&claim);
            ret->case_json = NULL;
            return code;
        }
        for (int i = 0; i < claim.cached_count; i++) on_cached(context, &claim.cached[i]);
    } while (!claim.found && claim.cached_count == CACHED_MAX);
    *ret_answer = claim.found ? STORE_DONE : STORE_NOT_FOUND;
    if (claim.found) *ret = claim.claim;
    return ISCHIA_OK;
}

/* ------------------------------------------------------------------------------ recovery */

static enum ischia_code find_running(struct db *db, struct uuid *ret_id, bool *ret_found,
                                     struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_RUNNING);
    enum ischia_code code = query_step(&query, ret_found, err);
    if (code == ISCHIA_OK && *ret_found)
        code = query_blob(&query, 0, ret_id->byte, UUID_BYTES, err);
    query_end(&query);
    return code;
}

/* Points of studies that ran are not counted: nobody is told of them one by one. */
enum ischia_code recover_run(struct store *store, struct db *db, void *operation,
                             struct ischia_error *err)
{
    int *requeued = operation;
    *requeued = 0;
    for (bool found = true;;) {
        struct step step = {.to = QUEUE_QUEUED, .attempt = ANY_ATTEMPT};
        TRY(find_running(db, &step.id, &found, err));
        if (!found) return db_run(db, SQL_STUDY_RECOVER, err);
        TRY(step_run(store, db, &step, err));
        ++*requeued;
    }
}

enum ischia_code store_recover(struct store *store, int *ret_requeued, struct ischia_error *err)
{
    struct write write = {.run = recover_run, .operation = ret_requeued};
    return write_run(store, &write, err);
}

/* ------------------------------------------------------------------------------- erasing */

struct erase {
    struct uuid id;
    enum store_answer answer;
};

static enum ischia_code drop_row(struct db *db, enum sql sql, int64_t rowid,
                                 struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, sql);
    query_put_integer(&query, rowid);
    return query_run(&query, err);
}

static enum ischia_code erase_run(struct store *store, struct db *db, void *operation,
                                  struct ischia_error *err)
{
    struct erase *erase = operation;
    struct present now = {0};
    bool found = false;
    TRY(find_present(db, &erase->id, &now, &found, err));
    erase->answer = found ? STORE_CONFLICT : STORE_NOT_FOUND;
    if (!found || now.state == QUEUE_RUNNING) return ISCHIA_OK;
    int64_t change_seq = 0;
    TRY(drop_row(db, SQL_ERASE, now.seq, err)); /* its idempotency keys go with it */
    if (now.solution != 0) TRY(drop_row(db, SQL_SOLUTION_DROP, now.solution, err));
    TRY(change_add(store, db, STORE_CHANGE_ERASED, &erase->id, &change_seq, err));
    erase->answer = STORE_DONE;
    return ISCHIA_OK;
}

enum ischia_code store_erase(struct store *store, const struct uuid *id,
                             enum store_answer *ret_answer, struct ischia_error *err)
{
    struct erase erase = {.id = *id};
    struct write write = {.run = erase_run, .operation = &erase, .erases = true};
    TRY(write_run(store, &write, err));
    *ret_answer = erase.answer;
    return ISCHIA_OK;
}

struct retire {
    struct store_retention rule;
    int batch;
    int erased;
};

/* The next finished assessment that the rule no longer keeps. `finished`: how many there are. */
static enum ischia_code
find_unwanted(struct store *store, struct db *db, const struct store_retention *rule,
              int64_t finished, struct uuid *ret_id, bool *ret_found, struct ischia_error *err)
{
    const bool too_many = rule->count_max > 0 && finished > rule->count_max;
    *ret_found = false;
    if (!too_many && rule->age_max_ms <= 0) return ISCHIA_OK;
    struct query query;
    query_begin(&query, db, too_many ? SQL_TOO_MANY : SQL_TOO_OLD);
    if (!too_many) query_put_integer(&query, store_now_ms(store) - rule->age_max_ms);
    enum ischia_code code = query_step(&query, ret_found, err);
    if (code == ISCHIA_OK && *ret_found)
        code = query_blob(&query, 0, ret_id->byte, UUID_BYTES, err);
    query_end(&query);
    return code;
}

static enum ischia_code retire_run(struct store *store, struct db *db, void *operation,
                                   struct ischia_error *err)
{
    struct retire *retire = operation;
    retire->erased = 0;
    TRY(drop_row(db, SQL_KEY_EXPIRE, store_now_ms(store) - store->idempotency_ms, err));
    int64_t finished = 0;
    struct query query;
    query_begin(&query, db, SQL_FINISHED);
    TRY(query_number(&query, 0, &finished, err));
    while (retire->erased < retire->batch) {
        struct erase erase = {0};
        bool found = false;
        TRY(find_unwanted(store, db, &retire->rule, finished - retire->erased, &erase.id, &found,
                          err));
        if (!found) return ISCHIA_OK;
        TRY(erase_run(store, db, &erase, err));
        retire->erased++;
    }
    return ISCHIA_OK;
}

enum ischia_code store_retire(struct store *store, const struct store_retention *rule, int batch,
                              int *ret_erased, struct ischia_error *err)
{
    struct retire retire = {.rule = *rule, .batch = batch};
    struct write write = {.run = retire_run, .operation = &retire, .erases = true};
    TRY(write_run(store, &write, err));
    *ret_erased = retire.erased;
    return ISCHIA_OK;
}
