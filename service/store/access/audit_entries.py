"""Entries of the audit trail, and the hash chain that connects them."""

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import astuple, dataclass, replace
from enum import StrEnum
from typing import TypeAlias

from core.alarms.alarm import AlarmNews

MAX_NAME = 300
"""Maximum length of a stored actor, peer, action or object, in characters."""

MAX_REASON = 2000
MAX_DOCUMENT = 65_536
"""Maximum length of a JSON text in characters; of a longer text only the beginning is stored."""

N_SHOWN = 1000


Document: TypeAlias = object
"""JSON value."""


class Source(StrEnum):
    """Interface through which an action was taken."""

    API = "api"
    COMMAND_LINE = "command_line"
    PADWATCH = "padwatch"


@dataclass(frozen=True)
class AuditAction:
    """Action to be recorded in the audit trail.

    Parameters
    ----------
    time_ns
        Time of the action, in ns since 1970 UTC.
    actor
        Name of the person or machine; empty if unknown.
    action
        Kind of action, such as "alarm.acknowledged".
    object
        Identifier of the changed object.
    before, after
        State of the object before and after the action as JSON values; None if not recorded.
    reason
        Reason given for the action; empty if none was given.
    peer
        Network address of the request, or user of the operating system; None if unknown.
    """

    time_ns: int
    actor: str
    action: str
    object: str
    before: Document = None
    after: Document = None
    reason: str = ""
    source: Source = Source.PADWATCH
    peer: str | None = None


@dataclass(frozen=True)
class AuditEntry:
    """Stored entry of the audit trail, an action with a hash that depends on the previous entry.

    Fields that are not listed are those of `AuditAction`; long texts are truncated.

    Parameters
    ----------
    number
        Consecutive number from 1.
    before, after
        State of the object before and after the action, as canonical JSON.
    previous_hash
        Hash of the previous entry, in hexadecimal; `FIRST` in the first entry.
    hash
        SHA-256 of all other fields of this entry, in hexadecimal.
    """

    number: int
    time_ns: int
    actor: str
    source: str
    peer: str | None
    action: str
    object: str
    before: str | None
    after: str | None
    reason: str
    previous_hash: str
    hash: str


def canonical(document: object) -> str | None:
    """Return the canonical JSON text of a JSON value; None for None.

    A text of more than `MAX_DOCUMENT` characters is replaced by a JSON object that contains the
    beginning of the text and the number of its characters.

    Raises
    ------
    ValueError
        If the value contains a number that is not finite.
    """
    if document is None:
        return None
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    if len(text) <= MAX_DOCUMENT:
        return text
    return canonical({"beginning": text[:N_SHOWN], "n_characters": len(text)})


def storable(text: str, n_most: int) -> str:
    """Return a text truncated to `n_most` characters, with lone surrogates replaced by ``?``."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return whole if len(whole) <= n_most else whole[: n_most - 1] + "…"


FORMAT = "padwatch-audit-1"

FIRST = "0" * 64
"""Value of `previous_hash` in the first entry."""


def digest(values: Sequence[object]) -> str:
    """Return the SHA-256, in hexadecimal, of all fields of an audit entry except its hash.

    `values` are the fields in the order of `AuditEntry`. Raises `TypeError` if a field is not text,
    a number or None.
    """
    text = json.dumps([FORMAT, *values], separators=(",", ":"))  # ASCII, so that the text is unique
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def chained(action: AuditAction, number: int, previous_hash: str) -> AuditEntry:
    """Return the audit entry of an action, chained to the hash of the previous entry.

    `number` is the number of the new entry. Long texts are truncated. Raises `ValueError` if the
    state before or after the action contains a number that is not finite.
    """
    columns = (
        *(number, action.time_ns, storable(action.actor, MAX_NAME), action.source.value),
        None if action.peer is None else storable(action.peer, MAX_NAME),
        *(storable(action.action, MAX_NAME), storable(action.object, MAX_NAME)),
        *(canonical(action.before), canonical(action.after), storable(action.reason, MAX_REASON)),
        previous_hash,
    )
    return AuditEntry(*columns, digest(columns))


def recomputed(entry: AuditEntry) -> str | None:
    """Return the hash computed from the fields of an entry; None if a field has a wrong type."""
    try:
        return digest(astuple(entry)[:-1])
    except TypeError:
        return None


@dataclass(frozen=True)
class Acting:
    """Origin of actions (interface, address and actor), as recorded in their audit entries.

    Parameters
    ----------
    peer
        Network address of the request, or user of the operating system; None if unknown.
    actor
        Name of the person or machine; empty before authentication.
    command
        Identifier of the operator command that is being executed; None for other actions.
    """

    source: Source = Source.PADWATCH
    peer: str | None = None
    actor: str = ""
    command: str | None = None


@dataclass(frozen=True)
class ActedNews(AlarmNews):
    """Alarm update that was caused by the action of a person.

    Parameters
    ----------
    peer
        Network address of the client; None if unknown.
    command
        Identifier of the operator command, which is answered when the update is stored; None if
        the action was not an operator command.
    """

    peer: str | None = None
    command: str | None = None


PADWATCH_ITSELF = Acting()

_ACTING: ContextVar[Acting] = ContextVar("acting", default=PADWATCH_ITSELF)


def acting() -> Acting:
    """Return the origin of actions in this task or thread; by default `PADWATCH_ITSELF`."""
    return _ACTING.get()


@contextmanager
def acting_as(who: Acting) -> Iterator[None]:
    """Return a context manager that sets the origin of the actions taken within its block."""
    token = _ACTING.set(who)
    try:
        yield
    finally:
        _ACTING.reset(token)


def name_actor(actor: str) -> None:
    """Set the actor of the following actions of this task, until an enclosing `acting_as` ends."""
    _ACTING.set(replace(acting(), actor=actor))
