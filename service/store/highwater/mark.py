"""High-water mark: the last transaction of a database, in the database and in a file beside it."""

import fcntl
import json
import os
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

FORMAT = "padwatch-high-water-mark-1"
SLOT_BYTES = 512
"""What disks write whole or not at all."""

_SUM_BYTES = 9
TEXT_BYTES = SLOT_BYTES - _SUM_BYTES


@dataclass(frozen=True)
class Mark:
    """A database's newest transaction.

    Parameters
    ----------
    store
        Of the database, made by chance when that was made.
    host
        Of the machine that wrote it; empty where machines have no name.
    n_commits
        Transactions there ever were.
    nonce
        Of this one, made by chance: two histories that part never have the same again.
    time_ns
        When it was written, UTC.
    """

    store: str
    host: str
    n_commits: int
    nonce: str
    time_ns: int


def encoded(mark: Mark) -> bytes:
    """A mark as `SLOT_BYTES` bytes that people can read, too."""
    text = json.dumps({"format": FORMAT, **asdict(mark)}).encode("ascii").ljust(TEXT_BYTES)
    return text + b"%08x\n" % zlib.crc32(text)


def decoded(slot: bytes) -> Mark | None:
    """Invert `encoded`; None for anything else."""
    text, checksum = slot[:TEXT_BYTES], slot[TEXT_BYTES:]
    if checksum != b"%08x\n" % zlib.crc32(text):
        return None
    try:
        document = json.loads(text)
        if document.pop("format") != FORMAT:
            return None
        return Mark(**document)
    except (ValueError, TypeError, KeyError, AttributeError):
        return None


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
