-- SPDX-License-Identifier: GPL-3.0-or-later
-- Who may do what, and who did what.
CREATE TABLE token (
    id         text   PRIMARY KEY,
    name       text   NOT NULL,
    digest     bytea  NOT NULL CHECK (length(digest) = 32),
    scopes     bigint NOT NULL,
    created_ms bigint NOT NULL,
    expires_ms bigint NOT NULL,
    revoked_ms bigint NOT NULL DEFAULT 0
);

-- Single numbers. token_epoch moves with every change of a token; probe with every store_probe.
CREATE TABLE number (name text PRIMARY KEY, value bigint NOT NULL);
INSERT INTO number VALUES ('token_epoch', 0), ('probe', 0);
CREATE FUNCTION count_tokens() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    UPDATE number SET value = value + 1 WHERE name = 'token_epoch';
    RETURN NULL;
END $$;
CREATE TRIGGER token_changed AFTER INSERT OR UPDATE ON token
    FOR EACH ROW EXECUTE FUNCTION count_tokens();

-- Each row's hash covers its fields and the hash before it.
CREATE TABLE audit (
    seq     bigint PRIMARY KEY,
    at_ms   bigint NOT NULL,
    who     text   NOT NULL,
    what    text   NOT NULL,
    subject text   NOT NULL,
    outcome text   NOT NULL,
    detail  text   NOT NULL,
    hash    bytea  NOT NULL CHECK (length(hash) = 32)
);
