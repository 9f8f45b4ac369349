"""High-water mark: last transaction of a database, recorded in a file beside the database."""

import fcntl
import json
import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from service.runtime.files import write_private

FORMAT = "padwatch-high-water-mark-1"
SLOT_BYTES = 512
"""Size of a mark in the file; disks write this size atomically."""

_SUM_BYTES = 9
TEXT_BYTES = SLOT_BYTES - _SUM_BYTES


@dataclass(frozen=True)
class Mark:
    """High-water mark: the last committed transaction of a database.

    Parameters
    ----------
    store
        Random identifier of the database.
    host
        Identifier of the machine that wrote the mark; empty if the machine has none.
    n_commits
        Total number of committed transactions.
    nonce
        Random identifier of the transaction; it differs between independently written copies.
    time_ns
        Time of writing, ns since 1970 UTC.
    """

    store: str
    host: str
    n_commits: int
    nonce: str
    time_ns: int


def encoded(mark: Mark) -> bytes:
    """Return a mark as JSON text with a CRC-32, `SLOT_BYTES` bytes long."""
    text = json.dumps({"format": FORMAT, **asdict(mark)}).encode("ascii").ljust(TEXT_BYTES)
    return text + b"%08x\n" % zlib.crc32(text)


def decoded(slot: bytes) -> Mark | None:
    """Return the mark in the bytes that `encoded` returned; None if the bytes are invalid."""
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
"""File offsets of two marks, written alternately; an interrupted write damages only one."""


class MarkError(ValueError):
    """Error raised if the mark file is missing, unreadable, damaged or of another database."""


class NoMarkError(MarkError):
    """Error raised if the file of the high-water mark does not exist."""


def mark_path(database: Path) -> Path:
    """Return the path of the high-water mark file beside a database."""
    return database.with_name(database.stem + SUFFIX)


class MarkFile:
    """File with the commit count that a database has reached, to detect that an older copy is used.

    Several processes may write it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> Mark:
        """Return the newest mark in the file.

        Raises `MarkError` if the file is unreadable or damaged; `NoMarkError` if it does not exist.
        """
        try:
            with _opened(self.path, os.O_RDONLY) as descriptor:
                return self._newest(_slots(descriptor))
        except FileNotFoundError:
            raise NoMarkError(f"{self.path}: the high-water mark file does not exist") from None
        except OSError as error:
            why = f"the high-water mark file cannot be read: {error.strerror}"
            raise MarkError(f"{self.path}: {why}") from error

    def advance(self, mark: Mark) -> None:
        """Write a mark, durable on return; a mark older than the newest in the file is ignored.

        Raises
        ------
        MarkError
            If the file is missing, damaged or of another database; it is not replaced.
        OSError
            If the file cannot be written.
        """
        try:
            with _opened(self.path, os.O_RDWR) as descriptor:
                fcntl.flock(descriptor, fcntl.LOCK_EX)
                slots = _slots(descriptor)
                newest = self._newest(slots)
                if newest.store != mark.store:
                    why = "the high-water mark belongs to another database"
                    raise MarkError(f"{self.path}: {why}")
                if newest.n_commits < mark.n_commits:
                    os.pwrite(descriptor, encoded(mark), SLOTS[slots.index(newest) - 1])
                    os.fdatasync(descriptor)
        except FileNotFoundError:
            raise NoMarkError(f"{self.path}: the high-water mark file does not exist") from None

    def replace(self, mark: Mark) -> None:
        """Replace the file by a new file with this mark.

        Raises `OSError` if the file cannot be written; the previous file stays.
        """
        write_private(self.path, encoded(mark).ljust(SLOTS[1], b"\0") + encoded(mark))

    def _newest(self, slots: list[Mark | None]) -> Mark:
        marks = [mark for mark in slots if mark is not None]
        if not marks:
            raise MarkError(f"{self.path}: the high-water mark file is damaged")
        return max(marks, key=lambda mark: mark.n_commits)


def _slots(descriptor: int) -> list[Mark | None]:
    return [decoded(os.pread(descriptor, SLOT_BYTES, place)) for place in SLOTS]


@contextmanager
def _opened(path: Path, flags: int) -> Iterator[int]:
    descriptor = os.open(path, flags | os.O_CLOEXEC)
    try:
        yield descriptor
    finally:
        os.close(descriptor)
