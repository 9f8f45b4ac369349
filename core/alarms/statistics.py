"""Figures of an alarm list (ISA-18.2, clause 16): rates, standing and chattering alarms."""

from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.alarms.alarm import ANNOUNCED, Alarm, AlarmChange, AlarmEvent, AlarmState
from core.arrays import TimeArray
from core.limits import AlarmLevel
from core.units import DAY_NS, NS_PER_S

SHOWN_NS = 600 * NS_PER_S
"""For how long after its last activation an alarm still counts as chattering."""


@dataclass(frozen=True)
class ChatterRule:
    """Activations within a window that make an alarm chattering.

    An alarm that is active for less than the window is fleeting.
    """

    n_activations: int = 3
    window_ns: int = 60 * NS_PER_S


class ChatterWatch:
    """Counts the newest activations of alarms."""

    def __init__(self, rule: ChatterRule) -> None:
        self._rule = rule
        self._raised: dict[str, deque[int]] = {}
        self._chattered: dict[str, int] = {}

    def note(self, event: AlarmEvent, seen_ns: int) -> None:
        """Count an event, seen at a host time; its own time may be that of samples long past."""
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


TEN_MINUTES_NS = 600 * NS_PER_S

STALE_NS = DAY_NS
"""An alarm that is active for longer is stale."""

N_FLOOD = 10
"""More alarms than this in ten minutes are a flood: too many for an operator (ISA-18.2)."""

N_MOST_FREQUENT = 10

HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)


@dataclass(frozen=True)
class Frequent:
    """One of the most frequent alarms: how often it was announced, and its share of all."""

    alarm: str
    n_alarms: int
    share: float


@dataclass(frozen=True)
class AlarmFigures:
    """Figures over some time.

    Parameters
    ----------
    n_alarms
        Announcements: alarms that were raised, rose to danger, or came back from being hidden.
    most_in_10_min
        In the worst ten minutes.
    share_in_flood
        Of the ten-minute periods, those with more than `N_FLOOD`.
    most_frequent
        At most `N_MOST_FREQUENT`, the most frequent first.
    chattering
        By alarm: activations that lie, with enough others, within one window.
    n_fleeting
        Alarms that returned within the window.
    """

    n_alarms: int
    per_day: float
    per_10_min: float
    most_in_10_min: int
    share_in_flood: float
    n_by_level: Mapping[AlarmLevel, int]
    most_frequent: Sequence[Frequent]
    chattering: Mapping[str, int]
    n_fleeting: int


def is_announced(event: AlarmEvent) -> bool:
    """Whether an event calls an operator: an alarm that is new on the list, or back on it."""
    return event.state_after is AlarmState.UNACKNOWLEDGED and (
        event.change in ANNOUNCED or event.state_before in HIDDEN
    )


def figures_of(
    events: Iterable[AlarmEvent], start_ns: int, end_ns: int, rule: ChatterRule
) -> AlarmFigures:
    """Figures of the events from a start up to, not including, an end; other events are left out.

    Raises
    ------
    ValueError
        If the end is not after the start.
    """
    if end_ns <= start_ns:
        raise ValueError(f"end {end_ns} must be after start {start_ns}")
    within = [event for event in events if start_ns <= event.time_ns < end_ns]
    announced = [event for event in within if is_announced(event)]
    by_alarm = Counter(event.identity.id for event in announced)
    n, span_ns = len(announced), end_ns - start_ns
    times = np.sort(np.array([event.time_ns for event in announced], np.int64))
    _, per_period = np.unique((times - start_ns) // TEN_MINUTES_NS, return_counts=True)
    return AlarmFigures(
        n_alarms=n,
        per_day=n * DAY_NS / span_ns,
        per_10_min=n * TEN_MINUTES_NS / span_ns,
        most_in_10_min=int(np.max(_n_before(times, TEN_MINUTES_NS - 1), initial=0)),
        share_in_flood=int(np.sum(per_period > N_FLOOD)) / -(-span_ns // TEN_MINUTES_NS),
        n_by_level={level: sum(e.level is level for e in announced) for level in AlarmLevel},
        most_frequent=[
            Frequent(alarm, found, found / n)
            for alarm, found in by_alarm.most_common(N_MOST_FREQUENT)
        ],
        chattering=_chattering(within, rule),
        n_fleeting=_n_fleeting(within, rule),
    )


def stale_alarms(alarms: Iterable[Alarm], now_ns: int) -> list[Alarm]:
    """Alarms on the list that have been active for more than a day, the oldest first."""
    standing = [
        (alarm.raised_ns, alarm)
        for alarm in alarms
        if alarm.level is not None and alarm.raised_ns is not None and alarm.state not in HIDDEN
    ]
    old = [pair for pair in standing if now_ns - pair[0] > STALE_NS]
    return [alarm for _, alarm in sorted(old, key=lambda pair: pair[0])]


def _n_before(times: TimeArray, window_ns: int) -> npt.NDArray[np.int64]:
    """Number of the sorted times in the window that ends with each of them, ends included."""
    return np.arange(1, times.size + 1) - np.searchsorted(times, times - window_ns)


def _chattering(events: Iterable[AlarmEvent], rule: ChatterRule) -> dict[str, int]:
    """Activations of each alarm that lie, with enough others, within one window."""
    raised: defaultdict[str, list[int]] = defaultdict(list)
    for event in events:
        if event.change in ANNOUNCED:
            raised[event.identity.id].append(event.time_ns)
    counts, n = {}, rule.n_activations
    for alarm, times in raised.items():
        last = np.flatnonzero(_n_before(np.sort(times), rule.window_ns) >= n)
        counts[alarm] = np.unique(last[:, np.newaxis] - np.arange(n)).size
    return {alarm: count for alarm, count in counts.items() if count}


def _n_fleeting(events: Iterable[AlarmEvent], rule: ChatterRule) -> int:
    raised_ns: dict[str, int] = {}
    n_fleeting = 0
    for event in events:
        id_ = event.identity.id
        if event.change is AlarmChange.RAISED:
            raised_ns[id_] = event.time_ns
        elif event.change is AlarmChange.RETURNED and id_ in raised_ns:
            n_fleeting += event.time_ns - raised_ns.pop(id_) < rule.window_ns
    return n_fleeting
