"""The store in a SQLite file."""

import sqlite3
from pathlib import Path
from threading import Lock

from service.settings.storage import Origin
from service.store.access.audit_verification import head_path
from service.store.audit_chain import begin_head
from service.store.integrity import Marked
from service.store.outbox import Address, no_recipients
from service.store.port import StoreError
from service.store.retention.sql import SqlRetention
from service.store.spectra_port import SpectraLimits
from service.store.sql_store import SqlStore
from service.store.sqlite.database import SqliteDatabase
from service.store.sqlite.scrubbing import Scrubber


class SqliteStore(SqlStore):
    """One database file; may be used from several threads, writes are taken one at a time.

    Parameters
    ----------
    path
        Created, with its folder, if it does not exist.
    origin
        What it is to hold; a file that holds the other is refused.
    address
        Who is to be told of events of alarms.
    spectra
        How many spectra are kept.

    Raises
    ------
    StoreError
        If the file cannot be opened, is not padwatch's, is damaged, or is newer than this program.
    """

    def __init__(
        self,
        path: Path,
        origin: Origin = Origin.LIVE,
        address: Address = no_recipients,
        spectra: SpectraLimits | None = None,
    ) -> None:
        self._path = path
        database = SqliteDatabase(path, origin)
        self._file = database
        try:
            if not database.had_trail:
                begin_head(head_path(path))
            super().__init__(database, head_path(path), address, spectra)
            self.retention = SqlRetention(self._writing, self._reader, database.give_back)
            scrubber = Scrubber(database, database.seals, database.damage)
            self.integrity = Marked(
                database.marks,
                self._writing,
                self._chain,
                database.damage,
                scrubber.check_some,
                database.file.require,
            )
        except OSError as error:
            database.close()
            raise StoreError(f"{path}: {error}") from error
        except BaseException:
            database.close()
            raise

    @property
    def _writer(self) -> sqlite3.Connection:
        """The connection that writes now; another one after an error of the disk."""
        return self._file.writer.connection

    @property
    def _lock(self) -> Lock:
        """Held while somebody writes."""
        return self._file.writer.lock
