"""`MarkFile`: the mark beside the database, on the disk after every transaction."""

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from service.store.highwater.mark import SLOT_BYTES, Mark, decoded, encoded

SUFFIX = ".high-water-mark"
SLOTS = (0, 4096)
"""Written by turns, in blocks of their own: a write that is torn leaves the mark before it."""


class MarkError(ValueError):
    """There is no mark; the message says why."""


class NoMarkError(MarkError):
    """The file is not there."""


def mark_path(database: Path) -> Path:
    """Where the mark of a database is."""
    return database.with_name(database.stem + SUFFIX)


class MarkFile:
    """The file of a database's mark; several processes may write it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> Mark:
        """Read the mark.

        Raises
        ------
        MarkError
            If there is none, or it is damaged; `NoMarkError` if the file is not there.
        """
        try:
            with _opened(self.path, os.O_RDONLY) as descriptor:
                return _newest(_slots(descriptor))
        except FileNotFoundError:
            raise NoMarkError("is not there") from None
        except OSError as error:
            raise MarkError(f"cannot be read: {error.strerror}") from error

    def advance(self, mark: Mark) -> None:
        """Write a later mark, on the disk when this returns; an earlier one changes nothing.

        Raises
        ------
        MarkError
            If the file is not there or damaged: what it said must be told before it is made anew.
        OSError
            If the disk refuses.
        """
        try:
            with _opened(self.path, os.O_RDWR) as descriptor:
                fcntl.flock(descriptor, fcntl.LOCK_EX)
                slots = _slots(descriptor)
                newest = _newest(slots)
                if newest.store != mark.store:
                    raise MarkError("belongs to another database")
                if newest.n_commits < mark.n_commits:
                    os.pwrite(descriptor, encoded(mark), SLOTS[slots.index(newest) - 1])
                    os.fdatasync(descriptor)
        except FileNotFoundError:
            raise NoMarkError("is not there") from None

    def replace(self, mark: Mark) -> None:
        """Make the file anew with this mark, whatever it said before.

        Raises
        ------
        OSError
            If the disk refuses; what was there stays.
        """
        descriptor, aside = tempfile.mkstemp(prefix=f".{self.path.name}-", dir=self.path.parent)
        try:
            with os.fdopen(descriptor, "wb") as file:
                for place in SLOTS:
                    file.seek(place)
                    file.write(encoded(mark))
                file.flush()
                os.fsync(file.fileno())
            os.replace(aside, self.path)
        except BaseException:
            Path(aside).unlink(missing_ok=True)
            raise
        with _opened(self.path.parent, os.O_RDONLY) as folder:
            os.fsync(folder)


def _slots(descriptor: int) -> list[Mark | None]:
    return [decoded(os.pread(descriptor, SLOT_BYTES, place)) for place in SLOTS]


def _newest(slots: list[Mark | None]) -> Mark:
    marks = [mark for mark in slots if mark is not None]
    if not marks:
        raise MarkError("is damaged")
    return max(marks, key=lambda mark: mark.n_commits)


@contextmanager
def _opened(path: Path, flags: int) -> Iterator[int]:
    descriptor = os.open(path, flags | os.O_CLOEXEC)
    try:
        yield descriptor
    finally:
        os.close(descriptor)
