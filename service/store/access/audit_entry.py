"""`Deed`: what somebody did; `AuditEntry`: the same as it stands in the chain."""

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

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
class Deed:
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
