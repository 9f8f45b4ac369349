"""Chattering: an alarm that comes again and again within a short time (ISA-18.2, 3.1 and 16.5)."""

from collections import deque
from dataclasses import dataclass

from core.alarms.event import ANNOUNCED, AlarmEvent
from core.units import NS_PER_S

SHOWN_NS = 600 * NS_PER_S
"""For how long after its last activation an alarm still counts as chattering."""


@dataclass(frozen=True)
class ChatterRule:
    """What counts as chattering, and as fleeting.

    Parameters
    ----------
    n_activations
        So many within the window are chattering.
    window_ns
        What is active for less is fleeting.

    Raises
    ------
    ValueError
        If fewer than two activations are asked for, or the window is empty.
    """

    n_activations: int = 3
    window_ns: int = 60 * NS_PER_S

    def __post_init__(self) -> None:
        if self.n_activations < 2:
            raise ValueError(f"n_activations {self.n_activations} must be 2 or more")
        if self.window_ns <= 0:
            raise ValueError(f"window_ns {self.window_ns} must be above 0")


class ChatterWatch:
    """Counts the newest activations of alarms.

    Parameters
    ----------
    rule
        What counts.
    """

    def __init__(self, rule: ChatterRule) -> None:
        self._rule = rule
        self._raised: dict[str, deque[int]] = {}
        self._chattered: dict[str, int] = {}

    def note(self, event: AlarmEvent, seen_ns: int) -> None:
        """Take in an event.

        Parameters
        ----------
        seen_ns
            When it was seen, host time; its own time may be that of samples long past.
        """
        if event.change not in ANNOUNCED:
            return
        n_wanted = self._rule.n_activations
        times = self._raised.setdefault(event.identity.id, deque(maxlen=n_wanted))
        times.append(event.time_ns)
        if len(times) == n_wanted and abs(times[-1] - times[0]) <= self._rule.window_ns:
            self._chattered[event.identity.id] = seen_ns

    def is_chattering(self, alarm: str, now_ns: int) -> bool:
        """Whether an alarm has chattered until a short while ago."""
        seen_ns = self._chattered.get(alarm)
        return seen_ns is not None and now_ns - seen_ns <= SHOWN_NS
