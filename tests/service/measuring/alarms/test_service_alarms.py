"""Alarms about links, the store, the service and silent units, from their causes to the store."""

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from core.alarms.alarm import PLANT, Alarm, AlarmChange, AlarmEvent, AlarmIdentity, AlarmNews
from core.alarms.operation import Acknowledge
from core.alarms.rules import UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.limits import AlarmLevel
from core.samples.gaps import SampleAccount
from service.cluster.silent_units import SILENT_AFTER_S, SilentUnits
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.live_view import LiveView
from service.measuring.recorder import Recorder
from service.measuring.service_alarms import (
    ServiceAlarms,
    ServiceHealth,
    identity_of,
    service_rules_of,
)
from service.settings.alarms import AlarmSettings
from service.store.port import AlarmQuery
from service.store.sharing import UnitRow
from service.store.sqlite import SqliteStore

SECOND = 1_000_000_000
ALERT, DANGER = AlarmLevel
NOT_STORED, LOST = "plant:store:results_not_stored", "plant:store:results_lost"
WAITING, LATE = "plant:service:blocks_waiting", "plant:service:analysis_late"


class Watched:
    """The service's own alarms, and a health that tests set."""

    def __init__(self, host: Any, *, leads: bool = True) -> None:
        self.host, self.health = host, ServiceHealth()
        self.alarms = ServiceAlarms(
            ["U1"], service_rules_of(AlarmSettings()), lambda: self.health, leads=leads
        )

    def after(self, seconds: float, **health: Any) -> list[str]:
        own = {field.name for field in fields(ServiceHealth)}
        readings = {name: health.pop(name) for name in health.keys() - own}
        self.health = ServiceHealth(readings, **health)
        self.host.step(round(seconds * SECOND))
        news = self.alarms.tick(self.host.ns)
        return [f"{e.identity.id} {e.change}" for told in news for e in told.events]


def account(n_stored: int, n_gap: int, n_repeated: int = 0) -> dict[str, Any]:
    counts = SampleAccount(n_stored=n_stored, n_gap=n_gap, n_repeated=n_repeated)
    return {"accounts": {"U1": counts}}


@pytest.fixture
def watched(host: Any) -> Watched:
    return Watched(host)


def test_a_service_in_good_health_says_nothing(watched):
    assert [watched.after(0.5, **account(10, 0)) for _ in range(100)] == [[]] * 100
    assert {alarm.identity.unit for alarm in watched.alarms.alarms} == {PLANT}
    assert all(alarm.condition.is_known for alarm in watched.alarms.alarms)


def test_a_store_that_takes_nothing_is_an_alarm_that_says_why(watched):
    assert watched.after(0.5, store_behind_s=9.0, store_error="disk full") == []
    assert watched.after(0.5, store_behind_s=11.0, store_error="disk full") == [
        f"{NOT_STORED} raised"
    ]
    assert watched.alarms.alarm(NOT_STORED).condition.reason == "disk full"
    assert watched.after(0.5) == [f"{NOT_STORED} returned"]
    watched.after(0.5, store_behind_s=60.0)
    assert "does not respond" in watched.alarms.alarm(NOT_STORED).condition.reason


def test_results_that_are_given_up_are_a_danger_for_ten_minutes(watched):
    assert watched.after(0.5, n_unstored=3) == [f"{LOST} raised"]
    alarm = watched.alarms.alarm(LOST)
    assert (alarm.level, alarm.condition.value) == (DANGER, 3.0)
    assert [watched.after(60.0, n_unstored=3) for _ in range(10)] == [[]] * 10
    assert watched.after(60.0, n_unstored=3) == [f"{LOST} returned"]
    parked = "NOT NULL constraint failed: assessment.coverage (parked in parked.jsonl)"
    watched.after(0.5, n_unstored=4, unstored_reason=parked)
    assert watched.alarms.alarm(LOST).condition.reason == parked


def test_a_queue_that_fills_is_an_alert_and_then_a_danger(watched):
    watched.after(0.0, waiting_share=0.6)
    assert watched.after(6.0, waiting_share=0.6) == [f"{WAITING} raised"]
    watched.after(0.0, waiting_share=0.95)
    assert watched.after(6.0, waiting_share=0.95) == [f"{WAITING} escalated"]


