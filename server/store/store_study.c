/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * Studies and their points. As for assessments, every change of state reads the present one, asks
 * the table in queue_state.c, and writes, in one transaction.
 */
#include "server/store/studies.h"

#include <stdlib.h>
#include <string.h>

#include "server/store/engine.h"

/* One number out of a statement with one number, or one id, as its parameter; -1: no row. */
static enum ischia_code number_by(struct db *db, enum sql sql, const struct uuid *id, int64_t seq,
                                  int64_t *ret, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, sql);
    if (id != NULL)
        query_put_blob(&query, id->byte, UUID_BYTES);
    else
        query_put_integer(&query, seq);
    return query_number(&query, -1, ret, err);
}

static enum ischia_code count_waiting(struct db *db, int64_t *ret, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_WAITING);
    return query_number(&query, 0, ret, err);
}

/* Marks a study as over once none of its points is left to solve. */
static enum ischia_code end_if_over(struct store *store, struct db *db, int64_t seq,
                                    struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_END);
    query_put_integer(&query, store_now_ms(store));
    query_put_integer(&query, seq);
    return query_run(&query, err);
}

/* ---------------------------------------------------------------------------- accepting */

struct study_accept {
    const struct store_study_new *what;
    struct uuid id;
    struct store_study_accepted accepted;
};

/* *ret_answered: the key was used before, and accept->accepted says with what. */
static enum ischia_code look_up_key(struct store *store, struct db *db, struct study_accept *accept,
                                    bool *ret_answered, struct ischia_error *err)
{
    const struct store_study_new *what = accept->what;
    unsigned char digest[STORE_DIGEST_BYTES];
    struct query query;
    *ret_answered = false;
    if (what->idempotency_key == NULL) return ISCHIA_OK;
    query_begin(&query, db, SQL_STUDY_KEY_FIND);
    query_put_text(&query, what->client);
    query_put_text(&query, what->idempotency_key);
    query_put_integer(&query, store_now_ms(store) - store->idempotency_ms);
    enum ischia_code code = query_step(&query, ret_answered, err);
    if (code == ISCHIA_OK && *ret_answered) {
        code = query_blob(&query, 0, digest, sizeof digest, err);
        if (code == ISCHIA_OK)
            code = query_blob(&query, 1, accept->accepted.id.byte, UUID_BYTES, err);
    }
    query_end(&query);
    if (code != ISCHIA_OK || !*ret_answered) return code;
    const bool same = memcmp(digest, what->body_digest, sizeof digest) == 0;
    accept->accepted.acceptance = same ? STORE_REPLAYED : STORE_KEY_CONFLICT;
    return ISCHIA_OK;
}

/* A key that is too old to count, but still there, would be in the way. */
static enum ischia_code free_key(struct db *db, const struct store_study_new *what,
                                 struct ischia_error *err)
{
    struct query query;
    if (what->idempotency_key == NULL) return ISCHIA_OK;
    query_begin(&query, db, SQL_STUDY_KEY_FREE);
    query_put_text(&query, what->client);
    query_put_text(&query, what->idempotency_key);
    return query_run(&query, err);
}

static enum ischia_code insert_study(struct store *store, struct db *db,
                                     const struct study_accept *accept, int64_t *ret_seq,
                                     struct ischia_error *err)
{
    const struct store_study_new *what = accept->what;
    struct query query;
    query_begin(&query, db, SQL_STUDY_ADD);
    query_put_blob(&query, accept->id.byte, UUID_BYTES);
    query_put_text(&query, what->name);
    query_put_text(&query, what->columns_json);
    query_put_text(&query, what->responses_json);
    query_put_integer(&query, store_now_ms(store));
    query_put_text(&query, what->client);
    query_put_text(&query, what->idempotency_key);
    query_put_blob(&query, what->body_digest, STORE_DIGEST_BYTES);
    TRY(query_run(&query, err));
    return number_by(db, SQL_STUDY_SEQ, &accept->id, 0, ret_seq, err);
}

