"""Units that nobody analyses any more are an alarm of whoever does the shared work of a plant."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from core.alarms.alarm import Alarm
from core.alarms.operation import Acknowledge
from service.cluster.silent_units import SILENT_AFTER_S, SilentUnits
from service.live.live_view import LiveView
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.recorder import ParkedRows, Recorder
from service.measuring.reported_alarms import identity_of
from service.store.sharing import UnitReport
from service.store.sqlite import SqliteStore

SECOND = 1_000_000_000
REPORT = UnitReport("U1", 1, 0, "connected", None, None, "signs", 1, b"state")
GONE = identity_of("U2").id
NOWHERE = ParkedRows(Path("nowhere"))


class Process:
    """One that leads, over a database that others report to."""

    def __init__(self, store: SqliteStore, host: Any) -> None:
        self.store, self.host = store, host
        self.recorder = Recorder(store, LiveView([], host, 30.0), host, NOWHERE)
        self.alarms = AlarmEngine({}, self.recorder.put, host)
        self.silent = SilentUnits(["U1", "U2"], self.alarms, store, host)

    async def after(self, seconds: float, *reporting: str) -> list[str]:
        """Let seconds pass in which some units are reported on; returns the alarms that stand."""
        for _ in range(round(seconds)):
            self.host.step(SECOND)
            reports = [replace(REPORT, unit=unit, n_beats=self.host.ns) for unit in reporting]
            self.store.unit_states.report("other", reports)
            await self.silent.look()
            self.alarms.tick()
            await self.recorder.flush()
        return [alarm.identity.id for alarm in self.store.alarms() if alarm.level is not None]

    def stored(self, id_: str) -> Alarm:
        return next(alarm for alarm in self.store.alarms() if alarm.identity.id == id_)


@pytest.fixture
def store(database: Callable[[], Path]) -> Iterator[SqliteStore]:
    opened = SqliteStore(database())
    yield opened
    opened.close()


async def test_a_unit_of_which_reports_cease_is_one_until_they_come_again(
    store: SqliteStore, host: Any
) -> None:
    leader = Process(store, host)
    await leader.after(5, "U1", "U2")
    assert await leader.after(SILENT_AFTER_S - 1, "U1") == []
    assert await leader.after(3, "U1") == [GONE]
    assert "padwatch analyse" in str(leader.stored(GONE).condition.reason)
    assert await leader.after(2, "U1", "U2") == []


async def test_a_unit_that_nobody_ever_analysed_is_one(store: SqliteStore, host: Any) -> None:
    assert await Process(store, host).after(SILENT_AFTER_S + 3, "U1") == [GONE]


async def test_the_next_leader_goes_on_with_the_alarm_and_neither_clears_nor_doubles_it(
    store: SqliteStore, host: Any
) -> None:
    first = Process(store, host)
    await first.after(SILENT_AFTER_S + 3, "U1")
    first.alarms.operate(GONE, Acknowledge("A. Name", 1))
    await first.recorder.flush()
    first.silent.leave()
    assert GONE not in [alarm.identity.id for alarm in first.alarms.alarms]

    second = Process(store, host)
    assert await second.after(5, "U1") == [GONE]
    alarm = second.stored(GONE)
    assert (alarm.occurrence, alarm.is_acknowledged) == (1, True)
    assert await second.after(SILENT_AFTER_S, "U1") == [GONE]
    assert second.stored(GONE).occurrence == 1
    assert await second.after(3, "U1", "U2") == []


async def test_a_clock_of_another_host_decides_nothing(store: SqliteStore, host: Any) -> None:
    leader = Process(store, host)
    found = [await leader.after(1, "U1", "U2") for _ in range(100)]
    assert all(beat.beat_ns == 0 for beat in store.unit_states.beats())
    assert found == [[]] * 100
