"""The file of a SQLite database."""

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


_MAGIC = b"SQLite format 3\0"
_HEADER_BYTES = 100
_PAGE_BYTES_AT = slice(16, 18)
_LARGEST_PAGE = 65_536
"""Written as 1."""


def why_cut(path: Path) -> str | None:
    """Why a database file cannot be whole; None if its length says nothing against it.

    With a log beside it the file may end anywhere: the log holds the page that was being written.
    """
    log = path.with_name(path.name + "-wal")
    if not path.is_file() or (log.exists() and log.stat().st_size):
        return None
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    size = path.stat().st_size
    if len(header) < _HEADER_BYTES or not header.startswith(_MAGIC):
        return None  # new, or nothing of SQLite's, which says so itself
    written = int.from_bytes(header[_PAGE_BYTES_AT], "big")
    page_bytes = _LARGEST_PAGE if written == 1 else written
    if page_bytes == 0 or size % page_bytes == 0:
        return None
    return f"{size} bytes are no whole pages of {page_bytes}: the end of the file is missing"