static enum ischia_code insert_point(struct db *db, int64_t seq, int64_t line,
                                     const struct store_study_point_new *point,
                                     struct ischia_error *err)
{
    const bool refused = point->problem_json != NULL;
    struct query query;
    query_begin(&query, db, SQL_STUDY_POINT_ADD);
    query_put_integer(&query, seq);
    query_put_integer(&query, line);
    query_put_integer(&query, refused ? QUEUE_FAILED : QUEUE_QUEUED);
    query_put_integer(&query, refused);
    if (refused)
        query_put_text(&query, NULL);
    else
        query_put_blob(&query, point->case_key, STORE_DIGEST_BYTES);
    query_put_text(&query, refused ? NULL : point->case_json);
    query_put_text(&query, point->cells_json);
    query_put_text(&query, point->problem_json);
    return query_run(&query, err);
}

static enum ischia_code study_accept_run(struct store *store, struct db *db, void *operation,
                                         struct ischia_error *err)
{
    struct study_accept *accept = operation;
    const struct store_study_new *what = accept->what;
    struct store_study_accepted *ret = &accept->accepted;
    bool answered = false;
    int64_t seq = 0, coming = 0;
    *ret = (struct store_study_accepted){0};
    TRY(count_waiting(db, &ret->waiting, err));
    TRY(look_up_key(store, db, accept, &answered, err));
    if (answered) return ISCHIA_OK;
    for (size_t i = 0; i < what->count; i++) coming += what->point[i].problem_json == NULL;
    ret->acceptance = STORE_FULL;
    if (what->waiting_max > 0 && ret->waiting + coming > what->waiting_max) return ISCHIA_OK;
    TRY(free_key(db, what, err));
    TRY(insert_study(store, db, accept, &seq, err));
    for (size_t i = 0; i < what->count; i++)
        TRY(insert_point(db, seq, (int64_t)i + 1, &what->point[i], err));
    TRY(end_if_over(store, db, seq, err));
    *ret = (struct store_study_accepted){STORE_ACCEPTED, accept->id, ret->waiting + coming};
    return ISCHIA_OK;
}

enum ischia_code store_study_accept(struct store *store, const struct store_study_new *what,
                                    struct store_study_accepted *ret, struct ischia_error *err)
{
    struct study_accept accept = {.what = what};
    struct write write = {.run = study_accept_run, .operation = &accept};
    TRY(uuid_make(store_now_ms(store), &accept.id, err));
    TRY(write_run(store, &write, err));
    *ret = accept.accepted;
    return ISCHIA_OK;
}

/* ------------------------------------------------------------------------------ reading */

void store_study_finish(struct store_study *study)
{
    free(study->name);
    free(study->columns_json);
    free(study->responses_json);
    *study = (struct store_study){0};
}

/* The columns of SQL_STUDY_GET and SQL_STUDY_LIST. On error *ret holds what there is. */
static enum ischia_code read_study(struct query *query, struct store_study *ret,
                                   struct ischia_error *err)
{
    ret->seq = query_integer(query, 0);
    TRY(query_blob(query, 1, ret->id.byte, UUID_BYTES, err));
    ret->created_ms = query_integer(query, 2);
    ret->started_ms = query_integer(query, 3);
    ret->finished_ms = query_integer(query, 4);
    ret->cancelled = query_integer(query, 5) != 0;
    TRY(query_text(query, 6, &ret->name, err));
    TRY(query_text(query, 7, &ret->columns_json, err));
    return query_text(query, 8, &ret->responses_json, err);
}

static enum ischia_code count_points(struct db *db, struct store_study *ret,
                                     struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_COUNT);
    query_put_integer(&query, ret->seq);
    enum ischia_code code;
    for (bool row = true;;) {
        code = query_step(&query, &row, err);
        if (code != ISCHIA_OK || !row) break;
        const int64_t state = query_integer(&query, 0), n = query_integer(&query, 2);
        if (query_integer(&query, 1) != 0)
            ret->refused += n;
        else if (state >= 0 && state < QUEUE_STATE_COUNT)
            ret->count[state] += n;
    }
    query_end(&query);
    return code;
}

