"""Durations are counted where they belong, and alarms and films as they were judged."""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from typing import Any
from unittest.mock import Mock

import pytest
from prometheus_client.registry import Collector

from acquisition.clock import Clock
from core.alarms.alarm import PLANT
from core.alarms.operation import Shelve
from core.alarms.rules import UnitRules
from core.alarms.statistics import ChatterRule
from core.alarms.unit_alarms import UnitAlarms
from core.change.decision import Verdict
from core.change.film_judge import FilmFinding, FilmNews
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Estimator, Unit
from core.samples.blocks import SampleBlock
from service.live.alarm_list import LiveAlarms
from service.live.metrics import add_alarms, add_films, add_units
from service.live.receivers import ReceiverView, SenderState
from service.live.snapshot import UnitSnapshot
from service.live.status import LinkState
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.analyser import ASSESSMENTS, timed
from service.measuring.live_view import LiveView
from service.measuring.metrics import MAX_REASONS, bounded
from service.notifications.metrics import add_deliveries
from service.runtime.heartbeats import Pulse
from service.runtime.metrics import Families
from service.runtime.polls import PollClock, TimedSource


def counted(histogram: Collector) -> dict[str, float]:
    """Number and sum of what a histogram without labels, or with one set of them, has counted."""
    [family] = histogram.collect()
    return {sample.name.rpartition("_")[2]: sample.value for sample in family.samples}


def test_the_time_between_two_results_belongs_to_neither(stepped_clock):
    def results() -> Iterator[Any]:
        for _ in range(3):
            stepped_clock.step(0.1)
            yield None

    ASSESSMENTS.clear()
    for _ in timed(results(), "U1", stepped_clock.monotonic_s):
        stepped_clock.step(5.0)

    seen = counted(ASSESSMENTS)
    assert seen["count"] == 3.0
    assert seen["sum"] == pytest.approx(0.3)


async def test_a_poll_is_what_lies_between_two_waits_of_one_task(stepped_clock):
    polls = PollClock(stepped_clock)

    async def poll(n_times: int, duration_s: float) -> None:
        for _ in range(n_times):
            await polls.sleep(1.0)
            stepped_clock.step(duration_s)
        await polls.sleep(1.0)

    await asyncio.create_task(poll(4, 0.25))
    await asyncio.create_task(poll(2, 0.5))

    seen = counted(polls.polls)
    assert seen["count"] == 6.0
    assert seen["sum"] == pytest.approx(4 * 0.25 + 2 * 0.5)
    assert polls.statistics is not None
    assert (polls.statistics.n, polls.statistics.newest_s) == (6, 0.5)
    assert polls.statistics.mean_s == pytest.approx(2.0 / 6)


def test_however_many_reasons_there_are_labels_stay_few():
    rejected = {f"reason_{number}": 1 for number in range(1000)} | {"a text, not a word": 5}

    counts = bounded(rejected)

    assert len(counts) == MAX_REASONS + 1
    assert sum(counts.values()) == 1005


async def test_a_source_that_is_connected_again_begins_anew(stepped_clock):
    class Device:
        def __init__(self, own: Clock) -> None:
            self._own = own

        @asynccontextmanager
        async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
            yield self._deliver()

        async def _deliver(self) -> AsyncIterator[SampleBlock]:
            for _ in range(3):
                await self._own.sleep(1.0)
                stepped_clock.step(0.25)
            return
            yield

    source = TimedSource(Device, stepped_clock)
    for _ in range(2):
        async with source.connect() as blocks:
            assert [block async for block in blocks] == []
        stepped_clock.step(3600.0)  # without a link, which is no poll

    seen = counted(source.polls)
    assert seen["count"] == 4.0
    assert seen["sum"] == pytest.approx(4 * 0.25)


async def test_a_driver_may_look_at_the_clock_in_a_thread_of_its_own(stepped_clock):
    """As that of a CAN bus does; it says nothing of the task that reads the source."""
    pulse = Mock(spec=Pulse)
    polls = PollClock(stepped_clock)
    polls.set_pulse(pulse)
    assert await asyncio.to_thread(polls.monotonic_s) == stepped_clock.monotonic_s()
    pulse.beat.assert_not_called()
    polls.monotonic_s()
    pulse.beat.assert_called_once_with(0.0)


HOUR_NS = 3_600_000_000_000
NOW_NS = 1_000 * HOUR_NS


def of(add: Callable[..., None], name: str, *parts: Any) -> dict[tuple[str, ...], float]:
    """What is not zero in the families that a function adds, by values of labels."""
    metrics = Families()
    add(metrics, *parts)
    return {
        tuple(sample.labels.values()): sample.value
        for family in metrics.collect()
        for sample in family.samples
        if sample.name == f"padwatch_{name}" and sample.value
    }


def unit_named(name: str) -> Unit:
    channels = tuple(Channel(id_, Measurand.DISPLACEMENT_UM) for id_ in ("sx", "sy", "bx", "by"))
    bearing = Bearing("UJB", 1.18e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0))
    return Unit(name, 60.0, 100.0, channels, (bearing,))


