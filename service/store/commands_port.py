"""What operators ask of the process that analyses a unit, through the database."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


class CommandState(StrEnum):
    """What has come of a command."""

    WAITING = "waiting"
    TAKEN = "taken"
    DONE = "done"
    REFUSED = "refused"
    UNKNOWN = "unknown"
    WITHDRAWN = "withdrawn"
    INTERRUPTED = "interrupted"


OPEN = (CommandState.WAITING, CommandState.TAKEN)
"""Not answered yet."""


@dataclass(frozen=True)
class Command:
    """Something that somebody asks for; that he may was checked before.

    Parameters
    ----------
    id
        Another one for each.
    unit
        Whose process is to carry it out.
    kind, document
        What is to be done.
    actor, peer
        Who asks, and from where.
    expires_ns
        Nobody begins to carry it out later than this, by his host's clock.
    """

    id: str
    unit: str
    kind: str
    document: str
    actor: str
    peer: str | None
    asked_ns: int
    expires_ns: int


@dataclass(frozen=True)
class OpenCommand:
    """A command that is not answered, and which process has taken it; None if none has."""

    command: Command
    taken_by: str | None


@dataclass(frozen=True)
class Answer:
    """What has come of a command, with words where there is something to say."""

    state: CommandState
    words: str


DONE = Answer(CommandState.DONE, "")


class Commands(Protocol):
    """Commands of operators; each is carried out once or not at all."""

    def ask(self, command: Command) -> None:
        """Write a command down."""
        ...

    def open(self, units: Collection[str]) -> Sequence[OpenCommand]:
        """Read what is not answered of units, in the order in which it was asked."""
        ...

    def take(self, id_: str, process: str) -> bool:
        """Note that a process carries a command out now; False if it is answered already."""
        ...

    def answer(self, id_: str, answer: Answer, now_ns: int) -> None:
        """Answer a command; one that is answered already stays as it is."""
        ...

    def withdraw(self, id_: str, words: str, now_ns: int) -> bool:
        """Ask no more; False if somebody has taken or answered it."""
        ...

    def look(self, id_: str) -> Answer | None:
        """What has come of a command; None if there is no such command."""
        ...
