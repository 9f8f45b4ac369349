"""A revision changes whenever an answer may change, and never because only time has passed."""

from dataclasses import replace
from typing import Any

import pytest

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmState
from core.alarms.statistics import ChatterRule
from service.live.alarm_list import LiveAlarms
from service.live.current_state import SILENT_AFTER_S, LiveUnits
from service.live.snapshot import UnitLink, UnitSnapshot, link_document, link_of_document
from service.live.status import LinkState, StoredResults, UnitStatus
from service.measuring.snapshots import bearing_snapshot

STALE_AFTER_S = 30.0
CONNECTED = UnitStatus(LinkState.CONNECTED, since_ns=1)


@pytest.fixture
def live(stepped_clock: Any) -> LiveUnits:
    return LiveUnits(["U1"], stepped_clock, STALE_AFTER_S)


class Reports:
    """Reports of a measuring process with a steady clock of its own."""

    def __init__(self, live: LiveUnits, clock: Any, process: str = "one") -> None:
        self._live, self._clock, self._process = live, clock, process
        self._n = 0

    def send(
        self,
        age_s: float | None = None,
        status: UnitStatus = CONNECTED,
        stored: StoredResults | None = None,
    ) -> None:
        self._n += 1
        said_s = self._clock.monotonic_s() + 3600.0
        ages = {} if age_s is None else {"UJB": age_s}
        found = UnitLink(status, age_s, ages, said_s, stored=stored or StoredResults())
        link = link_of_document(link_document(found))
        self._live.update("U1", self._process, self._n, link, is_direct=True)


def test_a_unit_changes_with_results_links_and_staleness_but_neither_samples_nor_time(
    live, stepped_clock, assessment
):
    reports, result = Reports(live, stepped_clock), assessment()
    seen = [live.revision("U1")]

    def changes() -> bool:
        seen.append(live.revision("U1"))
        return seen[-1] > seen[-2]

    reports.send()
    assert changes()
    live.set_results("U1", {"UJB": bearing_snapshot(result)})
    reports.send(0.5)
    assert changes()
    live.set_results("U1", {"UJB": bearing_snapshot(result)})  # reported anew with an alarm
    stepped_clock.step(4.0)
    reports.send(4.5)
    assert not changes()
    stepped_clock.step(SILENT_AFTER_S + 1.0)
    assert changes(), "nothing is heard of the unit"
    reports.send(STALE_AFTER_S + 1.0)
    assert changes()
    live.set_results("U1", {"UJB": bearing_snapshot(replace(result, time_ns=2))})
    reports.send(0.5)
    assert changes()
    reports.send(0.5, UnitStatus(LinkState.NOT_CONNECTED, "cut"))
    assert changes()
    reports.send(0.5, UnitStatus(LinkState.NOT_CONNECTED, "cut"))
    assert not changes()
    reports.send(0.5, replace(CONNECTED, since_ns=2))
    assert changes()


def test_a_result_keeps_its_arrival_time_however_the_clock_is_set(live, stepped_clock, assessment):
    reports = Reports(live, stepped_clock)
    live.set_results("U1", {"UJB": bearing_snapshot(assessment())})
    reports.send(2.0)
    arrived_ns = live.current("U1", "UJB").received_ns
    assert arrived_ns == stepped_clock.now_ns() - 2_000_000_000

    stepped_clock.step(1.0)
    reports.send(3.25)  # as if the report had taken longer

    assert live.current("U1", "UJB").received_ns == arrived_ns
    assert live.status("U1").received_ns == stepped_clock.now_ns() - 3_250_000_000


def test_stored_results_are_known_by_the_process_that_has_written_them(live, stepped_clock):
    def end(process: str, n_writes: int, newest_ns: int) -> tuple[object, object]:
        stored = StoredResults(n_writes, newest_ns)
        Reports(live, stepped_clock, process).send(stored=stored)
        return live.past_revision("U1", 50), live.past_revision("U1", 500)

    first, first_open = end("one", 7, 100)
    second, second_open = end("two", 7, 0)  # another process takes over and counts from zero
    assert first != second
    assert first_open != second_open
    third, third_open = end("three", 7, 100)
    assert third == first, "what is older than the newest result does not change"
    assert third_open not in (first_open, second_open)
    stepped_clock.step(SILENT_AFTER_S + 1.0)
    assert live.past_revision("U1", 500) != third_open, "a killed process may have stored more"
    stepped_clock.step(3600.0)
    assert live.past_revision("U1", 50) != third, "retention has deleted results"


def test_the_alarm_list_changes_with_what_it_shows_and_not_with_every_result():
    alive = {"U1"}
    alarms = LiveAlarms(["U1"], alive.__contains__, ChatterRule())
    quiet, loud = (Alarm(AlarmIdentity("U1", name, "channel_not_ok")) for name in ("x", "y"))
    loud = replace(loud, is_acknowledged=False, n_events=1)
    assert loud.state is not AlarmState.NORMAL
    ids = frozenset({quiet.identity.id, loud.identity.id})
    snapshot = UnitSnapshot({}, (quiet, loud), ids, frozenset(), {}, {})
    alarms.take("U1", snapshot)
    seen = [alarms.revision]

    def changes() -> bool:
        seen.append(alarms.revision)
        return seen[-1] > seen[-2]

    assert list(alarms.shown) == [loud]
    alarms.take("U1", replace(snapshot, alarms=(replace(quiet, n_events=5), loud)))
    assert not changes()
    alarms.take("U1", replace(snapshot, chattering=frozenset({loud.identity.id})))
    assert changes()
    alarms.take("U1", replace(snapshot, judged=frozenset({loud.identity.id})))
    assert changes()
    assert alarms.count().n_unjudged == 1
    alarms.take("U1", snapshot)
    assert changes()
    alive.clear()
    assert changes()
    assert len(alarms.shown) == 2
    alarms.take_stored([replace(loud, is_acknowledged=True, n_events=9)])
    assert changes()
