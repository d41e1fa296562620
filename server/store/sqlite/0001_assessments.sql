-- SPDX-License-Identifier: GPL-3.0-or-later
-- Assessments, their results, idempotency keys and the change log.
-- States, kinds and priorities are the numbers of server/queue_state.h and store.h.
PRAGMA application_id = 0x49736368;

-- Every change there ever was, in commit order. Rows are never removed: an erased assessment
-- leaves its id (random bits and a time) and nothing else.
CREATE TABLE change (
    seq   INTEGER PRIMARY KEY,
    kind  INTEGER NOT NULL,
    id    BLOB    NOT NULL CHECK (length(id) = 16),
    at_ms INTEGER NOT NULL
);

-- A result belongs to a case, not to a person: equal cases share it.
CREATE TABLE solution (
    rowid       INTEGER PRIMARY KEY,
    case_key    BLOB NOT NULL UNIQUE CHECK (length(case_key) = 32),
    created_ms  INTEGER NOT NULL,
    result_json TEXT NOT NULL,
    field       BLOB -- last, so that the rest is read without touching its pages
);

CREATE TABLE assessment (
    seq           INTEGER PRIMARY KEY, -- that of its "created" change: never used twice
    id            BLOB    NOT NULL UNIQUE CHECK (length(id) = 16),
    state         INTEGER NOT NULL CHECK (state BETWEEN 0 AND 4),
    priority      INTEGER NOT NULL,
    attempt       INTEGER NOT NULL DEFAULT 0,
    crashes       INTEGER NOT NULL DEFAULT 0,
    cached        INTEGER NOT NULL DEFAULT 0,
    change_seq    INTEGER NOT NULL,
    created_ms    INTEGER NOT NULL,
    started_ms    INTEGER NOT NULL DEFAULT 0,
    finished_ms   INTEGER NOT NULL DEFAULT 0,
    solution      INTEGER REFERENCES solution (rowid),
    case_key      BLOB    NOT NULL CHECK (length(case_key) = 32),
    subject       TEXT,
    side          TEXT,
    label         TEXT,
    measured_at   TEXT,
    case_json     TEXT    NOT NULL,
    warnings_json TEXT    NOT NULL,
    problem_json  TEXT,
    CHECK ((state = 2) = (solution IS NOT NULL)),    -- succeeded: has a result, and only then
    CHECK ((state = 3) = (problem_json IS NOT NULL)), -- failed: has a reason, and only then
    CHECK ((state >= 2) = (finished_ms > 0))
);
CREATE INDEX assessment_by_subject ON assessment (subject, seq) WHERE subject IS NOT NULL;
CREATE INDEX assessment_by_state ON assessment (state, seq);
CREATE INDEX assessment_to_do ON assessment (priority DESC, seq) WHERE state = 0;
CREATE INDEX assessment_by_end ON assessment (finished_ms) WHERE finished_ms > 0;
CREATE INDEX assessment_by_solution ON assessment (solution) WHERE solution IS NOT NULL;

CREATE TABLE idempotency (
    client      TEXT NOT NULL,
    key         TEXT NOT NULL,
    body_digest BLOB NOT NULL CHECK (length(body_digest) = 32),
    created_ms  INTEGER NOT NULL,
    assessment  INTEGER NOT NULL REFERENCES assessment (seq) ON DELETE CASCADE,
    PRIMARY KEY (client, key)
) WITHOUT ROWID;
CREATE INDEX idempotency_by_assessment ON idempotency (assessment);
CREATE INDEX idempotency_by_age ON idempotency (created_ms);

-- How many assessments are in each state, kept by the engine itself: count(*) would grow slower
-- with every finished assessment.
CREATE TABLE tally (state INTEGER PRIMARY KEY, n INTEGER NOT NULL);
INSERT INTO tally VALUES (0, 0), (1, 0), (2, 0), (3, 0), (4, 0);
CREATE TRIGGER tally_insert AFTER INSERT ON assessment BEGIN
    UPDATE tally SET n = n + 1 WHERE state = new.state;
END;
CREATE TRIGGER tally_delete AFTER DELETE ON assessment BEGIN
    UPDATE tally SET n = n - 1 WHERE state = old.state;
END;
CREATE TRIGGER tally_update AFTER UPDATE OF state ON assessment WHEN old.state <> new.state BEGIN
    UPDATE tally SET n = n - 1 WHERE state = old.state;
    UPDATE tally SET n = n + 1 WHERE state = new.state;
END;
