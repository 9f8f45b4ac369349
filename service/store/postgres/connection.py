"""Connections to PostgreSQL: address, errors, advisory locks, and cancellation of statements."""

import hashlib
import os
import re
import socket
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import psycopg
from psycopg.abc import Buffer
from psycopg.adapt import AdaptersMap, Dumper
from psycopg.conninfo import conninfo_to_dict, make_conninfo

from service.runtime.asker import ASKER
from service.store.database import Parameters
from service.store.port import RefusedRowError, StoreError

MAX_PASSWORD_BYTES = 4096
DEFAULTS = {
    "connect_timeout": "5",
    "keepalives_idle": "10",
    "keepalives_interval": "5",
    "keepalives_count": "3",
    "tcp_user_timeout": "25000",
}
"""Connection timeouts, with which an unreachable server is detected within half a minute."""


@dataclass(frozen=True)
class PostgresAddress:
    """Address of a PostgreSQL database.

    Parameters
    ----------
    conninfo
        Connection string of libpq, without a password.
    password_file
        File that contains only the password and is readable by its owner only; if None, libpq
        reads ``~/.pgpass``.
    """

    conninfo: str
    password_file: Path | None = None

    @property
    def name(self) -> str:
        """Name of the database and its host, for messages."""
        parts = conninfo_to_dict(self.conninfo)
        database = parts.get("dbname") or parts.get("user") or "named like the user"
        host = parts.get("host") or parts.get("service") or "this computer"
        return f"PostgreSQL database {database} at {host}"

    def full(self, purpose: str) -> str:
        """Return the connection string with the password, and the `purpose` in application_name.

        The string must never be displayed or logged. Raises `StoreError` if the password file
        cannot be read or is readable by others.
        """
        given = conninfo_to_dict(self.conninfo)
        name = f"padwatch {purpose} {os.getpid()}@{socket.gethostname()}"[:63]
        settings = {**DEFAULTS, "application_name": name, **given, "client_encoding": "UTF8"}
        if self.password_file is not None:
            settings["password"] = self._password(self.password_file)
        return make_conninfo(**settings)  # type: ignore[arg-type]

    def _password(self, path: Path) -> str:
        try:
            with path.open("rb") as file:
                mode = os.fstat(file.fileno()).st_mode
                found = file.read(MAX_PASSWORD_BYTES)
        except OSError as error:
            raise StoreError(
                f"[store] password_file {path} cannot be read: {error.strerror}"
            ) from error
        if mode & 0o077:
            raise StoreError(
                f"[store] password_file {path} is readable by others; run chmod 600 on it"
            )
        return found.decode("utf-8", "surrogateescape").rstrip("\r\n")


BIGINT_OID = 20
DOUBLE_OID = 701
OLDEST_VERSION = 140_000

SESSION = """
    SET jit = off; SET timezone = 'UTC'; SET standard_conforming_strings = on;
    SET tcp_keepalives_idle = 10; SET tcp_keepalives_interval = 5; SET tcp_keepalives_count = 3;
    SET idle_in_transaction_session_timeout = '30s';
"""
"""Settings of every session; timeouts release the locks of a session whose client is gone."""

SERVER_SETTINGS = """
    SELECT current_setting('fsync'), current_setting('full_page_writes'),
    current_setting('server_encoding'), pg_is_in_recovery(), current_schema() IS NOT NULL
"""


class _TruthDumper(Dumper):
    """Encoder of boolean parameters as 0 and 1, as booleans are stored."""

    oid = BIGINT_OID

    def dump(self, obj: bool) -> Buffer:
        return b"1" if obj else b"0"


class _NumberDumper(Dumper):
    """Encoder of float parameters, which writes NaN as NULL, as SQLite does."""

    oid = DOUBLE_OID

    def dump(self, obj: float) -> Buffer | None:
        return None if obj != obj else float.__repr__(obj).encode()


def _adapters() -> AdaptersMap:
    adapters = AdaptersMap(psycopg.adapters)
    adapters.register_dumper(bool, _TruthDumper)
    adapters.register_dumper(float, _NumberDumper)
    return adapters


