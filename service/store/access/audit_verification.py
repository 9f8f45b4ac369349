"""Whether the audit trail is whole: its chain, and the file that names its newest entry."""

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from service.runtime.files import write_private
from service.store.access.audit_entries import FIRST, AuditEntry, recomputed

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
    """Write a head, durable on return.

    Raises
    ------
    OSError
        If that fails; the previous head stays.
    """
    write_private(path, json.dumps({"format": FORMAT, **asdict(head)}).encode() + b"\n")


def _head(document: object) -> AuditHead:
    if not isinstance(document, dict) or set(document) != {"format", "number", "hash"}:
        raise ValueError("not a head")
    number, hash_ = document["number"], document["hash"]
    is_head = document["format"] == FORMAT and type(number) is int and number >= 0
    if not is_head or not isinstance(hash_, str) or len(hash_) != len(FIRST):
        raise ValueError("not a head")
    return AuditHead(number, hash_)


HEAD_DIFFERED = "audit.head_differed"
"""Action of an entry that tells that the head did not fit the chain when it was written."""


MAX_BEHIND = 64
"""Entries by which a head may lag; a crash leaves out those of one transaction."""


@dataclass(frozen=True)
class Finding:
    """What is wrong.

    Parameters
    ----------
    number
        The first entry that it is wrong with; None where it is the head.
    """

    number: int | None
    detail: str


@dataclass(frozen=True)
class Verdict:
    """What there is to say of an audit trail.

    Parameters
    ----------
    n_entries
        That are whole, from the first one on.
    hash
        Of the last of them.
    finding
        What is wrong with what follows; None if nothing is.
    n_behind
        By how many entries the head lags, as after a crash; it is repaired by the next entry.
    is_shared
        Whether other hosts write to the trail as well, each with a head of its own: then it lags
        by what they have written since.
    told
        Entries which tell that the head did not fit the chain when they were written.
    """

    n_entries: int
    hash: str
    finding: Finding | None
    n_behind: int = 0
    told: tuple[int, ...] = ()
    is_shared: bool = False

    @property
    def is_whole(self) -> bool:
        """Whether nothing is wrong with the chain as it is now."""
        return self.finding is None


def walk(
    entries: Iterable[AuditEntry],
    head: AuditHead | str,
    rename: Callable[[AuditEntry], str],
    *,
    is_shared: bool = False,
) -> Verdict:
    """Look at every entry, oldest first, and compare the last with the head.

    Parameters
    ----------
    head
        From the file beside; where it cannot be had, why. Read before the entries: it may lag
        behind them, never the other way round.
    rename
        Says in words where an entry belongs whose hash is not its own.
    is_shared
        Whether other hosts write to the trail as well.
    """
    number, hash_, at_head = 0, FIRST, ""
    told: list[int] = []
    for entry in entries:
        finding = _wrong(entry, number, hash_, rename)
        if finding is not None:
            return Verdict(number, hash_, finding, told=tuple(told), is_shared=is_shared)
        number, hash_ = entry.number, entry.hash
        if entry.action == HEAD_DIFFERED:
            told.append(number)
        if isinstance(head, AuditHead) and number == head.number:
            at_head = hash_
    finding = _wrong_head(number, at_head, head, is_shared)
    n_behind = 0 if finding or isinstance(head, str) else number - head.number
    return Verdict(number, hash_, finding, n_behind, tuple(told), is_shared)


def _wrong(
    entry: AuditEntry, before: int, hash_: str, rename: Callable[[AuditEntry], str]
) -> Finding | None:
    due = before + 1
    if type(entry.number) is not int or entry.number < due:
        return Finding(due, f"entry {entry.number!r} stands where entry {due} belongs")
    if entry.number > due:
        last = entry.number - 1
        missing = f"entry {due} is" if last == due else f"entries {due} to {last} are"
        return Finding(due, f"{missing} missing")
    if recomputed(entry) != entry.hash:
        return Finding(due, rename(entry))
    if entry.previous_hash != hash_:
        return Finding(due, f"entry {due} does not follow entry {before}: out of order or replaced")
    return None


def _wrong_head(
    number: int, at_head: str, head: AuditHead | str, is_shared: bool
) -> Finding | None:
    if isinstance(head, str):
        return Finding(None, f"the head {head}: nothing says how far the trail went")
    if head.number > number:
        count = f"entries {number + 1} to {head.number} are"
        if head.number == number + 1:
            count = f"entry {head.number} is"
        return Finding(number + 1, f"{count} missing at the end: the head names {head.number}")
    if number - head.number > MAX_BEHIND and not is_shared:
        return Finding(None, f"the head names entry {head.number}, the trail goes to {number}")
    if (at_head if head.number else FIRST) != head.hash:
        return Finding(head.number or None, f"entry {head.number} is not the one the head names")
    return None


def place_of(entry: AuditEntry, last: int) -> str:
    """Whether an entry was altered, or stands under the number of another one."""
    for number in range(1, last + 1):
        if recomputed(replace(entry, number=number)) == entry.hash:
            return f"entry {entry.number} is out of order: what stands there is entry {number}"
    return f"entry {entry.number} was altered"
