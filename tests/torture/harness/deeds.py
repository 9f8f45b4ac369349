"""Transactions whose every value follows from seed and number, so that none needs to be kept."""

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.alarms.operation import Acknowledge, operate
from core.baseline.history import ReadingOutcome
from core.change.decision import INITIAL_DECISION, Verdict
from core.change.film_judge import FilmNews, unjudged
from core.change.film_reading import FilmReading, FilmValue
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from core.quality import Reason, missing
from core.samples.gaps import Gap
from core.spectra.cross_spectrum import average
from core.units import ns_from_s
from service.settings.storage import SpectraSettings
from service.store.audit import AuditQuery
from service.store.film_readings import FilmQuery
from service.store.outbox import OutboxMessage
from service.store.port import AlarmQuery, TrendQuery, UnitGap
from service.store.spectra import SpectraQuery
from service.store.store import Store

RECEIVER = "R"
T0_NS = 1_767_225_600_000_000_000
HOP_NS = 11_946_666_667
Build = Callable[..., Assessment]
NAMES = tuple(quantity.name for quantity in CATALOGUE)


@dataclass(frozen=True)
class AuditAction:
    """One transaction: a result with its spectrum, a gap, an alarm, a letter, a film's reading."""

    assessment: Assessment
    gap: UnitGap
    alarm: AlarmNews
    film: FilmNews

    def append_to(self, store: Store) -> None:
        """Write it."""
        store.append([self.assessment], [self.gap], [self.alarm], [self.film])


@cache
def deed(seed: int, number: int, build: Build) -> AuditAction:
    """What is done in a transaction."""
    readings = {name: value(seed, number, name) for name in NAMES}
    some = {n: v if v > 0.1 else missing(Reason.NOT_MEASURED) for n, v in readings.items()}
    time_ns = T0_NS + number * HOP_NS
    phasors = np.full((1, 4, 2), 1.0 + value(seed, number, "spectrum"), dtype=complex)
    spectrum = average(np.arange(1.0, 3.0), phasors, np.ones((1, 4), dtype=bool))
    result = replace(build(time_ns, **some), spectrum=spectrum)
    return AuditAction(result, _gap(seed, number), _alarm(readings, number), _film(seed, number))


def _alarm(readings: Mapping[str, float], number: int) -> AlarmNews:
    """An alarm that is raised; every third one is acknowledged at once."""
    time_ns = T0_NS + number * HOP_NS
    alarm, events = update(
        Alarm(AlarmIdentity("U1", f"B{number}", "order1_shaft_x")),
        Judgement(AlarmLevel.ALERT, value=150.0 + readings["speed_rpm"], limit=150.0),
        time_ns,
        AlarmRule(),
    )
    if _is_acknowledged(number):
        alarm, more = operate(alarm, Acknowledge("A. Name", 1), time_ns + 1)
        return AlarmNews(alarm, (*events, *more))
    return AlarmNews(alarm, events)


def _is_acknowledged(number: int) -> bool:
    return number % 3 == 0


def _film(seed: int, number: int) -> FilmNews:
    numbers = [value(seed, number, f"film {n}") for n in range(10)]
    values = tuple(
        FilmValue(*numbers[4 * row : 4 * row + 4], ReadingOutcome.MEASURED, Reason.OK)
        for row in (0, 1)
    )
    reading = FilmReading(
        *("U1", "UJB", Estimator.DYNAMIC, T0_NS + number * HOP_NS),
        BearingCondition(OperatingState.FULL_LOAD, True, None),
        *(92.3, 300.0, numbers[8], 0.001, 30.0, numbers[9]),
        (values[0], values[1]),
    )
    said = unjudged(Verdict.NO_BASELINE)
    return FilmNews(reading, said, (INITIAL_DECISION,) * len(said))