ADAPTERS = _adapters()

Session = psycopg.Connection[tuple[Any, ...]]


class PostgresConnection:
    """Connection within a transaction; translates SQL statements that are written for SQLite."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def execute(
        self, statement: str, parameters: Parameters = (), /
    ) -> psycopg.Cursor[tuple[Any, ...]]:
        """Run a statement and return a cursor with all rows."""
        return self._session.execute(translated(statement), parameters or None, binary=True)

    def executemany(
        self, statement: str, parameters: Iterable[Parameters], /
    ) -> psycopg.Cursor[tuple[Any, ...]]:
        """Run a statement once for each set of parameters, in few network round trips."""
        cursor = self._session.cursor()
        cursor.executemany(translated(statement), parameters)
        return cursor


def connected(address: PostgresAddress, purpose: str, settings: str) -> Session:
    """Return a new session; `settings` are SET statements in addition to `SESSION`.

    `purpose` is shown in the application_name of the session.

    Raises
    ------
    StoreError
        If the password file is unusable.
    psycopg.Error
        If the server cannot be reached or rejects the connection.
    """
    session = psycopg.connect(address.full(purpose), autocommit=True, context=_Context)
    try:
        session.execute((SESSION + settings).encode())
    except BaseException:
        session.close()
        raise
    return session


class _Context:
    adapters = ADAPTERS
    connection = None


def require_fit(session: Session, where: str) -> None:
    """Check that a server is suitable; `where` names the database in the message.

    Raises
    ------
    StoreError
        If the server is too old, may lose data at a power cut, is a standby, does not use UTF-8,
        or has no schema for tables.
    """
    if session.info.server_version < OLDEST_VERSION:
        version = session.info.parameter_status("server_version")
        raise StoreError(
            f"{where} runs on PostgreSQL {version}, which is too old: padwatch needs"
            f" {OLDEST_VERSION // 10_000} or newer"
        )
    row = session.execute(SERVER_SETTINGS.encode()).fetchone()
    why = None if row is None else _unfit(*row)
    if why is not None:
        raise StoreError(f"{where} {why}")


def _unfit(
    fsync: str, full_page_writes: str, encoding: str, is_standby: bool, has_schema: bool
) -> str | None:
    if is_standby:
        return "is a read-only standby: name the primary in [store] postgresql"
    if fsync != "on" or full_page_writes != "on":
        return (
            "would lose results at a power cut: set fsync = on and full_page_writes = on"
            " in its postgresql.conf"
        )
    if encoding != "UTF8":
        return f"has the encoding {encoding}: create it with ENCODING 'UTF8'"
    if not has_schema:
        return "has no schema for padwatch's tables: correct search_path or the role's rights"
    return None


CANCEL_WITHIN_S = 2.0


@contextmanager
def cancelled_when_gone(session: Session) -> Iterator[None]:
    """Return a context manager that cancels statements when the HTTP client disconnects.

    Raises
    ------
    StoreError
        If the client has disconnected; the session may still be cancelled and is to be closed.
    """
    asker = ASKER.get()
    if asker is None:
        yield
        return

    def cancel() -> None:
        with suppress(psycopg.Error):  # without a connection the statement fails by itself
            session.cancel_safe(timeout=CANCEL_WITHIN_S)

    try:
        with asker.cancelling(cancel):
            yield
    finally:
        if asker.has_gone:
            raise StoreError("the query was interrupted: the client has disconnected")


BY_STATE = {
    "53100": "the disk of the database is full: free space there",
    "53200": "the database server is out of memory: give it more memory",
    "53300": "too many connections are open: raise max_connections",
    "57014": "the query timed out: the database is too slow, or overloaded",
    "55P03": "another padwatch has been writing for too long: check what it waits for",
    "25P03": "a transaction was left open for too long",
    "25006": "the database is read-only: name the primary in [store] postgresql, not a standby",
    "42501": "the role lacks permission: grant the rights listed in the how-to for PostgreSQL",
    "57P01": "the database server is shutting down; padwatch retries",
    "57P02": "the database server has crashed and is recovering; padwatch retries",
    "57P03": "the database server is starting or stopping; padwatch retries",
    "XX001": "the database is damaged: restore a backup",
    "XX002": "an index is damaged: run reindexdb",
}
"""Advice for error messages by SQLSTATE."""

BY_WORDS = {
    "password authentication failed": "correct [store] password_file, or the role's password",
    "no password supplied": "name a [store] password_file",
    "no pg_hba.conf entry": "permit this host and role in pg_hba.conf of the server",
    "does not exist": "create it (see the how-to for PostgreSQL), or correct [store] postgresql",
    "too many clients": BY_STATE["53300"],
    "remaining connection slots": BY_STATE["53300"],
    "the database system is": BY_STATE["57P03"],
    "could not translate host name": "correct the host in [store] postgresql",
    "session is read-only": BY_STATE["25006"],
    "certificate": "correct sslmode, sslrootcert or sslcert in [store] postgresql",
}
"""Advice for connection errors without an SQLSTATE, by a part of the error text."""

OF_THE_ROW = (
    psycopg.IntegrityError,
    psycopg.DataError,
    psycopg.errors.DataCorrupted,
    psycopg.errors.IndexCorrupted,
)
"""Errors caused by one row or its database page; other rows can still be written."""

UNREACHABLE = "check that PostgreSQL runs and can be reached; padwatch retries"


def sentence(where: str, error: psycopg.Error) -> str:
    """Return a one-line message about an error of the database `where`, with advice if known."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    said = (error.diag.message_primary or (lines[0] if lines else type(error).__name__)).rstrip(".")
    advice = _advice(error)
    return f"{where}: {said}" + (f"; {advice}" if advice else "")


