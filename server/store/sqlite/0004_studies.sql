-- SPDX-License-Identifier: GPL-3.0-or-later
-- Studies: many cases asked for at once, apart from assessments so that a list of those, the change
-- log and the outbox stay what they are. No field of displacements is kept for a point.

CREATE TABLE study (
    seq             INTEGER PRIMARY KEY,
    id              BLOB    NOT NULL UNIQUE CHECK (length(id) = 16),
    name            TEXT    NOT NULL,
    columns_json    TEXT    NOT NULL, -- the input's columns: an array of names
    responses_json  TEXT,             -- the results to show: an array of names; NULL: a cohort's
    cancelled       INTEGER NOT NULL DEFAULT 0,
    created_ms      INTEGER NOT NULL,
    started_ms      INTEGER NOT NULL DEFAULT 0,
    finished_ms     INTEGER NOT NULL DEFAULT 0,
    client          TEXT    NOT NULL,
    idempotency_key TEXT,
    body_digest     BLOB    NOT NULL CHECK (length(body_digest) = 32),
    UNIQUE (client, idempotency_key)
);
CREATE INDEX study_by_end ON study (finished_ms) WHERE finished_ms > 0;

CREATE TABLE study_point (
    study        INTEGER NOT NULL REFERENCES study (seq) ON DELETE CASCADE,
    line         INTEGER NOT NULL, -- 1 ... in the order of the input
    state        INTEGER NOT NULL CHECK (state BETWEEN 0 AND 4),
    refused      INTEGER NOT NULL, -- never a case: its outcome says why
    attempt      INTEGER NOT NULL DEFAULT 0,
    crashes      INTEGER NOT NULL DEFAULT 0,
    case_key     BLOB    CHECK (length(case_key) = 32),
    case_json    TEXT,
    cells_json   TEXT    NOT NULL, -- the input's row: an array of texts
    outcome_json TEXT,             -- the result, or the problem
    PRIMARY KEY (study, line),
    CHECK ((state IN (2, 3)) = (outcome_json IS NOT NULL)),
    CHECK ((refused = 0) = (case_json IS NOT NULL)),
    CHECK ((refused = 0) = (case_key IS NOT NULL))
);
CREATE INDEX study_point_to_do ON study_point (study, line) WHERE state = 0;
CREATE INDEX study_point_running ON study_point (study) WHERE state = 1;
CREATE INDEX study_point_by_state ON study_point (study, state, refused);
CREATE INDEX study_point_solved ON study_point (case_key) WHERE state = 2;
