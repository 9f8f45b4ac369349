"""Schema of the tables of accounts, sessions, API keys and the set-up token."""

ACCESS_TABLES = """
    CREATE TABLE account (
        name TEXT PRIMARY KEY,
        role TEXT NOT NULL CHECK (role IN ('viewer', 'operator', 'engineer', 'admin')),
        password_hash TEXT NOT NULL,
        password_number INTEGER NOT NULL CHECK (password_number > 0),
        created_ns INTEGER NOT NULL,
        password_ns INTEGER NOT NULL,
        must_change INTEGER NOT NULL DEFAULT 0 CHECK (must_change IN (0, 1))
    ) STRICT;
    CREATE TABLE session (
        digest BLOB PRIMARY KEY CHECK (length(digest) = 32),
        account TEXT NOT NULL REFERENCES account (name) ON DELETE CASCADE,
        created_ns INTEGER NOT NULL,
        seen_ns INTEGER NOT NULL
    ) STRICT, WITHOUT ROWID;
    CREATE INDEX session_of_account ON session (account, created_ns);
    CREATE TABLE api_key (
        id TEXT PRIMARY KEY,
        name TEXT NOT NULL,
        digest BLOB NOT NULL CHECK (length(digest) = 32),
        role TEXT NOT NULL CHECK (role IN ('viewer', 'operator', 'engineer', 'admin')),
        units TEXT NOT NULL,
        created_ns INTEGER NOT NULL,
        expires_ns INTEGER NOT NULL,
        used_ns INTEGER,
        revoked_ns INTEGER
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE set_up_token (
        id INTEGER PRIMARY KEY CHECK (id = 1),
        digest BLOB NOT NULL CHECK (length(digest) = 32),
        expires_ns INTEGER NOT NULL
    ) STRICT;
    CREATE TRIGGER api_key_kept BEFORE DELETE ON api_key
    BEGIN SELECT RAISE(ABORT, 'keys are revoked, not forgotten'); END;
    CREATE TRIGGER api_key_kept_revoked BEFORE UPDATE OF revoked_ns ON api_key
    WHEN OLD.revoked_ns IS NOT NULL
    BEGIN SELECT RAISE(ABORT, 'a revoked key stays revoked'); END;
    CREATE TRIGGER api_key_kept_as_made
    BEFORE UPDATE OF id, name, digest, role, units, created_ns, expires_ns ON api_key
    BEGIN SELECT RAISE(ABORT, 'keys are kept as they were made'); END;
    """
"""Migration that creates the access tables, which store only hashes and digests of secrets."""