def test_an_alarm_counts_while_it_is_active_and_not_hidden(stepped_clock):
    boards = {name: UnitAlarms(unit_named(name), UnitRules()) for name in ("U1", "U2", "U9")}
    engine = AlarmEngine(boards, lambda _: None, stepped_clock)
    units = ("U1", "U2")  # U9 is in the plant file no longer

    def told(name: str) -> dict[tuple[str, ...], float]:
        judged = frozenset(a.identity.id for a in engine.alarms if engine.is_judged(a))
        listed = LiveAlarms(units, lambda _: True, ChatterRule())
        for unit in (*units, PLANT):
            found = UnitSnapshot({}, tuple(engine.alarms), judged, frozenset(), {}, {})
            listed.take(unit, found)
        return of(add_alarms, name, listed, units)

    assert told("alarms_active") == {}

    for name in ("U1", "U9"):
        engine.link(name, is_connected=False, reason="nobody answers")
    stepped_clock.step(60.0)
    engine.tick()
    found = told("alarms_active")
    assert found == {("U1", "alert"): 1.0, ("plant", "alert"): 1.0}
    assert told("alarms_unacknowledged") == {(): 2.0}

    engine.operate(
        "U1:link:link_lost", Shelve("Ada", "new switch", stepped_clock.now_ns() + HOUR_NS)
    )
    found = told("alarms_active")
    assert found == {("plant", "alert"): 1.0}
    assert told("alarms_hidden") == {(): 1.0}


def said(*findings: FilmFinding) -> FilmNews:
    x, y = findings
    reading: Any = None
    decisions: Any = ()
    return FilmNews(reading, (x, y), decisions)


BEARINGS = {"U1": ["UJB", "LJB"], "U2": ["UJB"]}


def test_films_count_under_the_word_that_was_said_last(stepped_clock):
    newest = {
        ("U1", "UJB"): said(FilmFinding(Verdict.NORMAL), FilmFinding(Verdict.DANGER)),
        ("U1", "LJB"): said(FilmFinding(Verdict.NORMAL), FilmFinding(Verdict.NO_BASELINE)),
    }
    live = LiveView(BEARINGS, stepped_clock, 30.0)
    films = Families()
    add_films(films, live, lambda unit, bearing: newest.get((unit, bearing)), BEARINGS)

    found = {
        (sample.labels["unit"], sample.labels["verdict"]): sample.value
        for family in films.collect()
        for sample in family.samples
    }
    assert {labels: n for labels, n in found.items() if n} == {
        ("U1", "normal"): 2.0,
        ("U1", "danger"): 1.0,
        ("U1", "no_baseline"): 1.0,
    }
    assert len(found) == len(BEARINGS) * len(Verdict)  # every word, from the start on


def test_values_of_a_film_are_told_with_their_quality_and_bad_ones_left_out(live):
    parts = (live, BEARINGS)
    stiffness = of(add_units, "film_stiffness_newtons_per_meter", *parts)
    amplitudes = of(add_units, "order1_pk_meters", *parts)

    assert stiffness == {
        ("good", "U1", "UJB", "x", "dynamic"): 1.5e9,
        ("uncertain", "U1", "UJB", "y", Estimator.TRANSFER_ORDER1.value): 1.25e9,
    }
    assert amplitudes["good", "U1", "UJB", "shaft_x"] == pytest.approx(80e-6)
    assert ("U1", "UJB", "shaft_y") not in {labels[1:] for labels in amplitudes}
    assert of(add_units, "eccentricity_ratio", *parts) == {("good", "U1", "UJB"): 0.3}
    assert of(add_units, "oil_temperature_celsius", *parts) == {("good", "U1", "UJB"): 45.5}


def test_a_change_is_told_of_judged_films_as_a_ratio(live):
    judged = FilmFinding(Verdict.ALERT, change=math.log(0.8))
    silent = FilmFinding(Verdict.TRANSIENT, change=math.log(0.5))

    found = of(add_films, "film_stiffness_ratio", live, lambda *_: said(judged, silent), BEARINGS)

    assert found == {("U1", "UJB", "x"): pytest.approx(0.8)}


@pytest.mark.parametrize("outdate", ["stale", "lost"])
def test_nothing_of_a_film_is_told_once_its_result_is_out_of_date(live, stepped_clock, outdate):
    if outdate == "stale":
        stepped_clock.step(31.0)
    else:
        live.set_link("U1", LinkState.NOT_CONNECTED, "nobody answers")
    news = said(*[FilmFinding(Verdict.NORMAL, change=0.01)] * 2)

    for name in ("film_stiffness_newtons_per_meter", "order1_pk_meters", "eccentricity_ratio"):
        assert of(add_units, name, live, BEARINGS) == {}
    assert of(add_films, "film_stiffness_ratio", live, lambda *_: news, BEARINGS) == {}


def test_recipients_of_one_mail_are_added_up_and_never_named():
    """Two recipients of one mail, and a webhook that is in the plant file no longer."""

    def view(name: str, n_waiting: int, hours: int | None, n_dead: int) -> ReceiverView:
        oldest_ns = None if hours is None else NOW_NS - hours * HOUR_NS
        backlog = {"n_waiting": n_waiting, "waiting_since_ns": oldest_ns, "n_dead": n_dead}
        return ReceiverView(name, "mail", n_failures=n_waiting, **backlog)

    state = SenderState.REMOVED
    gone = ReceiverView("old-hook", state=state, n_waiting=9, waiting_since_ns=0, n_dead=9)
    views = [
        view("shift:a@plant.example", 2, 3, 1),
        view("shift:b@plant.example", 0, None, 4),
        gone,
    ]

    def found(name: str) -> dict[tuple[str, ...], float]:
        return of(add_deliveries, name, views, NOW_NS)

    assert found("delivery_waiting_messages") == {("shift",): 2.0}
    assert found("delivery_dead_messages") == {("shift",): 5.0}
    assert found("delivery_failed_attempts") == {("shift",): 2.0}
    assert found("delivery_wait_seconds") == {("shift",): 3 * 3600.0}
    families = Families()
    add_deliveries(families, views, NOW_NS)
    assert b"@" not in families.text
