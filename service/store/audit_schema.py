"""Table of the audit trail; its rows are added in order and never changed."""

AUDIT_TABLES = """
    CREATE TABLE audit (
        number INTEGER PRIMARY KEY AUTOINCREMENT,
        time_ns INTEGER NOT NULL,
        actor TEXT NOT NULL,
        source TEXT NOT NULL CHECK (source IN ('api', 'command_line', 'padwatch')),
        peer TEXT,
        action TEXT NOT NULL,
        object TEXT NOT NULL,
        before TEXT,
        after TEXT,
        reason TEXT NOT NULL,
        previous_hash TEXT NOT NULL,
        hash TEXT NOT NULL
    ) STRICT;
    CREATE INDEX audit_of_actor ON audit (actor, number);
    CREATE INDEX audit_of_action ON audit (action, number);
    CREATE INDEX audit_of_object ON audit (object, number);
    CREATE TRIGGER audit_follows BEFORE INSERT ON audit
    WHEN NEW.number IS NOT (SELECT coalesce(max(number), 0) + 1 FROM audit)
    BEGIN SELECT RAISE(ABORT, 'entries of the audit trail follow one another'); END;
    CREATE TRIGGER audit_kept_as_told BEFORE UPDATE ON audit
    BEGIN SELECT RAISE(ABORT, 'entries of the audit trail are kept as they were told'); END;
    CREATE TRIGGER audit_kept BEFORE DELETE ON audit
    BEGIN SELECT RAISE(ABORT, 'entries of the audit trail are kept'); END;
"""
"""Statements of the migration that brings it."""
