"""`OpenedFile`: notices that the database file was removed or replaced while it is open.

SQLite goes on writing to a file that has lost its name, and all of that is lost with the process.
"""

from pathlib import Path

from service.store.port import StoreError

LOGS = ("-wal", "-shm")

Identity = tuple[int, int]
"""Device and inode."""


class OpenedFile:
    """The database file as it was when it was opened.

    Parameters
    ----------
    path
        Its name.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._opened: Identity | None = None

    def remember(self) -> None:
        """Take the file that has the name now for the one that is open."""
        self._opened = _identity(self._path)

    def require(self) -> None:
        """Check that the open file still has its name; before `remember` nothing is checked.

        Raises
        ------
        StoreError
            If the file was removed, or another one has its name.
        """
        if self._opened is None:
            return
        found = _identity(self._path)
        if found is None:
            raise StoreError(
                f"{self._path}: the database file was removed while padwatch runs; put it back, or"
                " restart padwatch, which makes a new one"
            )
        if found != self._opened:
            raise StoreError(
                f"{self._path}: the database file was replaced while padwatch runs; put it back,"
                " or restart padwatch to go on with the new one"
            )

    def keep_logs_apart(self) -> None:
        """After closing: rename logs that are not of the file that has the name now.

        SQLite would take them for that file's at the next start, and damage it.
        """
        if self._opened is None or self._opened == _identity(self._path):
            return
        for suffix in LOGS:
            log = self._path.with_name(self._path.name + suffix)
            if log.exists():
                log.rename(log.with_name(f"{self._path.name}.replaced-{self._opened[1]}{suffix}"))


def _identity(path: Path) -> Identity | None:
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino
