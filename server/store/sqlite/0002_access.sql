-- SPDX-License-Identifier: GPL-3.0-or-later
-- Who may do what, and who did what.
CREATE TABLE token (
    id         TEXT PRIMARY KEY,
    name       TEXT NOT NULL,
    digest     BLOB NOT NULL CHECK (length(digest) = 32),
    scopes     INTEGER NOT NULL,
    created_ms INTEGER NOT NULL,
    expires_ms INTEGER NOT NULL,
    revoked_ms INTEGER NOT NULL DEFAULT 0
) WITHOUT ROWID;

-- Single numbers. token_epoch moves with every change of a token; probe with every store_probe.
CREATE TABLE number (name TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
INSERT INTO number VALUES ('token_epoch', 0), ('probe', 0);
CREATE TRIGGER token_insert AFTER INSERT ON token BEGIN
    UPDATE number SET value = value + 1 WHERE name = 'token_epoch';
END;
CREATE TRIGGER token_update AFTER UPDATE ON token BEGIN
    UPDATE number SET value = value + 1 WHERE name = 'token_epoch';
END;

-- Each row's hash covers its fields and the hash before it.
CREATE TABLE audit (
    seq     INTEGER PRIMARY KEY,
    at_ms   INTEGER NOT NULL,
    who     TEXT NOT NULL,
    what    TEXT NOT NULL,
    subject TEXT NOT NULL,
    outcome TEXT NOT NULL,
    detail  TEXT NOT NULL,
    hash    BLOB NOT NULL CHECK (length(hash) = 32)
);