def test_a_late_analysis_and_captures_that_cannot_be_written_are_alarms(watched):
    watched.after(0.0, analysis_delay_s=6.0)
    assert watched.after(6.0, analysis_delay_s=6.0) == [f"{LATE} raised"]
    assert watched.after(0.5, analysis_delay_s=6.0, captures_error="no space left") == [
        "plant:captures:captures_not_kept raised"
    ]


def test_lost_samples_count_over_ten_minutes(watched):
    watched.after(0.5, **account(60_000, 30_000))  # lost before anybody looked
    assert watched.after(100.0, **account(120_000, 32_000)) == []
    assert watched.after(100.0, **account(180_000, 40_000)) == ["plant:U1:samples_lost raised"]
    later = [watched.after(100.0, **account(180_000 + n * 60_000, 40_000)) for n in range(1, 8)]
    assert [words for words in later if words] == [["plant:U1:samples_lost returned"]]


def test_an_alarm_about_lost_samples_goes_on_after_a_restart_for_ten_minutes(watched, host):
    watched.after(0.5, **account(60_000, 0))
    watched.after(10.0, **account(61_000, 5_000))
    again = Watched(host)
    again.alarms.restore(watched.alarms.alarms, host.ns)
    assert again.after(0.5) == []
    news = [again.after(60.0, **account(61_000 + 36_000 * n, 5_000)) for n in range(12)]
    assert [bool(words) for words in news] == [False] * 10 + [True, False]
    assert news[10][-1] == "plant:U1:samples_lost returned"


def test_a_process_that_does_not_lead_tells_of_lost_samples_of_its_units_and_of_nothing_else(host):
    watched = Watched(host, leads=False)
    assert watched.after(0.5, **account(10, 0), store_behind_s=99.0, n_unstored=7) == []
    assert watched.after(0.5, **account(10, 10), analysis_delay_s=99.0) == [
        "plant:U1:samples_lost raised"
    ]


def test_a_device_whose_samples_all_pass_for_repeated_ones_loses_them(watched):
    watched.after(0.5, **account(60_000, 0, 90_000))  # repeated before anybody looked
    assert watched.after(100.0, **account(120_000, 0, 95_000)) == []
    quiet = [watched.after(100.0, **account(180_000, 0, 95_000 + n * 60_000)) for n in range(2)]
    assert quiet == [[], []]
    assert watched.after(100.0, **account(180_000, 0, 275_000)) == ["plant:U1:samples_lost raised"]
    later = [watched.after(100.0, **account(180_000 + n * 60_000, 0, 275_000)) for n in range(1, 9)]
    assert [words for words in later if words] == [["plant:U1:samples_lost returned"]]


DELAY_S = 10.0
LINK = "U1:link:link_lost"


@pytest.mark.parametrize("set_by_s", [0.0, 7200.0, -3600.0, 0.3])
def test_a_lost_link_is_told_after_its_delay_whatever_the_clock_is_set_to(host, tools, set_by_s):
    rules = UnitRules(channel=rule_of(2.0, 4.0), link=rule_of(DELAY_S, 0.0))
    engine = AlarmEngine({"U1": UnitAlarms(tools.unit, rules)}, lambda _: None, host)
    engine.link("U1", True)
    engine.link("U1", False, "not connected")
    told: list[Any] = []
    for second in range(30):
        if second == 4:
            host.ns += round(set_by_s * SECOND)
        engine.tick()
        told.append(engine.alarm(LINK).level)
        host.step(SECOND)

    since = told.index(next(level for level in told if level is not None))
    assert since in (round(DELAY_S), round(DELAY_S) + 1)  # the second of the step may not count


@pytest.fixture
def stored(database, host, tools) -> Callable[[], tuple[Any, Any, Any]]:
    """An engine, its recorder and its store, begun anew on the same file each time."""
    path = database()

    def begin() -> tuple[AlarmEngine, Recorder, Any]:
        store = SqliteStore(path)
        uncertain = tools.uncertain(store)
        live = LiveView([], host, 30.0)
        recorder = Recorder(uncertain, live, host, path.parent)

        def look() -> ServiceHealth:
            return ServiceHealth(store_error=live.store_error, store_behind_s=recorder.behind_s)

        service = ServiceAlarms([], service_rules_of(AlarmSettings()), look)
        engine = AlarmEngine({}, recorder.put, host, service=service)
        engine.restore(store.alarms())
        return engine, recorder, (store, uncertain)

    return begin


