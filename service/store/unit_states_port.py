"""What processes that analyse write down of their units, for those that only show them."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class UnitReport:
    """What a process says of a unit at one moment.

    Parameters
    ----------
    n_beats
        How often the process has reported; a process that lives never repeats one.
    beat_ns
        When, by its host's clock; nothing is concluded from it.
    link, reason
        Whether samples arrive, in a word, and why not.
    signs
        Document: how samples arrive, and how old everything is.
    revision
        Of the state; another one as soon as the state is another.
    state
        Document: results and alarms; None where it is as it was at the report before.
    """

    unit: str
    n_beats: int
    beat_ns: int
    link: str
    reason: str | None
    last_sample_ns: int | None
    signs: str
    revision: int
    state: bytes | None


@dataclass(frozen=True)
class UnitBeat:
    """The newest report on a unit, without its state.

    Parameters
    ----------
    process
        Which process has written it: another one after each start.
    """

    unit: str
    process: str
    n_beats: int
    beat_ns: int
    signs: str
    revision: int


class UnitStates(Protocol):
    """The newest report on each unit."""

    def report(self, process: str, reports: Sequence[UnitReport]) -> None:
        """Write what a process says of its units, in one transaction."""
        ...

    def beats(self) -> Sequence[UnitBeat]:
        """Read the newest report on each unit, without the states."""
        ...

    def states(self, units: Collection[str]) -> Mapping[str, tuple[str, int, bytes]]:
        """Read states of units: by unit, which process's, its revision, and the document."""
        ...
