"""High-water mark: the last transaction of a database, in the database and in a file beside it."""

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
"""Size that disks write atomically."""

_SUM_BYTES = 9
TEXT_BYTES = SLOT_BYTES - _SUM_BYTES


@dataclass(frozen=True)
class Mark:
    """Last transaction of a database.

    Parameters
    ----------
    store
        Random identifier of the database.
    host
        Identifier of the machine that wrote it; empty if machines have none.
    n_commits
        Total number of transactions.
    nonce
        Random identifier of the transaction, which differs between diverging histories.
    time_ns
        Time of writing, UTC.
    """

    store: str
    host: str
    n_commits: int
    nonce: str
    time_ns: int


def encoded(mark: Mark) -> bytes:
    """Return a mark as `SLOT_BYTES` bytes of readable text."""
    text = json.dumps({"format": FORMAT, **asdict(mark)}).encode("ascii").ljust(TEXT_BYTES)
    return text + b"%08x\n" % zlib.crc32(text)


def decoded(slot: bytes) -> Mark | None:
    """Invert `encoded`; None for other bytes."""
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
"""Offsets that are written in turn, each in its own block: a torn write leaves the other mark."""


class MarkError(ValueError):
    """There is no valid mark; the message says why."""


class NoMarkError(MarkError):
    """The file does not exist."""


def mark_path(database: Path) -> Path:
    """Return the path of the mark of a database."""
    return database.with_name(database.stem + SUFFIX)


class MarkFile:
    """File with a database's mark; several processes may write it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> Mark:
        """Return the mark.

        Raises
        ------
        MarkError
            If it is damaged; `NoMarkError` if the file does not exist.
        """
        try:
            with _opened(self.path, os.O_RDONLY) as descriptor:
                return _newest(_slots(descriptor))
        except FileNotFoundError:
            raise NoMarkError("is not there") from None
        except OSError as error:
            raise MarkError(f"cannot be read: {error.strerror}") from error

    def advance(self, mark: Mark) -> None:
        """Write a later mark, durable on return; an earlier one has no effect.

        Raises
        ------
        MarkError
            If the file is missing or damaged, which must be reported before it is replaced.
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
        """Write the file anew with this mark.

        Raises
        ------
        OSError
            If the disk refuses; the previous file stays.
        """
        write_private(self.path, encoded(mark).ljust(SLOTS[1], b"\0") + encoded(mark))


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
