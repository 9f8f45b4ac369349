"""Tables of roll-ups: who was gathered, under which condition, until when, and what is to redo."""

ROLLUP_TABLES = """
    CREATE TABLE rollup_cell (
        series INTEGER NOT NULL REFERENCES series (id),
        width_s INTEGER NOT NULL,
        start_ns INTEGER NOT NULL,
        slot INTEGER NOT NULL,
        operating_state INTEGER,
        n_readings INTEGER NOT NULL CHECK (n_readings > 0),
        eccentricity_low REAL,
        eccentricity_high REAL,
        oil_low_c REAL,
        oil_high_c REAL,
        PRIMARY KEY (series, width_s, start_ns, slot)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE rollup_numbers (
        series INTEGER NOT NULL REFERENCES series (id),
        width_s INTEGER NOT NULL,
        layout INTEGER NOT NULL REFERENCES layout (id),
        start_ns INTEGER NOT NULL,
        slot INTEGER NOT NULL,
        numbers BLOB NOT NULL,
        PRIMARY KEY (series, width_s, layout, start_ns, slot)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE rollup_mark (
        series INTEGER PRIMARY KEY REFERENCES series (id),
        until_ns INTEGER NOT NULL
    ) STRICT;
    CREATE TABLE rollup_redo (
        series INTEGER NOT NULL REFERENCES series (id),
        start_ns INTEGER NOT NULL,
        PRIMARY KEY (series, start_ns)
    ) STRICT, WITHOUT ROWID;
    CREATE TRIGGER rollup_of_a_late_reading AFTER INSERT ON assessment
    WHEN NEW.time_ns < (SELECT until_ns FROM rollup_mark WHERE series = NEW.series)
    BEGIN
        INSERT INTO rollup_redo
        VALUES (NEW.series, NEW.time_ns - NEW.time_ns % 3600000000000)
        ON CONFLICT DO NOTHING;
    END;
"""
"""Statements of the migration that brings them.

Whoever writes a reading into what has been gathered already marks its hour in the same transaction,
and until that is gathered anew nobody reads its roll-ups.
"""