def _advice(error: psycopg.Error) -> str | None:
    if error.sqlstate in BY_STATE:
        return BY_STATE[error.sqlstate]
    if error.sqlstate is None and isinstance(error, psycopg.OperationalError):
        said = str(error)
        return next((advice for words, advice in BY_WORDS.items() if words in said), UNREACHABLE)
    return None


@contextmanager
def renamed(where: str) -> Iterator[None]:
    """Return a context manager that converts errors of the database `where` to `StoreError`.

    The error is a `RefusedRowError` if one row or its database page caused it.
    """
    try:
        yield
    except psycopg.Error as error:
        kind = RefusedRowError if isinstance(error, OF_THE_ROW) else StoreError
        raise kind(sentence(where, error)) from error
    except UnicodeEncodeError as error:
        text = f"the text {error.object[:60]!a} has characters that UTF-8 cannot store"
        raise RefusedRowError(f"{where}: {text}") from error
    except OSError as error:
        raise StoreError(f"{where}: {error}") from error


def lock_number(name: str) -> int:
    """Return the number of the advisory lock for a name; it is the same in every process."""
    digest = hashlib.sha256(b"padwatch " + name.encode("utf-8", "surrogateescape")).digest()
    return int.from_bytes(digest[:8], "big", signed=True)


MIGRATING = lock_number("/migrating")
WRITING = lock_number("/writing")
"""Advisory lock of write transactions; it permits one writer at a time, as in SQLite."""


_PIECE = re.compile(r"('(?:[^']|'')*')|\?|(?<!:):([A-Za-z_][A-Za-z_0-9]*)|%|\bwhole_(?=[a-z])")


@lru_cache(maxsize=1024)
def translated(statement: str) -> bytes:
    """Return a statement in psycopg's syntax: ``%s`` for ``?``, ``%(name)s`` for ``:name``.

    String literals stay unchanged. The prefix ``whole_`` of table names is removed, since the
    server checks its data itself.
    """
    return _PIECE.sub(_piece, statement).encode()


def _piece(found: re.Match[str]) -> str:
    quoted, name = found[1], found[2]
    if quoted is not None:
        return quoted.replace("%", "%%")
    if name is not None:
        return f"%({name})s"
    return {"?": "%s", "%": "%%"}.get(found[0], "")
