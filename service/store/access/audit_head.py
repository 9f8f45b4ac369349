"""The file beside the database that names the newest entry, so that a cut chain is noticed."""

import json
import os
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from service.store.access.audit_hashing import FIRST

FORMAT = "padwatch-audit-head"
SUFFIX = ".audit-head.json"
MAX_BYTES = 4096


@dataclass(frozen=True)
class AuditHead:
    """The newest entry: its number, 0 before the first, and its hash."""

    number: int = 0
    hash: str = FIRST


class HeadError(ValueError):
    """A head file is not there or holds no head; the message says which."""


def head_path(database: Path) -> Path:
    """Where the head of a database's audit trail is."""
    return database.with_name(database.stem + SUFFIX)


def read_head(path: Path) -> AuditHead:
    """Read a head.

    Raises
    ------
    HeadError
        If the file is not there, or is no head.
    """
    try:
        with path.open("rb") as file:
            text = file.read(MAX_BYTES)
    except FileNotFoundError:
        raise HeadError("is not there") from None
    except OSError as error:
        raise HeadError(f"cannot be read: {error.strerror}") from error
    try:
        return _head(json.loads(text))
    except (ValueError, RecursionError):
        raise HeadError("does not hold the head of an audit trail") from None


def write_head(path: Path, head: AuditHead) -> None:
    """Write a head aside, bring it to the disk and give it its name.

    Raises
    ------
    OSError
        If the disk refuses; what was there stays.
    """
    document = {"format": FORMAT, **asdict(head)}
    # a name of its own: another process may be writing as well
    descriptor, aside = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(json.dumps(document).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, path)
    except BaseException:
        Path(aside).unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Bring the name to the disk, too: without it a power cut may leave the head before."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _head(document: object) -> AuditHead:
    if not isinstance(document, dict) or set(document) != {"format", "number", "hash"}:
        raise ValueError("not a head")
    number, hash_ = document["number"], document["hash"]
    is_head = document["format"] == FORMAT and type(number) is int and number >= 0
    if not is_head or not isinstance(hash_, str) or len(hash_) != len(FIRST):
        raise ValueError("not a head")
    return AuditHead(number, hash_)
