"""When baselines are learned and when films are compared with them: from one event to the next."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.arrays import TimeArray
from core.units import DAY_NS


@dataclass(frozen=True)
class MachineEvent:
    """What makes a new baseline necessary, such as an overhaul.

    Parameters
    ----------
    bearing
        None if it is about all of the unit.
    """

    unit: str
    bearing: str | None
    time_ns: int
    text: str

    def is_about(self, unit: str, bearing: str) -> bool:
        """Whether it makes this bearing's baseline void."""
        return self.unit == unit and self.bearing in (None, bearing)


@dataclass(frozen=True)
class Learning:
    """For how long a baseline is learned.

    Parameters
    ----------
    days
        After the first reading, and after the first behind each event.
    until_ns
        When learning ends the first time, instead; None if after so many days.
    """

    days: float
    until_ns: int | None = None

    def end_ns(self, begin_ns: int, is_first: bool) -> int:
        """When learning ends that begins at some time."""
        if is_first and self.until_ns is not None:
            return self.until_ns
        return begin_ns + round(self.days * DAY_NS)


@dataclass(frozen=True)
class Period:
    """Rows of one bearing under one baseline.

    Parameters
    ----------
    begin, learned, end
        Learned from the rows from `begin` up to `learned`; compared are those up to `end`.
    event
        What it began with; empty for the first.
    """

    version: int
    begin: int
    learned: int
    end: int
    event: str = ""


def periods_of(
    time_ns: TimeArray, events: Sequence[MachineEvent], learning: Learning
) -> list[Period]:
    """Cut the readings of a bearing at its events; periods without readings are left out."""
    ordered = sorted(events, key=lambda event: event.time_ns)
    cuts = [0, *(int(np.searchsorted(time_ns, event.time_ns)) for event in ordered), time_ns.size]
    texts = ["", *(event.text for event in ordered)]
    found: list[Period] = []
    for text, begin, end in zip(texts, cuts, cuts[1:], strict=False):
        if begin < end:
            learned_ns = learning.end_ns(int(time_ns[begin]), begin == 0)
            learned = int(np.clip(np.searchsorted(time_ns, learned_ns), begin, end))
            found.append(Period(len(found) + 1, begin, learned, end, text))
    return found