static enum ischia_code get_from(struct db *db, const struct uuid *id, struct store_study *ret,
                                 bool *ret_found, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_GET);
    query_put_blob(&query, id->byte, UUID_BYTES);
    enum ischia_code code = query_step(&query, ret_found, err);
    if (code == ISCHIA_OK && *ret_found) code = read_study(&query, ret, err);
    query_end(&query);
    if (code == ISCHIA_OK && *ret_found) code = count_points(db, ret, err);
    return code;
}

enum ischia_code store_study_get(struct store *store, const struct uuid *id,
                                 struct store_study *ret, enum store_answer *ret_answer,
                                 struct ischia_error *err)
{
    struct db *db = NULL;
    struct store_study study = {0};
    bool found = false;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = get_from(db, id, &study, &found, err);
    reader_give(store, db);
    if (code != ISCHIA_OK) {
        store_study_finish(&study);
        return code;
    }
    *ret_answer = found ? STORE_DONE : STORE_NOT_FOUND;
    if (found) *ret = study;
    return ISCHIA_OK;
}

static enum ischia_code show_study(struct query *query, struct db *db, store_on_study *on_study,
                                   void *context, bool *ret_more, struct ischia_error *err)
{
    struct store_study study = {0};
    enum ischia_code code = read_study(query, &study, err);
    if (code == ISCHIA_OK) code = count_points(db, &study, err);
    if (code == ISCHIA_OK) *ret_more = on_study(context, &study);
    store_study_finish(&study);
    return code;
}

static enum ischia_code list_from(struct db *db, int64_t seq, int limit, store_on_study *on_study,
                                  void *context, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_LIST);
    query_put_integer(&query, seq == 0 ? INT64_MAX : seq);
    query_put_integer(&query, limit);
    enum ischia_code code;
    for (bool row = true, more = true;;) {
        code = query_step(&query, &row, err);
        if (code != ISCHIA_OK || !row) break;
        code = show_study(&query, db, on_study, context, &more, err);
        if (code != ISCHIA_OK || !more) break;
    }
    query_end(&query);
    return code;
}

enum ischia_code store_study_list(struct store *store, int64_t seq, int limit,
                                  store_on_study *on_study, void *context, struct ischia_error *err)
{
    CHECK(limit >= 1 && limit <= STORE_LIST_LIMIT_MAX, err, ISCHIA_E_INPUT,
          "limit is %d; accepted 1 to %d", limit, STORE_LIST_LIMIT_MAX);
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = list_from(db, seq, limit, on_study, context, err);
    reader_give(store, db);
    return code;
}

static enum ischia_code show_point(struct query *query, store_on_study_point *on_point,
                                   void *context, bool *ret_more, struct ischia_error *err)
{
    struct store_study_point point = {.line = query_integer(query, 0),
                                      .state = (enum queue_state)query_integer(query, 1),
                                      .refused = query_integer(query, 2) != 0};
    enum ischia_code code = query_text(query, 3, &point.cells_json, err);
    if (code == ISCHIA_OK) code = query_text(query, 4, &point.case_json, err);
    if (code == ISCHIA_OK) code = query_text(query, 5, &point.outcome_json, err);
    if (code == ISCHIA_OK) *ret_more = on_point(context, &point);
    free(point.cells_json);
    free(point.case_json);
    free(point.outcome_json);
    return code;
}

static enum ischia_code points_from(struct db *db, const struct uuid *id,
                                    store_on_study_point *on_point, void *context,
                                    struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_POINTS);
    query_put_blob(&query, id->byte, UUID_BYTES);
    enum ischia_code code;
    for (bool row = true, more = true;;) {
        code = query_step(&query, &row, err);
        if (code != ISCHIA_OK || !row) break;
        code = show_point(&query, on_point, context, &more, err);
        if (code != ISCHIA_OK || !more) break;
    }
    query_end(&query);
    return code;
}

