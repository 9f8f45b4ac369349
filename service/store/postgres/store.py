"""Store in a PostgreSQL database."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from service.settings.storage import Origin, SpectraSettings
from service.store.access.audit_entries import AuditAction, acting
from service.store.access.audit_verification import AuditHead, write_head
from service.store.access.tables import AccessStore
from service.store.audit import AuditChain, Trail, closed_after_error, newest_of
from service.store.outbox import Address, no_recipients
from service.store.postgres.connection import PostgresAddress, PostgresConnection
from service.store.postgres.database import PostgresDatabase, Readers
from service.store.store import Store

HEAD_BEGUN = "audit.head_begun"


class PostgresStore(Store):
    """Store in a PostgreSQL database; several processes on several hosts may share it.

    Parameters
    ----------
    address
        Address of the database, which must exist and must be empty or created by padwatch.
    head
        Head file of the audit trail on this host, with the newest entry seen by this host.
    origin
        Origin of the stored data; a database with data of another origin is rejected.
    to
        Function that returns the outbox messages about an alarm event.
    spectra
        Limits of stored spectra; None for the defaults of `SpectraSettings`.

    Raises
    ------
    StoreError
        If the database cannot be reached or used, belongs to another program, or has a newer
        schema than this program.
    """

    def __init__(
        self,
        address: PostgresAddress,
        head: Path,
        origin: Origin = Origin.LIVE,
        to: Address = no_recipients,
        spectra: SpectraSettings | None = None,
    ) -> None:
        database = PostgresDatabase(address, origin)
        with closed_after_error(database, head):
            has_begun = _begin_head(database, head)
            super().__init__(database, head, to, spectra)
            if has_begun:
                self.audit.record([_begun(head)])


def open_server_access(
    address: PostgresAddress, head: Path, origin: Origin = Origin.LIVE
) -> AccessStore:
    """Open the accounts, sessions and keys in a database; `head` is the head file on this host.

    Raises
    ------
    StoreError
        If the database cannot be reached or used, or has data of another origin than `origin`.
    """
    database = PostgresDatabase(address, origin)
    with closed_after_error(database, head):
        has_begun = _begin_head(database, head)
        store = AccessStore(database, AuditChain(head, database))
        if has_begun:
            store.audit.record([_begun(head)])
        return store


def _begin_head(database: PostgresDatabase, head: Path) -> bool:
    """Write a missing head file; return True if it was missing although the trail has entries."""
    if head.exists():
        return False
    head.parent.mkdir(parents=True, exist_ok=True)
    with database.writing() as writer:
        newest = newest_of(writer)
        write_head(head, newest)
    return newest != AuditHead()


def _begun(head: Path) -> AuditAction:
    """Return the audit entry about a new head file; it reveals that a head file was removed."""
    who = acting()
    return AuditAction(
        time_ns=time.time_ns(),
        actor="padwatch",
        action=HEAD_BEGUN,
        object="audit",
        reason=f"{head.absolute()} did not exist",
        source=who.source,
        peer=who.peer,
    )


def server_trail(address: PostgresAddress, head: Path) -> Trail:
    """Return the audit trail of a database, without migration; `head` is this host's head file."""
    return Trail(partial(_opened, address), head, is_shared=True)


@contextmanager
def _opened(address: PostgresAddress) -> Iterator[PostgresConnection]:
    readers = Readers(address)
    try:
        with readers.reading() as reader:
            yield reader
    finally:
        readers.close()
