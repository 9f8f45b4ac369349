"""Migrations of the database schema: numbered, atomic, never edited once released.

Migrations are written for SQLite. For PostgreSQL `service.store.postgres.schema` translates column
types, ``STRICT``, ``WITHOUT ROWID`` and triggers, and replaces migrations that it cannot translate.
A new migration is appended to `MIGRATIONS`; the tests of the store run it on both databases.

A PostgreSQL database has all tables. SQLite has two files with a common schema number: the access
file has the tables of accounts, sessions and keys, the other file has the tables of results. Each
file has its own audit trail.
"""

import sqlite3
from collections.abc import Iterable
from contextlib import closing
from functools import cache

from service.store.access.schema import ACCESS_TABLES
from service.store.audit import AUDIT_TABLES
from service.store.films import FILM_TABLES
from service.store.outbox import OUTBOX_TABLES
from service.store.port import StoreError
from service.store.references import VECTOR_REFERENCE_TABLES
from service.store.retention import RETENTION_TABLES
from service.store.rollups.rows import ROLLUP_TABLES
from service.store.sharing import COMMAND_TABLES, POSITION_TABLES, UNIT_STATUS_TABLES
from service.store.spectra import SPECTRA_TABLES
from service.store.waveforms import WAVEFORM_TABLES

MIGRATIONS = (
    """
    CREATE TABLE layout (
        id INTEGER PRIMARY KEY,
        quantities TEXT NOT NULL,
        reasons TEXT NOT NULL,
        UNIQUE (quantities, reasons)
    ) STRICT;
    CREATE TABLE series (
        id INTEGER PRIMARY KEY,
        unit TEXT NOT NULL,
        bearing TEXT NOT NULL,
        UNIQUE (unit, bearing)
    ) STRICT;
    CREATE TABLE assessment (
        series INTEGER NOT NULL REFERENCES series (id),
        time_ns INTEGER NOT NULL,
        epoch INTEGER NOT NULL,
        first_index INTEGER NOT NULL,
        stop_index INTEGER NOT NULL,
        n_segments INTEGER NOT NULL,
        coverage REAL NOT NULL,
        speed_source TEXT NOT NULL,
        eccentricity_ratio REAL,
        oil_temperature_c REAL,
        layout INTEGER NOT NULL REFERENCES layout (id),
        reading_values BLOB NOT NULL,
        reading_qualities BLOB NOT NULL,
        estimator_xx TEXT,
        estimator_yy TEXT,
        operating_state INTEGER,
        is_settled INTEGER,
        PRIMARY KEY (series, time_ns)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE gap (
        unit TEXT NOT NULL,
        epoch INTEGER NOT NULL,
        first_index INTEGER NOT NULL,
        n_samples INTEGER NOT NULL,
        stop_ns INTEGER NOT NULL,
        start_ns INTEGER,
        is_estimated INTEGER NOT NULL DEFAULT 0 CHECK (is_estimated IN (0, 1)),
        PRIMARY KEY (unit, epoch, first_index, stop_ns)
    ) STRICT, WITHOUT ROWID;
    """,
    """
    CREATE TABLE gap_reference (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        unit TEXT NOT NULL,
        bearing TEXT NOT NULL,
        set_ns INTEGER NOT NULL,
        author TEXT NOT NULL,
        x_um REAL NOT NULL CHECK (x_um > 0 AND x_um <= 10000),
        y_um REAL NOT NULL CHECK (y_um > 0 AND y_um <= 10000),
        opposite_x_um REAL CHECK (opposite_x_um > 0 AND opposite_x_um <= 10000),
        opposite_y_um REAL CHECK (opposite_y_um > 0 AND opposite_y_um <= 10000),
        source TEXT NOT NULL CHECK (source IN ('given', 'measured')),
        note TEXT NOT NULL,
        CHECK ((opposite_x_um IS NULL) = (opposite_y_um IS NULL))
    ) STRICT;
    CREATE INDEX gap_reference_of ON gap_reference (unit, bearing, id);
    CREATE TRIGGER gap_reference_kept_as_set BEFORE UPDATE ON gap_reference
    BEGIN SELECT RAISE(ABORT, 'references are kept as they were set'); END;
    CREATE TRIGGER gap_reference_kept BEFORE DELETE ON gap_reference
    BEGIN SELECT RAISE(ABORT, 'references are kept'); END;
    """,
    """
    CREATE TABLE alarm (
        id TEXT PRIMARY KEY,
        unit TEXT NOT NULL,
        subject TEXT NOT NULL,
        kind TEXT NOT NULL,
        level INTEGER CHECK (level IN (1, 2)),
        occurrence INTEGER NOT NULL CHECK (occurrence >= 0),
        is_acknowledged INTEGER NOT NULL CHECK (is_acknowledged IN (0, 1)),
        raised_ns INTEGER,
        n_events INTEGER NOT NULL CHECK (n_events > 0),
        is_known INTEGER NOT NULL CHECK (is_known IN (0, 1)),
        condition_level INTEGER CHECK (condition_level IN (1, 2)),
        value REAL,
        limit_value REAL,
        reason TEXT NOT NULL,
        suppressed_by TEXT,
        is_latched INTEGER NOT NULL CHECK (is_latched IN (0, 1)),
        shelf_actor TEXT,
        shelf_reason TEXT,
        shelf_since_ns INTEGER,
        shelf_until_ns INTEGER,
        outage_actor TEXT,
        outage_reason TEXT,
        outage_since_ns INTEGER,
        operating_state INTEGER,
        eccentricity_ratio REAL,
        attitude_deg REAL,
        oil_temperature_c REAL,
        directions TEXT NOT NULL DEFAULT ''
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE alarm_event (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        alarm TEXT NOT NULL,
        number INTEGER NOT NULL CHECK (number > 0),
        unit TEXT NOT NULL,
        subject TEXT NOT NULL,
        kind TEXT NOT NULL,
        change TEXT NOT NULL,
        level INTEGER CHECK (level IN (1, 2)),
        state_before TEXT NOT NULL,
        state_after TEXT NOT NULL,
        time_ns INTEGER NOT NULL,
        occurrence INTEGER NOT NULL,
        value REAL,
        limit_value REAL,
        actor TEXT NOT NULL,
        reason TEXT NOT NULL,
        operating_state INTEGER,
        eccentricity_ratio REAL,
        attitude_deg REAL,
        oil_temperature_c REAL,
        directions TEXT NOT NULL DEFAULT '',
        UNIQUE (alarm, number)
    ) STRICT;
    CREATE INDEX alarm_event_of_unit ON alarm_event (unit, id);
    CREATE TRIGGER alarm_event_kept_as_told BEFORE UPDATE ON alarm_event
    BEGIN SELECT RAISE(ABORT, 'events of alarms are kept as they were written'); END;
    CREATE TRIGGER alarm_event_kept BEFORE DELETE ON alarm_event
    BEGIN SELECT RAISE(ABORT, 'events of alarms are kept'); END;
    """,
    OUTBOX_TABLES,
    FILM_TABLES,
    VECTOR_REFERENCE_TABLES,
    AUDIT_TABLES,
    ACCESS_TABLES,
    SPECTRA_TABLES,
    ROLLUP_TABLES,
    UNIT_STATUS_TABLES + COMMAND_TABLES,
    WAVEFORM_TABLES,
    RETENTION_TABLES,
    POSITION_TABLES,
)
"""SQL script of each migration; item n migrates a database from schema n to schema n + 1."""


