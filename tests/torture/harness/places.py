"""Places where a store can be: one for each database, for tests that go over both."""

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import psycopg

from harness.postgres_server import PostgresServer
from service.store.access.tables import AccessStore
from service.store.postgres import PostgresStore
from service.store.postgres.connection import PostgresAddress
from service.store.postgres.store import open_server_access
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import open_access_file
from service.store.store import Store


class SqlitePlace:
    """A SQLite file, made by whoever opens a store there first; the caller closes the store."""

    kind = "sqlite"
    refusal: type[Exception] = sqlite3.IntegrityError

    def __init__(self, path: Path) -> None:
        self.path = path

    def open(self, *how: Any, **more: Any) -> Store:
        """Open a store there."""
        return SqliteStore(self.path, *how, **more)

    def open_access(self) -> AccessStore:
        """Open accounts there, in place of a store."""
        self.path = self.path.with_name("access.sqlite3")
        return open_access_file(self.path)

    def execute(self, statement: str, parameters: tuple[Any, ...] = ()) -> list[Any]:
        """Do something to the database from outside, for good."""
        with closing(sqlite3.connect(self.path, isolation_level=None)) as connection:
            return connection.execute(statement, parameters).fetchall()

    def unguard(self, trigger: str, table: str) -> None:  # noqa: ARG002
        """Take a trigger away."""
        self.execute(f"DROP TRIGGER {trigger}")


class PostgresPlace:
    """A database of a server, and a folder on this host; the caller closes the store."""

    kind = "postgresql"
    refusal: type[Exception] = psycopg.errors.RestrictViolation

    def __init__(self, server: PostgresServer, database: str, folder: Path) -> None:
        self.server, self.database = server, database
        self.head = folder / "postgresql.audit-head.json"
        self.address = PostgresAddress(server.conninfo(database))

    def open(self, *how: Any, **more: Any) -> Store:
        """Open a store there."""
        return PostgresStore(self.address, self.head, *how, **more)

    def open_access(self) -> AccessStore:
        """Open the accounts there."""
        return open_server_access(self.address, self.head)

    def execute(self, statement: str, parameters: tuple[Any, ...] = ()) -> list[Any]:
        """Do something to the database from outside, for good; ``?`` as in SQLite."""
        with psycopg.connect(self.address.conninfo, autocommit=True) as connection:
            found = connection.execute(statement.replace("?", "%s").encode(), parameters or None)
            return found.fetchall() if found.description else []

    def unguard(self, trigger: str, table: str) -> None:
        """Take a trigger away."""
        self.execute(f"DROP TRIGGER {trigger} ON {table}")


Place = SqlitePlace | PostgresPlace
