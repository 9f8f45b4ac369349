"""What PostgreSQL has besides the migrations: a word on what the database is, and tuning.

A migration is appended to `service.store.schema.MIGRATIONS`, once, and reaches PostgreSQL under
the same number through :mod:`service.store.postgres.dialect`. Only one that SQLite and PostgreSQL
must be told differently has an entry in `INSTEAD` (the whole of it) or in `AFTERWARDS` (what
PostgreSQL needs besides), by the number of the schema it leads to.
"""

from collections.abc import Mapping

from service.store import schema
from service.store.postgres.statements import for_postgres

WHAT = """
    CREATE TABLE padwatch (
        is_one BOOLEAN PRIMARY KEY DEFAULT true CHECK (is_one),
        origin TEXT NOT NULL,
        schema_number INTEGER NOT NULL
    )
"""
"""Marks the database as padwatch's, and says what it holds."""

_LAYOUT_KEY = "UNIQUE (quantities, reasons)"

INSTEAD: Mapping[int, str] = {
    # lists of names are longer than a key of PostgreSQL may be
    1: schema.MIGRATIONS[0].replace(
        f"reasons TEXT NOT NULL,\n        {_LAYOUT_KEY}", "reasons TEXT NOT NULL"
    )
}

AFTERWARDS: Mapping[int, tuple[str, ...]] = {
    1: (
        "CREATE UNIQUE INDEX layout_once ON layout (md5(quantities), md5(reasons))",
        # numbers do not get smaller by compression, and each row is read whole
        "ALTER TABLE assessment SET (toast_tuple_target = 8160)",
    ),
}

HAS_TIMESCALE = "SELECT 1 FROM pg_extension WHERE extname = 'timescaledb'"
HYPERTABLE = (
    "SELECT create_hypertable('assessment', 'time_ns', chunk_time_interval => 604800000000000,"
    " create_default_indexes => false)"
)
"""A table for each week of results; of an empty table."""


def statements_to(number: int) -> list[str]:
    """What leads to a schema from the one before it."""
    migration = INSTEAD.get(number, schema.MIGRATIONS[number - 1])
    return [*for_postgres(migration), *AFTERWARDS.get(number, ())]
