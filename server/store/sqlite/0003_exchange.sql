-- SPDX-License-Identifier: GPL-3.0-or-later
-- What record systems gave, and what they are still to be told.

-- The sender's own names of an assessment; erased with it.
CREATE TABLE origin (
    assessment INTEGER PRIMARY KEY REFERENCES assessment (seq) ON DELETE CASCADE,
    reference  TEXT, -- the person as a FHIR reference, as given
    document   TEXT NOT NULL
);
CREATE INDEX origin_by_reference ON origin (reference) WHERE reference IS NOT NULL;

-- A row for each end of an assessment that a target has not been told yet. A row leaves when the
-- target has confirmed it; one that was given up stays until it is retried or the assessment goes.
CREATE TABLE outbox (
    seq        INTEGER PRIMARY KEY,
    target     TEXT    NOT NULL,
    change_seq INTEGER NOT NULL,
    id         BLOB    NOT NULL CHECK (length(id) = 16),
    kind       INTEGER NOT NULL,
    created_ms INTEGER NOT NULL,
    due_ms     INTEGER NOT NULL,
    attempts   INTEGER NOT NULL DEFAULT 0,
    given_up   INTEGER NOT NULL DEFAULT 0,
    problem    TEXT    NOT NULL DEFAULT '',
    UNIQUE (target, change_seq)
);
CREATE INDEX outbox_due ON outbox (target, due_ms) WHERE given_up = 0;
CREATE INDEX outbox_by_id ON outbox (id);

-- How far each target has read the change log.
CREATE TABLE outbox_target (target TEXT PRIMARY KEY, change_seq INTEGER NOT NULL) WITHOUT ROWID;

-- What clinicians answered to CDS cards; a card's uuid is the id of its assessment.
CREATE TABLE feedback (
    seq      INTEGER PRIMARY KEY,
    at_ms    INTEGER NOT NULL,
    service  TEXT    NOT NULL,
    card     BLOB    NOT NULL CHECK (length(card) = 16),
    document TEXT    NOT NULL
);
CREATE INDEX feedback_by_card ON feedback (card);

CREATE TRIGGER exchange_erase AFTER DELETE ON assessment BEGIN
    DELETE FROM outbox WHERE id = old.id;
    DELETE FROM feedback WHERE card = old.id;
END;
