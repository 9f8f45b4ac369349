"""Units and shared work are done by one process each, by the next when that is gone."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from harness.waiting import at_work, until
from rigs.standing_clock import StandingClock

from acquisition.clock import SystemClock
from core.alarms.alarm import PLANT, Alarm, AlarmChange, AlarmIdentity, AlarmNews, changed
from core.alarms.statistics import ChatterRule
from core.limits import AlarmLevel
from service.cluster.ownership import HoldLostError, Holds, Leadership, Partition
from service.live.alarm_list import LiveAlarms
from service.measuring.alarm_engine import AlarmEngine, alarm_engine
from service.measuring.service_alarms import ServiceHealth
from service.notifications.channel import Delivered
from service.notifications.sender import Deliveries, Receiver
from service.runtime.heartbeats import UNHEARD, Heartbeats, Pulse
from service.settings.notifications import WebhookSettings
from service.settings.plant import load_plant_file
from service.settings.storage import Origin
from service.store.database import Hold
from service.store.port import StoreError
from service.store.sqlite import SqliteStore


class Postman:
    """Delivers everything at once."""

    address = ""

    async def send(self, *_: object) -> Delivered:
        return Delivered("")


SHIFT = Receiver(
    "shift", WebhookSettings(kind="webhook", id="shift", url="http://x.example"), Postman()
)


class Name:
    """A name in a database that one may hold; a server that is started anew takes it away."""

    def __init__(self) -> None:
        self.holder: object | None = None
        self.is_away = False

    @contextmanager
    def hold(self, _: str) -> Iterator["Held"]:
        if self.holder is not None or self.is_away:
            raise StoreError("held by another")
        mine = self.holder = Held(self)
        try:
            yield mine
        finally:
            if self.holder is mine:
                self.holder = None


class Held:
    def __init__(self, name: Name) -> None:
        self._name = name

    @property
    def is_held(self) -> bool:
        return self._name.holder is self


class Process:
    """One that would lead."""

    def __init__(self, name: Name) -> None:
        clock = StandingClock()
        self.beats = Heartbeats(clock)
        self.n_working = 0
        self.leadership = Leadership(name.hold, {"gather": self._work}, self.beats, clock)
        self.task: asyncio.Task[None] | None = None

    def start(self) -> None:
        self.task = asyncio.create_task(self.leadership.run(UNHEARD))

    async def stop(self) -> None:
        assert self.task
        self.task.cancel()
        await asyncio.wait([self.task])

    async def _work(self, _: Pulse) -> None:
        self.n_working += 1
        try:
            await asyncio.Event().wait()
        finally:
            self.n_working -= 1


@pytest.fixture
def name() -> Name:
    return Name()


async def test_one_of_two_does_the_work(name):
    first, second = Process(name), Process(name)
    first.start()
    await until(lambda: first.n_working)
    second.start()
    await until(lambda: name.holder is not None)
    for _ in range(100):
        await asyncio.sleep(0)

    assert (first.n_working, second.n_working) == (1, 0)
    assert (first.leadership.is_leading, second.leadership.is_leading) == (True, False)
    await first.stop()
    await until(lambda: second.n_working)
    await second.stop()
    assert (first.n_working, second.n_working) == (0, 0)


async def test_whoever_loses_the_name_stops_before_it_may_lead_again(name):
    process = Process(name)
    process.start()
    await until(lambda: process.n_working)
    name.holder, name.is_away = None, True
    await until(lambda: not process.leadership.is_leading)

    assert not process.n_working
    assert process.beats.look() == {}
    name.is_away = False
    await until(lambda: process.n_working)
    await process.stop()


async def test_work_that_fails_ends_the_process(name):
    async def broken(_: Pulse) -> None:
        raise ZeroDivisionError

    clock = StandingClock()
    leadership = Leadership(name.hold, {"gather": broken}, Heartbeats(clock), clock)
    with pytest.raises(ExceptionGroup):
        await leadership.run(UNHEARD)
    assert name.holder is None


async def test_senders_of_a_process_that_lost_the_name_do_not_count_as_dead(name, tmp_path):
    clock = StandingClock()
    beats = Heartbeats(clock)
    with closing(SqliteStore(tmp_path / "padwatch.sqlite3")) as store:
        deliveries = Deliveries([SHIFT], store.outbox, clock)

        async def deliver(_: Pulse) -> None:
            await deliveries.run(beats)

        leadership = Leadership(name.hold, {"deliver": deliver}, beats, clock)
        async with at_work(leadership.run(UNHEARD)):
            await until(lambda: "deliver shift" in beats.look())
            name.holder, name.is_away = None, True
            await until(lambda: not leadership.is_leading)
            assert beats.look() == {}


Begin = Callable[..., Holds]


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Begin]:
    """Begins processes that want to hold units of one plant; they let go at the end."""
    with ExitStack() as stack:

        def process(*units: str) -> Holds:
            store = stack.enter_context(closing(SqliteStore(tmp_path / "padwatch.sqlite3")))
            holds = Holds(store, list(units), SystemClock())
            stack.callback(holds.release)
            return holds

        yield process


async def waiting(holds: Holds) -> "asyncio.Task[None]":
    """Let a process wait for its units."""
    taking = asyncio.create_task(holds.take())
    while holds.waits_for in (None, "not started"):
        await asyncio.sleep(0.01)
    return taking


async def test_a_second_process_stands_by_until_the_first_one_ends(begin):
    first, second = begin("U1", "U2"), begin("U1", "U2")
    await first.take()
    assert first.waits_for is None
    first.require()
    taking = await waiting(second)
    assert "held by another padwatch" in (second.waits_for or "")
    assert not taking.done()
    first.release()
    await asyncio.wait_for(taking, 30.0)
    assert second.waits_for is None


async def test_shares_that_overlap_take_all_their_units_or_none(begin):
    first, second, third = begin("U2"), begin("U1", "U2"), begin("U1")
    await first.take()
    taking = await waiting(second)
    await asyncio.wait_for(third.take(), 30.0)  # U1 is not kept by who waits for U2
    taking.cancel()
    await asyncio.wait([taking])


class Lost:
    """A name that is held no more."""

    is_held = False


async def test_who_has_lost_a_name_stops(begin):
    holds = begin("U1")
    await holds.take()
    lost: Hold = Lost()
    holds._holds = [lost]
    with pytest.raises(HoldLostError, match="another process may have taken over"):
        holds.require()


DEMO = load_plant_file(Path(__file__).parents[3] / "deploy" / "demo.toml")
UNITS = [f"U{number:02}" for number in range(1, 21)]


@pytest.mark.parametrize("n_parts", [1, 2, 3, 7, 20])
def test_every_unit_is_in_exactly_one_share_and_all_have_about_as_many(n_parts):
    shares = [Partition(number, n_parts).units(UNITS[::-1]) for number in range(1, n_parts + 1)]
    assert sorted(unit for share in shares for unit in share) == UNITS
    assert max(map(len, shares)) - min(map(len, shares)) <= 1


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "-1/2", "1/2/3", "a/b", "1/0", "99999/1"])
def test_what_is_no_share_is_refused_with_what_to_write(text):
    with pytest.raises(ValueError, match="such as 1/2"):
        Partition.of(text)


def test_a_share_without_units_is_refused():
    with pytest.raises(ValueError, match="at most 2 parts"):
        Partition(3, 3).part_of(DEMO)


def test_one_share_raises_the_alarms_that_are_of_no_unit():
    first, second = (Partition(number, 2).share_of(DEMO) for number in (1, 2))
    assert first.looks_after("U1")
    assert not first.looks_after("U2")
    assert first.looks_after("plant")
    assert first.looks_after("a unit that is there no more")
    assert second.looks_after("U2")
    assert not second.looks_after("U1")
    assert not second.looks_after("plant")


LOST = Alarm(AlarmIdentity(PLANT, "U2", "samples_lost"))


async def test_a_standing_alarm_goes_on_with_the_process_of_its_unit(
    deploy, tmp_path, stepped_clock
):
    plant = load_plant_file(deploy / "demo.toml")
    raised = replace(LOST, level=AlarmLevel.ALERT, occurrence=1)
    raised, event = changed(LOST, raised, AlarmChange.RAISED, stepped_clock.now_ns())
    with closing(SqliteStore(tmp_path / "padwatch.sqlite3")) as store:
        store.append([], [], [AlarmNews(raised, (event,))])

        async def begun(share: str) -> AlarmEngine:
            part = Partition.of(share)
            return await alarm_engine(
                part.part_of(plant),
                Origin.LIVE,
                store,
                lambda _: None,
                stepped_clock,
                look=ServiceHealth,
                part=part.share_of(plant),
            )

        standing = {
            share: [alarm.identity.id for alarm in (await begun(share)).alarms if alarm.level]
            for share in ("1/2", "2/2")
        }

    assert standing == {"1/2": [], "2/2": [LOST.identity.id]}


def test_a_replica_asks_the_process_of_the_unit():
    replica = LiveAlarms(["U1", "U2"], lambda _: True, ChatterRule())
    replica.take_stored([LOST])
    assert replica.owner(LOST.identity.id) == "U2"
