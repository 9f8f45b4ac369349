"""Verification of the audit trail: hash chain of the entries, and head file."""

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
    """Number and hash of the newest entry of an audit trail; number 0 for an empty trail."""

    number: int = 0
    hash: str = FIRST


class HeadError(ValueError):
    """Error raised if the head file is missing, unreadable or invalid."""


def head_path(database: Path) -> Path:
    """Return the path of the head file beside a database."""
    return database.with_name(database.stem + SUFFIX)


def chain_name(head: Path) -> str:
    """Return the name of a chain of the audit trail: its head file's name without the suffix."""
    return head.name.removesuffix(SUFFIX)


def read_head(path: Path) -> AuditHead:
    """Read the head of an audit trail from its file.

    Raises `HeadError` if the file is missing, unreadable or invalid.
    """
    try:
        with path.open("rb") as file:
            text = file.read(MAX_BYTES)
    except FileNotFoundError:
        raise HeadError(f"the head file {path.name} does not exist") from None
    except OSError as error:
        raise HeadError(f"the head file {path.name} cannot be read: {error.strerror}") from error
    try:
        return _head(json.loads(text))
    except (ValueError, RecursionError):
        raise HeadError(f"the head file {path.name} is damaged; restore it from a backup") from None


def write_head(path: Path, head: AuditHead) -> None:
    """Write the head of an audit trail to its file, durable on return.

    Raises `OSError` if the file cannot be written; the previous head stays.
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
"""Action of an audit entry which records that the head file contradicted the chain."""


MAX_BEHIND = 64
"""Maximum number of entries by which the head file may lag behind the trail after a crash."""


@dataclass(frozen=True)
class Finding:
    """Defect of an audit trail, described by the sentence `detail`.

    `number` is the number of the first affected entry; None if the head file is affected.
    """

    number: int | None
    detail: str


@dataclass(frozen=True)
class Verdict:
    """Result of verifying one chain of the audit trail.

    Parameters
    ----------
    n_entries
        Number of valid entries before the first defect.
    hash
        Hash of the last valid entry.
    finding
        First defect; None if the trail has no defect.
    n_behind
        Number of entries by which the head file lags behind the trail, as after a crash; the next
        write to the trail updates the file.
    contradictions
        Numbers of the entries which record that the head file contradicted the chain.
    is_shared
        Whether other hosts, each with its own head file, also write to the trail. The head file of
        this host may then lag behind the entries of other hosts.
    """

    n_entries: int
    hash: str
    finding: Finding | None
    n_behind: int = 0
    contradictions: tuple[int, ...] = ()
    is_shared: bool = False

    @property
    def is_whole(self) -> bool:
        """Whether the audit trail has no defect."""
        return self.finding is None


def walk(
    entries: Iterable[AuditEntry],
    head: AuditHead | str,
    rename: Callable[[AuditEntry], str],
    *,
    is_shared: bool = False,
) -> Verdict:
    """Verify all entries of an audit trail and compare them with the head; return the result.

    Parameters
    ----------
    entries
        Entries of the trail, oldest first.
    head
        Head from the file, or the reason why the file cannot be read. The file must be read before
        the entries, since the head may be older than the newest entry, but not newer.
    rename
        Function that returns a sentence about the defect of an entry with a wrong hash.
    is_shared
        Whether other hosts also write to the trail.
    """
    number, hash_, at_head = 0, FIRST, ""
    contradictions: list[int] = []
    for entry in entries:
        finding = _wrong(entry, number, hash_, rename)
        if finding is not None:
            return Verdict(
                number, hash_, finding, contradictions=tuple(contradictions), is_shared=is_shared
            )
        number, hash_ = entry.number, entry.hash
        if entry.action == HEAD_DIFFERED:
            contradictions.append(number)
        if isinstance(head, AuditHead) and number == head.number:
            at_head = hash_
    finding = _wrong_head(number, at_head, head, is_shared)
    n_behind = 0 if finding or isinstance(head, str) else number - head.number
    return Verdict(number, hash_, finding, n_behind, tuple(contradictions), is_shared)


def _wrong(
    entry: AuditEntry, before: int, hash_: str, rename: Callable[[AuditEntry], str]
) -> Finding | None:
    due = before + 1
    if type(entry.number) is not int or entry.number < due:
        return Finding(due, f"expected entry {due}, found entry {entry.number}")
    if entry.number > due:
        last = entry.number - 1
        missing = f"entry {due} is" if last == due else f"entries {due} to {last} are"
        return Finding(due, f"{missing} missing")
    if recomputed(entry) != entry.hash:
        return Finding(due, rename(entry))
    if entry.previous_hash != hash_:
        return Finding(due, f"entry {due} does not match the hash of entry {before}")
    return None


def _wrong_head(
    number: int, at_head: str, head: AuditHead | str, is_shared: bool
) -> Finding | None:
    if isinstance(head, str):
        return Finding(None, f"{head}; the end of the trail cannot be verified")
    if head.number > number:
        count = f"entries {number + 1} to {head.number} are"
        if head.number == number + 1:
            count = f"entry {head.number} is"
        detail = f"{count} missing at the end: the head file names entry {head.number}"
        return Finding(number + 1, detail)
    if number - head.number > MAX_BEHIND and not is_shared:
        detail = f"the head file names entry {head.number}, but the trail ends at {number}"
        return Finding(None, detail)
    if (at_head if head.number else FIRST) != head.hash:
        detail = f"entry {head.number} does not match the hash in the head file"
        return Finding(head.number or None, detail)
    return None


def place_of(entry: AuditEntry, last: int) -> str:
    """Return a sentence that an entry with a wrong hash was altered, or that its number is wrong.

    The number is wrong if the hash matches with another number from 1 to `last`.
    """
    for number in range(1, last + 1):
        if recomputed(replace(entry, number=number)) == entry.hash:
            return f"entry {entry.number} is out of order; its content is that of entry {number}"
    return f"entry {entry.number} was altered"
