"""`Mark`: which transaction was the last; the same words in the database and beside it."""

import json
import zlib
from dataclasses import asdict, dataclass

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
