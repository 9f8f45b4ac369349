"""Connections to PostgreSQL, and how a statement is cancelled."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

import psycopg
from psycopg.abc import Buffer
from psycopg.adapt import AdaptersMap, Dumper

from service.runtime.asker import ASKER, Asker
from service.store.database import Parameters
from service.store.port import StoreError
from service.store.postgres.address import PostgresAddress
from service.store.postgres.statements import translated

BIGINT_OID = 20
DOUBLE_OID = 701
OLDEST_VERSION = 140_000

SESSION = """
    SET jit = off; SET timezone = 'UTC'; SET standard_conforming_strings = on;
    SET tcp_keepalives_idle = 10; SET tcp_keepalives_interval = 5; SET tcp_keepalives_count = 3;
    SET idle_in_transaction_session_timeout = '30s';
"""
"""Of every session; a client that has gone without a word keeps no lock for long."""

SETTINGS = """
    SELECT current_setting('fsync'), current_setting('full_page_writes'),
    current_setting('server_encoding'), pg_is_in_recovery(), current_schema() IS NOT NULL
"""


class _TruthDumper(Dumper):
    """Truths as 0 and 1, as they are stored."""

    oid = BIGINT_OID

    def dump(self, obj: bool) -> Buffer:
        return b"1" if obj else b"0"


class _NumberDumper(Dumper):
    """Numbers; what is none is NULL, as SQLite has it."""

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
    """A session within a transaction, for statements that are written once for both databases."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def execute(
        self, statement: str, parameters: Parameters = (), /
    ) -> psycopg.Cursor[tuple[Any, ...]]:
        """Run a statement; all that it found is in memory then."""
        return self._session.execute(translated(statement), parameters or None, binary=True)

    def executemany(
        self, statement: str, parameters: Iterable[Parameters], /
    ) -> psycopg.Cursor[tuple[Any, ...]]:
        """Run a statement once for each set of parameters, without waiting between them."""
        cursor = self._session.cursor()
        cursor.executemany(translated(statement), parameters)
        return cursor


def connected(address: PostgresAddress, purpose: str, settings: str) -> Session:
    """Open a session with some settings of its own."""
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
    """Refuse a server that cannot keep what padwatch writes.

    Raises
    ------
    StoreError
        If it is too old, loses data at a power cut, is a standby or has no place for tables.
    """
    if session.info.server_version < OLDEST_VERSION:
        version = session.info.parameter_status("server_version")
        raise StoreError(
            f"{where} is of PostgreSQL {version}, which is too old: padwatch needs"
            f" {OLDEST_VERSION // 10_000} or newer"
        )
    row = session.execute(SETTINGS.encode()).fetchone()
    why = None if row is None else _unfit(*row)
    if why is not None:
        raise StoreError(f"{where} {why}")


def _unfit(
    fsync: str, full_page_writes: str, encoding: str, is_standby: bool, has_schema: bool
) -> str | None:
    if is_standby:
        return "is a standby, which only reads: name the primary in [store] postgresql"
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


LOOK_EVERY_S = 0.1
CANCEL_WITHIN_S = 2.0


@contextmanager
def cancelled_when_gone(session: Session) -> Iterator[None]:
    """Cancel what a session does as soon as its asker has gone; nothing where nobody asks.

    Raises
    ------
    StoreError
        If the asker has gone.
    """
    asker = ASKER.get()
    if asker is None:
        yield
        return
    is_done = Event()
    watcher = Thread(target=_watch, args=(session, asker, is_done), name="padwatch-asker")
    watcher.start()
    try:
        yield
    finally:
        is_done.set()
        watcher.join()
        if asker.has_gone:
            raise StoreError("interrupted: nobody waits for the answer")


def _watch(session: Session, asker: Asker, is_done: Event) -> None:
    while not asker.has_gone:
        if is_done.wait(LOOK_EVERY_S):
            return
    try:
        session.cancel_safe(timeout=CANCEL_WITHIN_S)
    except psycopg.Error:
        return  # the server is gone, and what it did with it
