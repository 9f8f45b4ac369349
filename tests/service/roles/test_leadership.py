"""The work that a plant shares is done by one process, and by the next when that is gone."""

import asyncio
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from harness.waiting import at_work, until
from rigs.standing_clock import StandingClock

from service.delivery.deliveries import Deliveries
from service.delivery.outcome import Delivered
from service.delivery.sender import Receiver
from service.heartbeats import UNHEARD, Heartbeats, Pulse
from service.roles.leadership import Leadership
from service.store.port import StoreError
from service.store.sqlite import SqliteStore


class Postman:
    """Carries everything at once."""

    async def carry(self, *_: object) -> Delivered:
        return Delivered("")


SHIFT = Receiver("shift", "webhook", "", Postman())


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


async def test_one_of_two_does_the_work(name: Name) -> None:
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


async def test_whoever_loses_the_name_stops_before_it_may_lead_again(name: Name) -> None:
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


async def test_work_that_fails_ends_the_process(name: Name) -> None:
    async def broken(_: Pulse) -> None:
        raise ZeroDivisionError

    clock = StandingClock()
    leadership = Leadership(name.hold, {"gather": broken}, Heartbeats(clock), clock)
    with pytest.raises(ExceptionGroup):
        await leadership.run(UNHEARD)
    assert name.holder is None


async def test_senders_of_a_process_that_lost_the_name_do_not_count_as_dead(
    name: Name, tmp_path: Path
) -> None:
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