def migration_of(number: int, *, is_access: bool) -> str:
    """Return the SQL script of a migration for the access file or the results file.

    The script is empty if the migration does not change the tables of the file.
    """
    script = MIGRATIONS[number]
    return script if script == AUDIT_TABLES or (script == ACCESS_TABLES) == is_access else ""


COLUMNS = (
    "SELECT tables.name, columns.name"
    " FROM sqlite_master AS tables, pragma_table_info(tables.name) AS columns"
    " WHERE tables.type = 'table' AND tables.name NOT LIKE 'sqlite_%'"
)
"""Query for the table and the name of each column of a SQLite file."""


def require_columns(found: Iterable[tuple[str, str]], scripts: tuple[str, ...], name: str) -> None:
    """Check that a migrated database has all columns: a developer may have edited a migration.

    Parameters
    ----------
    found
        Table and name of each column of the database.
    scripts
        All migrations of the database.
    name
        Name of the database in the message.

    Raises
    ------
    StoreError
        If a column is missing.
    """
    for table, column in sorted(_columns_after(scripts).difference(found)):
        raise StoreError(
            f"{name} was written by another version of padwatch (its table {table} has no column"
            f" {column}); run that version, or choose an empty data folder or database"
        )


@cache
def _columns_after(scripts: tuple[str, ...]) -> frozenset[tuple[str, str]]:
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.executescript("".join(scripts))
        return frozenset(connection.execute(COLUMNS))