enum ischia_code store_study_points(struct store *store, const struct uuid *id,
                                    store_on_study_point *on_point, void *context,
                                    struct ischia_error *err)
{
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = points_from(db, id, on_point, context, err);
    reader_give(store, db);
    return code;
}

enum ischia_code store_study_waiting(struct store *store, int64_t *ret, struct ischia_error *err)
{
    struct db *db = NULL;
    TRY(reader_take(store, &db, err));
    const enum ischia_code code = count_waiting(db, ret, err);
    reader_give(store, db);
    return code;
}

/* ------------------------------------------------------------------------------ claiming */

enum { KNOWN_MAX = 64 }; /* finished from earlier results in one transaction */

struct study_claim {
    struct store_study_claim claim;
    bool found, again;
};

struct next_point {
    int64_t seq;
    unsigned char case_key[STORE_DIGEST_BYTES];
};

static void forget_claim(struct study_claim *claim)
{
    free(claim->claim.case_json);
    *claim = (struct study_claim){0};
}

static enum ischia_code find_next(struct db *db, struct study_claim *claim, struct next_point *ret,
                                  struct ischia_error *err)
{
    struct query query;
    struct store_study_claim *c = &claim->claim;
    query_begin(&query, db, SQL_STUDY_NEXT);
    enum ischia_code code = query_step(&query, &claim->found, err);
    if (code == ISCHIA_OK && claim->found) {
        ret->seq = query_integer(&query, 0);
        c->line = query_integer(&query, 2);
        c->attempt = query_integer(&query, 3) + 1;
        c->crashes = (int)query_integer(&query, 4);
        code = query_blob(&query, 1, c->study.byte, UUID_BYTES, err);
        if (code == ISCHIA_OK) code = query_blob(&query, 5, ret->case_key, STORE_DIGEST_BYTES, err);
        if (code == ISCHIA_OK) code = query_text(&query, 6, &c->case_json, err);
    }
    query_end(&query);
    return code;
}

/* *ret is NULL when the case has not been solved; else the caller's. */
static enum ischia_code find_known(struct db *db, const unsigned char *case_key, char **ret,
                                   struct ischia_error *err)
{
    struct query query;
    bool row = false;
    *ret = NULL;
    query_begin(&query, db, SQL_STUDY_KNOWN);
    query_put_blob(&query, case_key, STORE_DIGEST_BYTES);
    query_put_blob(&query, case_key, STORE_DIGEST_BYTES);
    enum ischia_code code = query_step(&query, &row, err);
    if (code == ISCHIA_OK && row) code = query_text(&query, 0, ret, err);
    query_end(&query);
    return code;
}

static enum ischia_code mark_started(struct store *store, struct db *db, int64_t seq,
                                     struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_BEGIN);
    query_put_integer(&query, store_now_ms(store));
    query_put_integer(&query, seq);
    return query_run(&query, err);
}

static enum ischia_code put_state(struct db *db, int64_t seq, int64_t line, enum queue_state to,
                                  const char *outcome_json, bool started, bool crashed,
                                  struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_POINT_PUT);
    query_put_integer(&query, (int64_t)to);
    query_put_text(&query, outcome_json);
    query_put_integer(&query, started);
    query_put_integer(&query, crashed);
    query_put_integer(&query, seq);
    query_put_integer(&query, line);
    return query_run(&query, err);
}

/* One point: started, or finished from what is known of its case (*ret_more: look on). */
static enum ischia_code claim_one(struct store *store, struct db *db, struct study_claim *claim,
                                  bool *ret_more, struct ischia_error *err)
{
    struct next_point next = {0};
    char *known = NULL;
    *ret_more = false;
    TRY(find_next(db, claim, &next, err));
    if (!claim->found) return ISCHIA_OK;
    TRY(mark_started(store, db, next.seq, err));
    TRY(find_known(db, next.case_key, &known, err));
    const int64_t line = claim->claim.line;
    if (known == NULL) return put_state(db, next.seq, line, QUEUE_RUNNING, NULL, true, false, err);
    enum ischia_code code =
        put_state(db, next.seq, line, QUEUE_SUCCEEDED, known, false, false, err);
    free(known);
    if (code == ISCHIA_OK) code = end_if_over(store, db, next.seq, err);
    forget_claim(claim);
    *ret_more = true;
    return code;
}

