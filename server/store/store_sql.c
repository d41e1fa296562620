/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "server/store/engine.h"

#define ASSESSMENT_COLUMNS                                                                         \
    "a.id, a.seq, a.change_seq, a.state, a.priority, a.created_ms, a.started_ms, a.finished_ms, "  \
    "a.attempt, a.cached, a.subject, a.side, a.label, a.measured_at, a.case_json, "                \
    "a.warnings_json, a.problem_json, s.result_json, s.field IS NOT NULL, o.document"

#define STUDY_COLUMNS                                                                              \
    "seq, id, created_ms, started_ms, finished_ms, cancelled, name, columns_json, responses_json"

/* On a server that many daemons share: who is asking, and what belongs to no daemon that lives. */
#define ME      "own_daemon()"
#define NOBODYS "owner NOT IN (SELECT id FROM daemon)"

const struct sql_text sql_text[SQL_COUNT] = {
    [SQL_CHANGE_ADD] = {.sqlite =
                            "INSERT INTO change (kind, id, at_ms) VALUES (?, ?, ?) RETURNING seq"},
    [SQL_KEY_FIND] =
        {.sqlite = "SELECT k.body_digest, a.id, a.state, a.created_ms FROM idempotency k JOIN "
                   "assessment a ON a.seq = k.assessment WHERE k.client = ? AND k.key = ? AND "
                   "k.created_ms > ?"},
    [SQL_KEY_PUT] =
        {.sqlite =
             "INSERT INTO idempotency (client, key, body_digest, created_ms, assessment) VALUES "
             "(?, ?, ?, ?, ?) ON CONFLICT (client, key) DO UPDATE SET body_digest = "
             "excluded.body_digest, created_ms = excluded.created_ms, assessment = "
             "excluded.assessment"},
    [SQL_KEY_EXPIRE] = {.sqlite = "DELETE FROM idempotency WHERE created_ms <= ?"},
    [SQL_SOLUTION_FIND] = {.sqlite = "SELECT rowid FROM solution WHERE case_key = ?"},
    [SQL_SOLUTION_ADD] =
        {.sqlite =
             "INSERT INTO solution (case_key, created_ms, result_json, field) VALUES (?, ?, ?, "
             "?) RETURNING rowid"},
    [SQL_SOLUTION_DROP] =
        {.sqlite = "DELETE FROM solution WHERE rowid = ?1 AND NOT EXISTS (SELECT 1 FROM assessment "
                   "WHERE solution = ?1)"},
    [SQL_QUEUED] = {.sqlite = "SELECT n FROM tally WHERE state = 0"},
    /* what accepting must know, in one question */
    [SQL_ACCEPT_LOOK] = {.sqlite =
                             "SELECT n, (SELECT rowid FROM solution WHERE case_key = ?) FROM tally "
                             "WHERE state = 0"},
    [SQL_TALLY_ALL] = {.sqlite = "SELECT state, n FROM tally"},
    [SQL_OLDEST_QUEUED] =
        {.sqlite = "SELECT created_ms FROM assessment WHERE state = 0 ORDER BY seq LIMIT 1"},
    [SQL_ACCEPT] =
        {.sqlite =
             "INSERT INTO assessment (seq, id, state, priority, cached, change_seq, created_ms, "
             "started_ms, finished_ms, solution, case_key, subject, side, label, measured_at, "
             "case_json, warnings_json) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, "
             "?)"},
    [SQL_STATE] =
        {.sqlite =
             "SELECT seq, state, attempt, case_key, crashes, solution FROM assessment WHERE id "
             "= ?",
         .postgresql =
             "SELECT seq, state, CASE WHEN state = 1 AND owner <> " ME " THEN -1 ELSE attempt "
             "END, case_key, crashes, solution FROM assessment WHERE id = ? FOR UPDATE"},
    [SQL_NEXT] =
        {.sqlite =
             "SELECT id, seq, attempt, crashes, case_key, case_json FROM assessment WHERE state "
             "= 0 ORDER BY priority DESC, seq LIMIT 1",
         .postgresql =
             "SELECT id, seq, attempt, crashes, case_key, case_json FROM assessment WHERE state "
             "= 0 ORDER BY priority DESC, seq LIMIT 1 FOR UPDATE SKIP LOCKED"},
    [SQL_START] = {.sqlite =
                       "UPDATE assessment SET state = 1, attempt = attempt + 1, started_ms = ?, "
                       "change_seq = ? WHERE seq = ?",
                   .postgresql =
                       "UPDATE assessment SET state = 1, attempt = attempt + 1, started_ms = ?, "
                       "change_seq = ?, owner = " ME " WHERE seq = ?"},
    [SQL_REQUEUE] =
        {.sqlite =
             "UPDATE assessment SET state = 0, crashes = crashes + ?, change_seq = ? WHERE seq "
             "= ?"},
    [SQL_SUCCEED] =
        {.sqlite =
             "UPDATE assessment SET state = 2, solution = ?, cached = ?, started_ms = coalesce(?, "
             "started_ms), finished_ms = ?, change_seq = ? WHERE seq = ?"},
    [SQL_FAIL] =
        {.sqlite =
             "UPDATE assessment SET state = 3, problem_json = ?, finished_ms = ?, change_seq = "
             "? WHERE seq = ?"},
    [SQL_CANCEL] =
        {.sqlite =
             "UPDATE assessment SET state = 4, finished_ms = ?, change_seq = ? WHERE seq = ?"},
    [SQL_RUNNING] = {.sqlite =
                         "SELECT id, seq FROM assessment WHERE state = 1 ORDER BY seq LIMIT 1",
                     .postgresql = "SELECT id, seq FROM assessment WHERE state = 1 AND " NOBODYS
                                   " ORDER BY seq LIMIT "
                                   "1"},
    [SQL_ERASE] = {.sqlite = "DELETE FROM assessment WHERE seq = ?"},
    [SQL_TOO_OLD] =
        {.sqlite = "SELECT id FROM assessment WHERE finished_ms > 0 AND finished_ms < ? ORDER BY "
                   "finished_ms LIMIT 1"},
    [SQL_TOO_MANY] =
        {.sqlite = "SELECT id FROM assessment WHERE finished_ms > 0 ORDER BY finished_ms LIMIT 1"},
    [SQL_GET] = {.sqlite = "SELECT " ASSESSMENT_COLUMNS
                           " FROM assessment a LEFT JOIN solution s ON s.rowid = "
                           "a.solution LEFT JOIN origin o ON o.assessment = a.seq WHERE a.id = ?"},
    [SQL_FIELD] =
        {.sqlite = "SELECT s.field FROM assessment a LEFT JOIN solution s ON s.rowid = a.solution "
                   "WHERE a.id = ?"},
    [SQL_CHANGES] =
        {.sqlite = "SELECT seq, kind, id, at_ms FROM change WHERE seq > ? ORDER BY seq LIMIT ?"},
    [SQL_CHANGES_LAST] = {.sqlite = "SELECT max(seq) FROM change"},
    [SQL_TOKEN_ADD] =
        {.sqlite =
             "INSERT INTO token (id, name, digest, scopes, created_ms, expires_ms) VALUES (?, "
             "?, ?, ?, ?, ?) ON CONFLICT (id) DO NOTHING"},
    [SQL_TOKEN_GET] =
        {.sqlite = "SELECT id, name, digest, scopes, created_ms, expires_ms, revoked_ms FROM token "
                   "WHERE id = ?"},
    [SQL_TOKEN_LIST] =
        {.sqlite = "SELECT id, name, digest, scopes, created_ms, expires_ms, revoked_ms FROM token "
                   "ORDER BY created_ms, id"},
    [SQL_TOKEN_REVOKE] = {.sqlite =
                              "UPDATE token SET revoked_ms = ? WHERE id = ? AND revoked_ms = 0"},
    [SQL_TOKEN_FORGET] = {.sqlite = "DELETE FROM token WHERE revoked_ms > 0 OR (expires_ms > 0 AND "
                                    "expires_ms <= ?)"},
    [SQL_TOKEN_EPOCH_MOVE] = {.sqlite =
                                  "UPDATE number SET value = value + 1 WHERE name = 'token_epoch'"},
    [SQL_TOKEN_EPOCH] = {.sqlite = "SELECT value FROM number WHERE name = 'token_epoch'"},
    [SQL_AUDIT_HEAD] = {.sqlite = "SELECT seq, hash FROM audit ORDER BY seq DESC LIMIT 1"},
    [SQL_AUDIT_ADD] =
        {.sqlite =
             "INSERT INTO audit (seq, at_ms, who, what, subject, outcome, detail, hash) VALUES "
             "(?, ?, ?, ?, ?, ?, ?, ?)"},
    [SQL_AUDIT_LIST] =
        {.sqlite =
             "SELECT seq, at_ms, who, what, subject, outcome, detail, hash FROM audit WHERE seq "
             "> ? ORDER BY seq",
         .rows_stream = true},
    [SQL_PROBE] = {.sqlite = "UPDATE number SET value = ? WHERE name = 'probe'"},
    [SQL_ORIGIN_ADD] =
        {.sqlite = "INSERT INTO origin (assessment, reference, document) VALUES (?, ?, ?)"},
    [SQL_OUTBOX_OPEN] =
        {.sqlite = "INSERT INTO outbox_target (target, change_seq) SELECT CAST(? AS TEXT), "
                   "coalesce(max(seq), 0) FROM change WHERE true ON CONFLICT (target) DO NOTHING"},
    [SQL_OUTBOX_CLOSE] = {.sqlite = "DELETE FROM outbox_target WHERE target = ?"},
    [SQL_OUTBOX_CLEAR] = {.sqlite = "DELETE FROM outbox WHERE target = ?"},
    /* kinds 3, 4, 5: succeeded, failed, cancelled */
    [SQL_OUTBOX_FILL] =
        {.sqlite =
             "INSERT INTO outbox (target, change_seq, id, kind, created_ms, due_ms) SELECT "
             "t.target, c.seq, c.id, c.kind, c.at_ms, c.at_ms FROM outbox_target t JOIN change "
             "c ON c.seq > t.change_seq JOIN assessment a ON a.id = c.id WHERE t.target = ? AND "
             "c.kind IN (3, 4, 5) ORDER BY c.seq ON CONFLICT (target, change_seq) DO NOTHING"},
    [SQL_OUTBOX_MOVE] =
        {.sqlite =
             "UPDATE outbox_target SET change_seq = (SELECT coalesce(max(seq), 0) FROM change) "
             "WHERE target = ?"},
    [SQL_OUTBOX_NEXT] =
        {.sqlite =
             "SELECT seq, change_seq, id, kind, created_ms, attempts, due_ms FROM outbox WHERE "
             "target = ? AND given_up = 0 ORDER BY due_ms, seq LIMIT 1",
         .postgresql =
             "SELECT seq, change_seq, id, kind, created_ms, attempts, due_ms FROM outbox WHERE "
             "target = ? AND given_up = 0 AND " ME " = (SELECT min(id) FROM daemon) ORDER BY "
             "due_ms, seq LIMIT 1"},
    [SQL_OUTBOX_DONE] = {.sqlite = "DELETE FROM outbox WHERE seq = ?"},
    [SQL_OUTBOX_RETRY] =
        {.sqlite =
             "UPDATE outbox SET attempts = attempts + 1, due_ms = ?, given_up = ?, problem = ? "
             "WHERE seq = ?"},
    [SQL_OUTBOX_LIST] =
        {.sqlite =
             "SELECT seq, change_seq, id, kind, created_ms, attempts, due_ms, target, given_up, "
             "problem FROM outbox ORDER BY seq"},
    [SQL_OUTBOX_REVIVE] = {.sqlite = "UPDATE outbox SET due_ms = ?, given_up = 0"},
    [SQL_FEEDBACK_ADD] =
        {.sqlite = "INSERT INTO feedback (at_ms, service, card, document) VALUES (?, ?, ?, ?)"},
    [SQL_FEEDBACK_LIST] = {.sqlite =
                               "SELECT at_ms, service, card, document FROM feedback ORDER BY seq"},
    [SQL_STUDY_KEY_FIND] =
        {.sqlite = "SELECT body_digest, id FROM study WHERE client = ? AND idempotency_key = ? AND "
                   "created_ms > ?"},
    [SQL_STUDY_KEY_FREE] =
        {.sqlite =
             "UPDATE study SET idempotency_key = NULL WHERE client = ? AND idempotency_key = ?"},
    [SQL_STUDY_ADD] =
        {.sqlite = "INSERT INTO study (id, name, columns_json, responses_json, created_ms, client, "
                   "idempotency_key, body_digest) VALUES (?, ?, ?, ?, ?, ?, ?, ?)"},
    [SQL_STUDY_POINT_ADD] =
        {.sqlite = "INSERT INTO study_point (study, line, state, refused, case_key, case_json, "
                   "cells_json, outcome_json) VALUES (?, ?, ?, ?, ?, ?, ?, ?)"},
    [SQL_STUDY_GET] = {.sqlite = "SELECT " STUDY_COLUMNS " FROM study WHERE id = ?"},
    [SQL_STUDY_LIST] = {.sqlite = "SELECT " STUDY_COLUMNS
                                  " FROM study WHERE seq < ? ORDER BY seq DESC LIMIT ?"},
    [SQL_STUDY_COUNT] =
        {.sqlite =
             "SELECT state, refused, count(*) FROM study_point WHERE study = ? GROUP BY state, "
             "refused"},
    [SQL_STUDY_POINTS] =
        {.sqlite =
             "SELECT p.line, p.state, p.refused, p.cells_json, p.case_json, p.outcome_json FROM "
             "study s JOIN study_point p ON p.study = s.seq WHERE s.id = ? ORDER BY p.line",
         .rows_stream = true},
    [SQL_STUDY_NEXT] =
        {.sqlite =
             "SELECT s.seq, s.id, p.line, p.attempt, p.crashes, p.case_key, p.case_json FROM "
             "study_point p JOIN study s ON s.seq = p.study WHERE p.state = 0 ORDER BY p.study, "
             "p.line LIMIT 1",
         .postgresql =
             "SELECT s.seq, s.id, p.line, p.attempt, p.crashes, p.case_key, p.case_json FROM "
             "study_point p JOIN study s ON s.seq = p.study WHERE p.state = 0 ORDER BY p.study, "
             "p.line LIMIT 1 FOR UPDATE OF p SKIP LOCKED"},
    [SQL_STUDY_KNOWN] =
        {.sqlite =
             "SELECT result_json FROM solution WHERE case_key = ? UNION ALL SELECT outcome_json "
             "FROM study_point WHERE case_key = ? AND state = 2 LIMIT 1"},
    [SQL_STUDY_BEGIN] = {.sqlite =
                             "UPDATE study SET started_ms = ? WHERE seq = ? AND started_ms = 0"},
    [SQL_STUDY_POINT_PUT] =
        {.sqlite = "UPDATE study_point SET state = ?, outcome_json = ?, attempt = attempt + ?, "
                   "crashes = crashes + ? WHERE study = ? AND line = ?",
         .postgresql = "UPDATE study_point SET state = ?, outcome_json = ?, attempt = attempt + ?, "
                       "crashes = crashes + ?, owner = " ME " WHERE study = ? AND line = ?"},
    [SQL_STUDY_POINT_GET] =
        {.sqlite = "SELECT s.seq, p.state, p.attempt FROM study s JOIN study_point p ON p.study = "
                   "s.seq WHERE s.id = ? AND p.line = ?",
         .postgresql =
             "SELECT s.seq, p.state, CASE WHEN p.state = 1 AND p.owner <> " ME " THEN -1 ELSE "
             "p.attempt END FROM study s JOIN study_point p ON p.study = s.seq WHERE s.id = ? "
             "AND p.line = ? FOR UPDATE OF p"},
    [SQL_STUDY_END] =
        {.sqlite = "UPDATE study SET finished_ms = ?1 WHERE seq = ?2 AND finished_ms = 0 AND NOT "
                   "EXISTS (SELECT 1 FROM study_point WHERE study = ?2 AND state < 2)"},
    [SQL_STUDY_SEQ] = {.sqlite = "SELECT seq FROM study WHERE id = ?"},
    /* 0: not over, 1: over, 2: cancelled */
    [SQL_STUDY_OVER] =
        {.sqlite =
             "SELECT CASE WHEN finished_ms = 0 THEN 0 ELSE 1 + cancelled END FROM study WHERE "
             "seq = ?"},
    [SQL_STUDY_CANCEL_POINTS] =
        {.sqlite = "UPDATE study_point SET state = 4 WHERE study = ? AND state < 2"},
    [SQL_STUDY_CANCEL] = {.sqlite =
                              "UPDATE study SET cancelled = 1, finished_ms = ? WHERE seq = ?"},
    [SQL_STUDY_RUNNING] = {.sqlite =
                               "SELECT count(*) FROM study_point WHERE study = ? AND state = 1"},
    [SQL_STUDY_ERASE] = {.sqlite = "DELETE FROM study WHERE seq = ?"},
    [SQL_STUDY_TOO_OLD] =
        {.sqlite = "SELECT seq FROM study WHERE finished_ms > 0 AND finished_ms < ? ORDER BY "
                   "finished_ms LIMIT 1"},
    [SQL_STUDY_RECOVER] = {.sqlite = "UPDATE study_point SET state = 0 WHERE state = 1",
                           .postgresql =
                               "UPDATE study_point SET state = 0 WHERE state = 1 AND " NOBODYS},
    [SQL_FINISHED] = {.sqlite = "SELECT CAST(sum(n) AS BIGINT) FROM tally WHERE state >= 2"},
    [SQL_STUDY_WAITING] = {.sqlite = "SELECT count(*) FROM study_point WHERE state = 0"},
};

#define TIMES "(a.created_ms, a.started_ms, a.finished_ms)"

const struct sql_text sql_alternative[STORE_ALTERNATIVE_KIND_COUNT] = {
    [STORE_HAS_ID] = {.sqlite = "a.id = ?"},
    [STORE_OF_PERSON] = {.sqlite =
                             "a.seq IN (SELECT seq FROM assessment WHERE subject = ? UNION SELECT "
                             "assessment FROM origin WHERE reference = ?)"},
    [STORE_IN_STATES] = {.sqlite = "(1 << a.state & ?) <> 0",
                         .postgresql = "(1::bigint << a.state::int & ?) <> 0"},
    [STORE_ENDED] = {.sqlite = "a.finished_ms >= ? AND a.finished_ms < ?"},
    [STORE_CHANGED] = {.sqlite = "max" TIMES " >= ? AND max" TIMES " < ?",
                       .postgresql = "greatest" TIMES " >= ? AND greatest" TIMES " < ?"},
};

const char *sql_for(const struct engine *engine, const struct sql_text *text)
{
    return engine->is_postgresql && text->postgresql != NULL ? text->postgresql : text->sqlite;
}

const char *const sql_assessment_columns = ASSESSMENT_COLUMNS;