def letters(alarm: Alarm, event: AlarmEvent) -> Iterator[OutboxMessage]:
    """Tell somebody of every alarm that is raised."""
    if event.change is AlarmChange.RAISED:
        body = f"{event.value!r}"
        yield OutboxMessage(
            *(RECEIVER, alarm.identity.subject, body, event.time_ns),
            is_urgent=False,
            is_active=True,
            closes=False,
        )


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
    parts = {name: read(store) for name, read in PARTS.items()}
    any_ = set[int]().union(*parts.values())
    wanted = {n: _parts_of(deed(seed, n, build), n) for n in range(offered + 1) if n in any_}
    torn = [n for n, due in wanted.items() if any(n not in parts[name] for name in due)]
    return Loss(
        lost=tuple(n for n in range(acknowledged + 1) if n not in wanted or n in torn),
        torn=tuple(torn),
        unexpected=tuple(
            sorted(
                n
                for name, part in parts.items()
                for n in part
                if n not in wanted or name not in wanted[n]
            )
        ),
        altered=tuple(
            n
            for n, due in wanted.items()
            if any(n in parts[name] and parts[name][n] != one for name, one in due.items())
        ),
    )


def _parts_of(done: AuditAction, number: int) -> dict[str, object]:
    """What a transaction leaves in every part of the store; not in all of them something."""
    values = [v for one in done.film.reading.values for v in (one.ln_k, one.shaft_um_pk)]
    due: dict[str, object] = {
        "results": {name: r.value for name, r in done.assessment.readings.items()},
        "gaps": done.gap.gap,
        "alarms": tuple(done.alarm.events),
        "letters": f"{done.alarm.events[0].value!r}",
        "films": tuple(values),
    }
    if _is_acknowledged(number):
        due["audit"] = "A. Name"
    if _has_spectrum(number):
        due["spectra"] = 1
    return due


SPECTRA = SpectraSettings()


def _has_spectrum(number: int) -> bool:
    """Whether it is the first of a stretch of time of which one is kept."""
    return number == 0 or any(
        (T0_NS + number * HOP_NS) // every_ns != (T0_NS + (number - 1) * HOP_NS) // every_ns
        for every_ns in map(ns_from_s, (SPECTRA.dense_every_s, SPECTRA.sparse_every_s))
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


def _letters(store: Store) -> dict[int, object]:
    waiting = store.outbox.waiting(RECEIVER, 100_000)
    found: dict[int, object] = {}
    for letter in waiting:
        number = int(letter.event_id.removeprefix("B"))
        found[number] = "twice" if number in found else letter.body
    return found


def _films(store: Store) -> dict[int, object]:
    history = store.films.history(FilmQuery("U1", "UJB", Estimator.DYNAMIC)).history
    return {
        _number(int(time_ns)): tuple(
            float(values[row, i])
            for row in (0, 1)
            for values in (history.ln_k, history.shaft_um_pk)
        )
        for i, time_ns in enumerate(history.time_ns)
    }


def _audit(store: Store) -> dict[int, object]:
    entries = store.audit.entries(AuditQuery(limit=100_000, action="alarm.acknowledged"))
    return {int(entry.object.split(":")[1].removeprefix("B")): entry.actor for entry in entries}


def _spectra(store: Store) -> dict[int, object]:
    found = store.spectra.read(SpectraQuery("U1", "UJB", 0, 2**62, 100_000))
    assert not found.damaged_ns
    return {_number(one.time_ns): one.n_segments for one in found.spectra}


PARTS: Mapping[str, Callable[[Store], dict[int, object]]] = {
    "results": _results,
    "gaps": _gaps,
    "alarms": _alarms,
    "letters": _letters,
    "films": _films,
    "audit": _audit,
    "spectra": _spectra,
}
"""What a transaction may leave, and how it is read back: by its number."""


def _number(time_ns: int) -> int:
    number, rest = divmod(time_ns - T0_NS, HOP_NS)
    return number if rest == 0 else -1