static enum ischia_code study_claim_run(struct store *store, struct db *db, void *operation,
                                        struct ischia_error *err)
{
    struct study_claim *claim = operation;
    bool more = true;
    forget_claim(claim);
    for (int i = 0; i < KNOWN_MAX && more; i++) TRY(claim_one(store, db, claim, &more, err));
    claim->again = more;
    return ISCHIA_OK;
}

enum ischia_code store_study_claim_next(struct store *store, struct store_study_claim *ret,
                                        enum store_answer *ret_answer, struct ischia_error *err)
{
    struct study_claim claim = {0};
    do {
        struct write write = {.run = study_claim_run, .operation = &claim};
        const enum ischia_code code = write_run(store, &write, err);
        if (code != ISCHIA_OK) {
            if (claim.found) *ret = claim.claim; /* perhaps it was committed all the same */
            forget_claim(&claim);
            ret->case_json = NULL;
            return code;
        }
    } while (claim.again);
    *ret_answer = claim.found ? STORE_DONE : STORE_NOT_FOUND;
    if (claim.found) *ret = claim.claim;
    return ISCHIA_OK;
}

/* ------------------------------------------------------------------------------ settling */

struct study_settle {
    struct uuid id;
    int64_t line, attempt;
    enum queue_state to;
    const char *outcome_json;
    bool crashed;
    enum store_answer answer;
};

struct present_point {
    int64_t seq, attempt;
    enum queue_state state;
};

static enum ischia_code find_point(struct db *db, const struct study_settle *settle,
                                   struct present_point *ret, bool *ret_found,
                                   struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_POINT_GET);
    query_put_blob(&query, settle->id.byte, UUID_BYTES);
    query_put_integer(&query, settle->line);
    const enum ischia_code code = query_step(&query, ret_found, err);
    if (code == ISCHIA_OK && *ret_found)
        *ret = (struct present_point){.seq = query_integer(&query, 0),
                                      .state = (enum queue_state)query_integer(&query, 1),
                                      .attempt = query_integer(&query, 2)};
    query_end(&query);
    return code;
}

static enum ischia_code study_settle_run(struct store *store, struct db *db, void *operation,
                                         struct ischia_error *err)
{
    struct study_settle *settle = operation;
    struct present_point now = {0};
    bool found = false;
    TRY(find_point(db, settle, &now, &found, err));
    settle->answer = found ? STORE_CONFLICT : STORE_NOT_FOUND;
    if (!found || now.state != QUEUE_RUNNING || now.attempt != settle->attempt ||
        !queue_may_follow(now.state, settle->to))
        return ISCHIA_OK;
    TRY(put_state(db, now.seq, settle->line, settle->to, settle->outcome_json, false,
                  settle->crashed, err));
    settle->answer = STORE_DONE;
    return end_if_over(store, db, now.seq, err);
}

enum ischia_code store_study_settle(struct store *store, const struct uuid *id, int64_t line,
                                    int64_t attempt, enum queue_state to, const char *outcome_json,
                                    bool crashed, enum store_answer *ret_answer,
                                    struct ischia_error *err)
{
    struct study_settle settle = {*id, line, attempt, to, outcome_json, crashed, STORE_CONFLICT};
    struct write write = {.run = study_settle_run, .operation = &settle};
    TRY(write_run(store, &write, err));
    *ret_answer = settle.answer;
    return ISCHIA_OK;
}

/* --------------------------------------------------------------------- cancel and erase */

struct study_write {
    struct uuid id;
    enum store_answer answer;
};