async def test_an_alarm_about_the_store_stands_while_it_fails_and_is_stored_after_it(stored, host):
    engine, recorder, (store, uncertain) = stored()
    uncertain.fate = "refuses"
    other = Alarm(AlarmIdentity("U9", "sx", "channel_not_ok"))
    recorder.put(_findings(other))  # something that waits
    for _ in range(15):
        await recorder.flush()
        host.step(SECOND)
        engine.tick()
    alarm = engine.alarm(NOT_STORED)
    engine.operate(NOT_STORED, Acknowledge("A. Name", alarm.occurrence))
    await recorder.flush()
    assert (alarm.level, alarm.condition.reason) == (ALERT, "no space left on device")
    assert store.alarm_events(AlarmQuery(alarm=NOT_STORED)) == []

    uncertain.fate = "writes"
    await recorder.flush()
    host.step(SECOND)
    engine.tick()
    await recorder.flush()

    events = [each.event.change for each in store.alarm_events(AlarmQuery(alarm=NOT_STORED))]
    assert events[::-1] == ["raised", "acknowledged", "returned"]
    store.close()


def _findings(alarm: Alarm) -> Any:
    event = AlarmEvent(
        alarm.identity, 1, AlarmChange.COMMENTED, None, alarm.state, alarm.state, 0, 0
    )
    return [AlarmNews(replace(alarm, n_events=1), [event])]


async def test_news_that_comes_during_a_write_is_stored_without_any_news_after_it(stored):
    _, recorder, (store, uncertain) = stored()
    uncertain.fate = "waits"
    recording = asyncio.create_task(recorder.run())
    first, second = (
        Alarm(AlarmIdentity("U9", channel, "channel_not_ok")) for channel in ("sx", "sy")
    )
    recorder.put(_findings(first))
    await asyncio.to_thread(uncertain.is_asked.wait, 30)
    recorder.put(_findings(second))
    uncertain.may_write.set()
    async with asyncio.timeout(30):
        await recorder.settled()
    recording.cancel()

    stored_ids = {alarm.identity.id for alarm in store.alarms()}
    assert stored_ids == {first.identity.id, second.identity.id}
    store.close()


async def test_alarms_of_a_unit_that_is_gone_stay_until_somebody_has_seen_them(stored):
    engine, recorder, (store, _) = stored()
    gone = AlarmIdentity("U9", "sx", "channel_not_ok")
    lost = Alarm(gone, level=ALERT, occurrence=1, is_acknowledged=False, raised_ns=0, n_events=1)
    before = Alarm(gone).state
    raised = AlarmEvent(gone, 1, AlarmChange.RAISED, ALERT, before, lost.state, 0, 1)
    store.append([], [], [AlarmNews(lost, [raised])])
    store.close()

    engine, recorder, (store, _) = stored()
    assert engine.alarm(gone.id).state == "returned_unacknowledged"
    engine.operate(gone.id, Acknowledge("A. Name", 1))
    await recorder.flush()
    store.close()

    engine, recorder, (store, _) = stored()
    with pytest.raises(LookupError):
        engine.alarm(gone.id)
    store.close()


REPORT = UnitRow("U1", 1, 0, "signs", 1, b"state")
GONE = identity_of("U2").id
NOWHERE = Path("nowhere")


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


async def test_a_unit_of_which_reports_cease_is_one_until_they_come_again(store, host):
    leader = Process(store, host)
    await leader.after(5, "U1", "U2")
    assert await leader.after(SILENT_AFTER_S - 1, "U1") == []
    assert await leader.after(3, "U1") == [GONE]
    assert "padwatch analyse" in str(leader.stored(GONE).condition.reason)
    assert await leader.after(2, "U1", "U2") == []


async def test_a_unit_that_nobody_ever_analysed_is_one(store, host):
    assert await Process(store, host).after(SILENT_AFTER_S + 3, "U1") == [GONE]


async def test_the_next_leader_goes_on_with_the_alarm_and_does_not_clear_or_double_it(store, host):
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


async def test_a_clock_of_another_host_decides_nothing(store, host):
    leader = Process(store, host)
    found = [await leader.after(1, "U1", "U2") for _ in range(100)]
    assert all(beat.beat_ns == 0 for beat in store.unit_states.beats())
    assert found == [[]] * 100
