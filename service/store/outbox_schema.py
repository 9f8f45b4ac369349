"""Tables of the outbox."""

OUTBOX_TABLES = """
    CREATE TABLE outbox (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        receiver TEXT NOT NULL,
        event_id TEXT NOT NULL,
        alarm TEXT NOT NULL,
        number INTEGER NOT NULL,
        body TEXT NOT NULL,
        queued_ns INTEGER NOT NULL,
        is_urgent INTEGER NOT NULL CHECK (is_urgent IN (0, 1)),
        is_active INTEGER NOT NULL CHECK (is_active IN (0, 1)),
        state TEXT NOT NULL DEFAULT 'waiting'
            CHECK (state IN ('waiting', 'delivered', 'refused', 'expired')),
        n_attempts INTEGER NOT NULL DEFAULT 0,
        answer TEXT NOT NULL DEFAULT '',
        done_ns INTEGER,
        UNIQUE (receiver, alarm, number),
        FOREIGN KEY (alarm, number) REFERENCES alarm_event (alarm, number)
    ) STRICT;
    CREATE INDEX outbox_of_receiver ON outbox (receiver, state, id);
    CREATE TRIGGER outbox_kept BEFORE DELETE ON outbox
    BEGIN SELECT RAISE(ABORT, 'what was told is kept'); END;
    CREATE TRIGGER outbox_kept_as_queued
    BEFORE UPDATE OF receiver, event_id, alarm, number, body ON outbox
    BEGIN SELECT RAISE(ABORT, 'what is told is kept as it was queued'); END;
    """
"""A letter for each event and receiver; nothing of it is changed but what has come of it."""
