"""The store in a PostgreSQL database."""

import time
from pathlib import Path

from service.settings.storage import Origin
from service.store.access.audit_entries import AuditAction, acting
from service.store.access.audit_verification import AuditHead, write_head
from service.store.audit_chain import newest_of
from service.store.outbox import Address, no_recipients
from service.store.port import StoreError
from service.store.postgres.address import PostgresAddress
from service.store.postgres.database import PostgresDatabase
from service.store.spectra_port import SpectraLimits
from service.store.sql_store import SqlStore

HEAD_BEGUN = "audit.head_begun"


class PostgresStore(SqlStore):
    """A store that several processes on several hosts may share.

    Parameters
    ----------
    address
        Of the database; it has to be there, and empty or padwatch's.
    head
        File on this host that names the newest entry of the audit trail that this host has seen.
    origin
        What it is to hold; one that holds the other is refused.
    to
        Who is to be told of events of alarms.
    spectra
        How many spectra are kept.

    Raises
    ------
    StoreError
        If it cannot be reached or used, is not padwatch's, or is newer than this program.
    """

    def __init__(
        self,
        address: PostgresAddress,
        head: Path,
        origin: Origin = Origin.LIVE,
        to: Address = no_recipients,
        spectra: SpectraLimits | None = None,
    ) -> None:
        database = PostgresDatabase(address, origin)
        try:
            has_begun = _begin_head(database, head)
            super().__init__(database, head, to, spectra)
            if has_begun:
                self.audit.record([_begun(head)])
        except OSError as error:
            database.close()
            raise StoreError(f"{head}: {error}") from error
        except BaseException:
            database.close()
            raise


def _begin_head(database: PostgresDatabase, head: Path) -> bool:
    """Write the head of a host that is new to a trail; whether the trail was there before it."""
    if head.exists():
        return False
    head.parent.mkdir(parents=True, exist_ok=True)
    with database.writing() as writer:
        newest = newest_of(writer)
        write_head(head, newest)
    return newest != AuditHead()


def _begun(head: Path) -> AuditAction:
    """Tell of it, so that a head that was taken away is noticed in the trail."""
    who = acting()
    return AuditAction(
        time_ns=time.time_ns(),
        actor="padwatch",
        action=HEAD_BEGUN,
        object="audit",
        reason=f"{head.absolute()} was not there",
        source=who.source,
        peer=who.peer,
    )
