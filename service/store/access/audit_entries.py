"""An entry of the audit trail, and the chain of hashes that it stands in."""

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
"""Characters of an actor, a peer, an action and an object that are kept."""

MAX_REASON = 2000
MAX_DOCUMENT = 65_536
"""Characters of a document before or after; a longer one is kept as its beginning and its size."""

N_SHOWN = 1000


Document: TypeAlias = object
"""Of what JSON can hold."""


class Source(StrEnum):
    """What a deed was done through."""

    API = "api"
    COMMAND_LINE = "command_line"
    PADWATCH = "padwatch"


@dataclass(frozen=True)
class AuditAction:
    """What is to be written into the audit trail.

    Parameters
    ----------
    time_ns
        When, UTC.
    actor
        Who; empty if that is not known.
    action
        What was done, as "alarm.acknowledged".
    object
        What it was done to.
    before, after
        What that was before and after it, of what JSON can hold; None where nothing is to be said.
    peer
        Address that it was asked from, or the user of the operating system; None if there is none.
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
    """One link of the chain, as it is stored.

    Parameters
    ----------
    number
        From 1 without a hole.
    before, after
        Canonical JSON.
    previous_hash, hash
        SHA-256 in hexadecimal, of the entry before and of all of this one but itself.
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
    """One and the same text for one and the same document; None for nothing.

    Raises
    ------
    ValueError
        If it holds a number that is none.
    """
    if document is None:
        return None
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    if len(text) <= MAX_DOCUMENT:
        return text
    return canonical({"beginning": text[:N_SHOWN], "n_characters": len(text)})


def storable(text: str, n_most: int) -> str:
    """A text as the store can hold it: halves of characters replaced, cut where it is too long."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return whole if len(whole) <= n_most else whole[: n_most - 1] + "…"


FORMAT = "padwatch-audit-1"

FIRST = "0" * 64
"""What the first entry has for the hash of the one before it."""


def digest(values: Sequence[object]) -> str:
    """SHA-256 of the columns of an entry without its own hash, in their order.

    Raises
    ------
    TypeError
        If one of them is neither text, number nor None.
    """
    text = json.dumps([FORMAT, *values], separators=(",", ":"))  # ASCII: one text for one list
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def chained(deed: AuditAction, number: int, previous_hash: str) -> AuditEntry:
    """A deed as the entry that follows another."""
    columns = (
        *(number, deed.time_ns, storable(deed.actor, MAX_NAME), deed.source.value),
        None if deed.peer is None else storable(deed.peer, MAX_NAME),
        *(storable(deed.action, MAX_NAME), storable(deed.object, MAX_NAME)),
        *(canonical(deed.before), canonical(deed.after), storable(deed.reason, MAX_REASON)),
        previous_hash,
    )
    return AuditEntry(*columns, digest(columns))


def recomputed(entry: AuditEntry) -> str | None:
    """The hash that an entry should have; None if it holds what no entry holds."""
    try:
        return digest(astuple(entry)[:-1])
    except TypeError:
        return None


@dataclass(frozen=True)
class Acting:
    """Who is at work.

    Parameters
    ----------
    peer
        Address of a request, or the user of the operating system.
    actor
        Who that is, once it is known; empty until then.
    command
        Which command in the database is being carried out; None where none is.
    """

    source: Source = Source.PADWATCH
    peer: str | None = None
    actor: str = ""
    command: str | None = None


@dataclass(frozen=True)
class ActedNews(AlarmNews):
    """News of an alarm that an action of a person has caused.

    Parameters
    ----------
    peer
        Network address of the client that asked for it, if known.
    command
        Id of the command that asked for it; it is answered by being stored with the news.
    """

    peer: str | None = None
    command: str | None = None


NOBODY = Acting()

_ACTING: ContextVar[Acting] = ContextVar("acting", default=NOBODY)


def acting() -> Acting:
    """Who is at work in this task or thread; padwatch itself where nobody has said so."""
    return _ACTING.get()


@contextmanager
def acting_as(who: Acting) -> Iterator[None]:
    """Write down what is done within as done by somebody."""
    token = _ACTING.set(who)
    try:
        yield
    finally:
        _ACTING.reset(token)


def name_actor(actor: str) -> None:
    """Say who is behind the request that is being answered, once that has been checked."""
    _ACTING.set(replace(acting(), actor=actor))