static enum ischia_code find_seq(struct db *db, struct study_write *change, int64_t *ret_seq,
                                 struct ischia_error *err)
{
    TRY(number_by(db, SQL_STUDY_SEQ, &change->id, 0, ret_seq, err));
    change->answer = *ret_seq < 0 ? STORE_NOT_FOUND : STORE_DONE;
    return ISCHIA_OK;
}

static enum ischia_code study_cancel_run(struct store *store, struct db *db, void *operation,
                                         struct ischia_error *err)
{
    struct study_write *change = operation;
    int64_t seq = 0, over = 0;
    struct query query;
    TRY(find_seq(db, change, &seq, err));
    if (change->answer != STORE_DONE) return ISCHIA_OK;
    TRY(number_by(db, SQL_STUDY_OVER, NULL, seq, &over, err));
    if (over == 1) change->answer = STORE_CONFLICT; /* 2: cancelled before */
    if (over != 0) return ISCHIA_OK;
    query_begin(&query, db, SQL_STUDY_CANCEL_POINTS);
    query_put_integer(&query, seq);
    TRY(query_run(&query, err));
    query_begin(&query, db, SQL_STUDY_CANCEL);
    query_put_integer(&query, store_now_ms(store));
    query_put_integer(&query, seq);
    return query_run(&query, err);
}

enum ischia_code store_study_cancel(struct store *store, const struct uuid *id,
                                    enum store_answer *ret_answer, struct ischia_error *err)
{
    struct study_write change = {.id = *id};
    struct write write = {.run = study_cancel_run, .operation = &change};
    TRY(write_run(store, &write, err));
    *ret_answer = change.answer;
    return ISCHIA_OK;
}

static enum ischia_code drop_study(struct db *db, int64_t seq, struct ischia_error *err)
{
    struct query query;
    query_begin(&query, db, SQL_STUDY_ERASE);
    query_put_integer(&query, seq);
    return query_run(&query, err);
}

static enum ischia_code study_erase_run(struct store *store, struct db *db, void *operation,
                                        struct ischia_error *err)
{
    struct study_write *change = operation;
    int64_t seq = 0, running = 0;
    (void)store;
    TRY(find_seq(db, change, &seq, err));
    if (change->answer != STORE_DONE) return ISCHIA_OK;
    TRY(number_by(db, SQL_STUDY_RUNNING, NULL, seq, &running, err));
    if (running > 0) {
        change->answer = STORE_CONFLICT;
        return ISCHIA_OK;
    }
    return drop_study(db, seq, err);
}

enum ischia_code store_study_erase(struct store *store, const struct uuid *id,
                                   enum store_answer *ret_answer, struct ischia_error *err)
{
    struct study_write change = {.id = *id};
    struct write write = {.run = study_erase_run, .operation = &change, .erases = true};
    TRY(write_run(store, &write, err));
    *ret_answer = change.answer;
    return ISCHIA_OK;
}

struct study_retire {
    int64_t age_max_ms;
    bool erased;
};

static enum ischia_code study_retire_run(struct store *store, struct db *db, void *operation,
                                         struct ischia_error *err)
{
    struct study_retire *retire = operation;
    int64_t seq = 0;
    const int64_t before_ms = store_now_ms(store) - retire->age_max_ms;
    TRY(number_by(db, SQL_STUDY_TOO_OLD, NULL, before_ms, &seq, err));
    retire->erased = seq >= 0;
    return retire->erased ? drop_study(db, seq, err) : ISCHIA_OK;
}

enum ischia_code store_study_retire(struct store *store, int64_t age_max_ms, bool *ret_erased,
                                    struct ischia_error *err)
{
    struct study_retire retire = {.age_max_ms = age_max_ms};
    struct write write = {.run = study_retire_run, .operation = &retire, .erases = true};
    *ret_erased = false;
    if (age_max_ms <= 0) return ISCHIA_OK;
    TRY(write_run(store, &write, err));
    *ret_erased = retire.erased;
    return ISCHIA_OK;
}
