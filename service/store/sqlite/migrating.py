"""Migration of a SQLite file to the current schema."""

import sqlite3

from service.settings.storage import Origin
from service.store import schema
from service.store.port import StoreError

APPLICATION_IDS = {Origin.LIVE: 0x5057_4454, Origin.REPLAY: 0x5057_5250}
"""``PRAGMA application_id`` of padwatch databases by origin of the data."""

ACCESS_ID = 0x5057_4143
"""``PRAGMA application_id`` of the file of accounts, sessions and keys."""


def application_id_of(origin: Origin | None) -> int:
    """Return the ``PRAGMA application_id`` of a file; the origin is None for the access file."""
    return ACCESS_ID if origin is None else APPLICATION_IDS[origin]


def migrate(connection: sqlite3.Connection, name: str, origin: Origin | None = Origin.LIVE) -> None:
    """Migrate a database to the current schema, one transaction per migration.

    Parameters
    ----------
    origin
        Origin of the stored data; None for the access file.

    Raises
    ------
    StoreError
        If the file belongs to another program or another padwatch, or has another origin.
    """
    connection.execute("BEGIN")  # consistent values: another process may be migrating
    n_tables = int(connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0])
    version = int(connection.execute("PRAGMA user_version").fetchone()[0])
    application = int(connection.execute("PRAGMA application_id").fetchone()[0])
    connection.execute("COMMIT")
    if origin is not None:
        _require_origin(application, name, origin)
    if application not in (0, application_id_of(origin)) or (application == 0 and n_tables > 0):
        raise StoreError(f"{name} is not a padwatch database; choose another data folder")
    if version > len(schema.MIGRATIONS):
        raise StoreError(
            f"{name} has schema version {version}; this padwatch supports up to"
            f" {len(schema.MIGRATIONS)}; run the padwatch that wrote it, or restore a backup"
        )
    numbers = range(len(schema.MIGRATIONS))
    scripts = [schema.migration_of(number, is_access=origin is None) for number in numbers]
    for number in numbers[version:]:
        if scripts[number]:
            _step(connection, number, scripts[number], application_id_of(origin))
    schema.require_columns(connection.execute(schema.COLUMNS), tuple(scripts), name)


def _require_origin(application: int, name: str, origin: Origin) -> None:
    for other, application_id in APPLICATION_IDS.items():
        if other is not origin and application == application_id:
            raise StoreError(
                f"{name} holds {other} results and cannot be used for {origin} ones;"
                " choose another data folder"
            )


def _step(connection: sqlite3.Connection, number: int, script: str, application_id: int) -> None:
    """Apply one migration unless another process has applied it in the meantime."""
    try:
        connection.executescript(
            f"BEGIN IMMEDIATE; PRAGMA application_id = {application_id};"
            f"{script} PRAGMA user_version = {number + 1}; COMMIT;"
        )
    except sqlite3.Error:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        if int(connection.execute("PRAGMA user_version").fetchone()[0]) <= number:
            raise
