"""Alarm system metrics (ISA-18.2, clause 16): alarm rates, stale and chattering alarms."""

from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from core.alarms.alarm import ANNOUNCED, Alarm, AlarmChange, AlarmEvent, AlarmState
from core.arrays import IntArray, TimeArray
from core.limits import AlarmLevel
from core.units import DAY_NS, NS_PER_S

SHOWN_NS = 600 * NS_PER_S
"""Time after its last chattering activation for which an alarm is reported as chattering."""


@dataclass(frozen=True)
class ChatterRule:
    """Definition of chattering: `n_activations` of an alarm within `window_ns`.

    An alarm that is active for less than the window counts as fleeting.
    """

    n_activations: int = 3
    window_ns: int = 60 * NS_PER_S


class ChatterWatch:
    """Detector of chattering alarms from the times of their newest activations, of all units."""

    def __init__(self, rule: ChatterRule) -> None:
        self._rule = rule
        self._raised: dict[str, deque[int]] = {}
        self._chattered: dict[str, int] = {}

    def note(self, event: AlarmEvent, seen_ns: int) -> None:
        """Add an event received at host time `seen_ns`; only raised and escalated alarms count."""
        if event.change not in ANNOUNCED:
            return
        n_wanted = self._rule.n_activations
        times = self._raised.setdefault(event.identity.id, deque(maxlen=n_wanted))
        times.append(event.time_ns)
        if len(times) == n_wanted and abs(times[-1] - times[0]) <= self._rule.window_ns:
            self._chattered[event.identity.id] = seen_ns

    def chattering(self, now_ns: int) -> set[str]:
        """Return the ids of alarms that chattered within `SHOWN_NS` before host time `now_ns`."""
        return {id_ for id_, seen_ns in self._chattered.items() if now_ns - seen_ns <= SHOWN_NS}


TEN_MINUTES_NS = 600 * NS_PER_S

STALE_NS = DAY_NS
"""Active time beyond which an alarm is stale."""

N_FLOOD = 10
"""Number of alarms in ten minutes above which an alarm flood is counted (ISA-18.2)."""

N_MOST_FREQUENT = 10

HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)


@dataclass(frozen=True)
class Frequent:
    """Frequent alarm: its id, number of announcements, and fraction of all announcements, 0 to 1.

    An alarm is announced when it is raised or escalated, or if it is active when its hiding ends.
    """

    alarm: str
    n_alarms: int
    share: float


@dataclass(frozen=True)
class AlarmFigures:
    """Alarm system metrics over a period.

    Parameters
    ----------
    n_alarms, per_day, per_10_min, n_by_level
        Number of announcements (alarms raised, escalated, or active when no longer hidden), its
        means per day and per ten minutes, and the numbers by level.
    most_in_10_min
        Largest number of announcements within ten minutes.
    share_in_flood
        Fraction of the ten-minute periods with more than `N_FLOOD` announcements.
    most_frequent
        At most `N_MOST_FREQUENT` alarms, the most frequent first.
    chattering
        Number of chattering activations by alarm id.
    n_fleeting
        Number of times that an alarm was active for less than the window of `ChatterRule`.
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
    """Whether an event announces an alarm: raised, escalated, or active after it was hidden."""
    return event.state_after is AlarmState.UNACKNOWLEDGED and (
        event.change in ANNOUNCED or event.state_before in HIDDEN
    )


def figures_of(
    events: Iterable[AlarmEvent], start_ns: int, end_ns: int, rule: ChatterRule
) -> AlarmFigures:
    """Return the metrics of the period from `start_ns` up to, but not including, `end_ns`.

    `events` are in order of time; those outside the period do not count. `rule` defines chattering
    and fleeting alarms.

    Raises ValueError if the end is not after the start.
    """
    if end_ns <= start_ns:
        raise ValueError(f"the end, {end_ns} ns, must be after the start, {start_ns} ns")
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
    """Return the active, visible alarms raised more than a day before `now_ns`, oldest first."""
    active = (alarm for alarm in alarms if alarm.level is not None and alarm.state not in HIDDEN)
    raised = ((alarm.raised_ns, alarm) for alarm in active if alarm.raised_ns is not None)
    old = [pair for pair in raised if now_ns - pair[0] > STALE_NS]
    return [alarm for _, alarm in sorted(old, key=itemgetter(0))]


def _n_before(times: TimeArray, window_ns: int) -> IntArray:
    """Return the number of sorted times in the closed window that ends at each time."""
    return np.arange(1, times.size + 1) - np.searchsorted(times, times - window_ns)


def _chattering(events: Iterable[AlarmEvent], rule: ChatterRule) -> dict[str, int]:
    """Return the number of chattering activations by alarm, for alarms that have any."""
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
