"""The table of what is gone."""

RETENTION_TABLES = """
    CREATE TABLE retention_mark (
        series INTEGER NOT NULL REFERENCES series (id),
        width_s INTEGER NOT NULL,
        until_ns INTEGER NOT NULL,
        PRIMARY KEY (series, width_s)
    ) STRICT, WITHOUT ROWID;
    DROP TRIGGER outbox_kept;
    CREATE TRIGGER outbox_kept BEFORE DELETE ON outbox WHEN OLD.state = 'waiting'
    BEGIN SELECT RAISE(ABORT, 'what is to be told is kept'); END;
"""
"""Statements of the migration that brings it.

Up to when single readings (width 0) and narrow roll-ups of a bearing are deleted: a whole hour.
"""
