"""Transactions whose every value follows from seed and number, so that none needs to be kept."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

from core.account import Gap
from core.alarms.alarm import Alarm, AlarmIdentity, AlarmKind, AlarmLevel, AlarmRule, Condition
from core.alarms.event import AlarmNews
from core.alarms.life_cycle import advance
from core.assessment import Assessment
from core.quality import Reason, missing
from core.quantities import CATALOGUE
from service.store.port import AlarmQuery, Store, TrendQuery, UnitGap

T0_NS = 1_767_225_600_000_000_000
HOP_NS = 11_946_666_667
Build = Callable[..., Assessment]
NAMES = tuple(quantity.name for quantity in CATALOGUE)


@dataclass(frozen=True)
class Deed:
    """One transaction: a result, a gap and an alarm."""

    assessment: Assessment
    gap: UnitGap
    alarm: AlarmNews

    def append_to(self, store: Store) -> None:
        """Write it."""
        store.append([self.assessment], [self.gap], [self.alarm])


@cache
def deed(seed: int, number: int, build: Build) -> Deed:
    """What is done in a transaction."""
    readings = {name: value(seed, number, name) for name in NAMES}
    some = {n: v if v > 0.1 else missing(Reason.NOT_MEASURED) for n, v in readings.items()}
    time_ns = T0_NS + number * HOP_NS
    raised, events = advance(
        Alarm(AlarmIdentity("U1", f"B{number}", AlarmKind.SHAFT_X)),
        Condition(AlarmLevel.ALERT, value=150.0 + readings["speed_rpm"], limit=150.0),
        time_ns,
        AlarmRule(),
    )
    return Deed(build(time_ns, **some), _gap(seed, number), AlarmNews(raised, events))


def value(seed: int, number: int, name: str) -> float:
    """A number from 0 to 1 that nobody can guess and everybody can compute."""
    digest = hashlib.sha256(f"{seed}/{number}/{name}".encode()).digest()
    return int.from_bytes(digest[:6], "big") / 2**48


def _gap(seed: int, number: int) -> UnitGap:
    n_samples = 1 + int(1000 * value(seed, number, "gap"))
    return UnitGap("U1", Gap(3, 10_000 * number, n_samples, T0_NS + number * HOP_NS))


@dataclass(frozen=True)
class Loss:
    """What a store holds otherwise than was acknowledged and offered; all empty if nothing.

    Parameters
    ----------
    lost
        Acknowledged and not there.
    torn
        There in part.
    unexpected
        There and never offered, or there twice.
    altered
        There with other values.
    """

    lost: tuple[int, ...]
    torn: tuple[int, ...]
    unexpected: tuple[int, ...]
    altered: tuple[int, ...]

    def __bool__(self) -> bool:
        return any((self.lost, self.torn, self.unexpected, self.altered))


def loss(store: Store, seed: int, acknowledged: int, offered: int, build: Build) -> Loss:
    """Compare a store with what was done, transactions counted from 0.

    Parameters
    ----------
    acknowledged
        Number of the newest transaction that is durable; -1 for none.
    offered
        Number of the newest that was begun.
    """
    parts = (_results(store), _gaps(store), _alarms(store))
    there = [set(part) for part in parts]
    whole, any_ = set.intersection(*there), set.union(*there)
    wanted = {n: deed(seed, n, build) for n in any_ if 0 <= n <= offered}
    return Loss(
        lost=tuple(n for n in range(acknowledged + 1) if n not in whole),
        torn=tuple(sorted(any_ - whole)),
        unexpected=tuple(sorted(n for n in any_ if not 0 <= n <= offered)),
        altered=tuple(n for n in sorted(wanted) if not _is_same(wanted[n], parts, n)),
    )


Parts = tuple[Mapping[int, object], Mapping[int, object], Mapping[int, object]]


def _is_same(wanted: Deed, parts: Parts, number: int) -> bool:
    results = {name: r.value for name, r in wanted.assessment.readings.items()}
    expected = (results, wanted.gap.gap, tuple(wanted.alarm.events))
    return all(
        part[number] == one for part, one in zip(parts, expected, strict=True) if number in part
    )


def _results(store: Store) -> dict[int, object]:
    found: dict[int, object] = {}
    for some in (NAMES[start : start + 40] for start in range(0, len(NAMES), 40)):
        query = TrendQuery("U1", "UJB", some, 0, 2**62, 5000, 2**62)
        trend = store.trend(query)
        for row, time_ns in enumerate(trend.time_ns):
            values = found.setdefault(_number(time_ns), {})
            values.update({name: trend.series[name].mean[row] for name in some})  # type: ignore[attr-defined]
    return found


def _gaps(store: Store) -> dict[int, object]:
    return {gap.first_index // 10_000: gap for gap in store.gaps("U1", 0, 2**62)}


def _alarms(store: Store) -> dict[int, object]:
    events: dict[int, tuple[object, ...]] = {}
    for stored in reversed(store.alarm_events(AlarmQuery(limit=100_000))):
        number = int(stored.event.identity.subject.removeprefix("B"))
        events[number] = (*events.get(number, ()), stored.event)
    return dict(events)


def _number(time_ns: int) -> int:
    number, rest = divmod(time_ns - T0_NS, HOP_NS)
    return number if rest == 0 else -1
