"""PostgreSQL under the store: synchronous commits, one writer at a time, short reads."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

from service.settings.storage import Origin
from service.store.database import Connection, Unreadable
from service.store.postgres.address import PostgresAddress
from service.store.postgres.connection import PostgresConnection
from service.store.postgres.errors import renamed
from service.store.postgres.holding import PostgresHold
from service.store.postgres.migrating import migrate
from service.store.postgres.readers import Readers
from service.store.postgres.writer import Writer, writing_session


class PostgresDatabase:
    """One database of a server; may be used from several threads, and by several processes.

    Parameters
    ----------
    address
        Of the database; it has to be there, and empty or padwatch's.
    origin
        What it is to hold; one that holds the other is refused.

    Raises
    ------
    StoreError
        If it cannot be reached or used, is not padwatch's, or is newer than this program.
    """

    kind = "postgresql"

    def __init__(self, address: PostgresAddress, origin: Origin) -> None:
        self.address = address
        with renamed(address.name):
            session = writing_session(address)
            try:
                migrate(session, address.name, origin)
            except BaseException:
                session.close()
                raise
        self._writer, self._readers = Writer(address, session), Readers(address)

    def close(self) -> None:
        """End all sessions; closing twice is fine."""
        self._readers.close()
        self._writer.close()

    def writing(self) -> AbstractContextManager[PostgresConnection]:
        """Open a transaction, alone among all processes; durable when left."""
        return self._writer.writing()

    @contextmanager
    def reading(
        self,
        unreadable: Unreadable = "strict",  # noqa: ARG002
    ) -> Iterator[PostgresConnection]:
        """Open a look at one state of the database, which stores no unreadable text."""
        with self._readers.reading() as reader:
            yield reader

    def ever_had(self, connection: Connection, table: str) -> bool:  # noqa: ARG002
        """Assume so: what is beside the database was begun as it was opened."""
        return True

    def hold(self, name: str) -> PostgresHold:
        """Take a name among all processes that use this database."""
        return PostgresHold(self.address, name)
