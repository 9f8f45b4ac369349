"""References: refused with the reason, or stored and taken over while the service runs."""

from collections.abc import Iterator
from typing import Any

import pytest
import structlog
from harness.waiting import at_work, until

from acquisition.clock import Clock
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.quality import Reading, Reason, missing, uncertain
from service.live.references import LOOK_EVERY_S, ReferencesInForce, with_reference
from service.measuring.references import ReferenceRefusedError, doubts, given_gaps, measured_gaps
from service.store.port import StoredReadings, StoreError
from service.store.references import GapReference, ReferenceSource
from service.store.sqlite import SqliteStore


def bearing(name: str = "UJB", **more: Any) -> Bearing:
    return Bearing(name, 1e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0), **more)


def reference(bearing: str = "UJB", x_um: float = 1998.5, unit: str = "U1") -> GapReference:
    return GapReference(unit, bearing, 7, "A. Name", (x_um, 2003.1), None, ReferenceSource.GIVEN)


@pytest.fixture
def monitor() -> UnitMonitor:
    channels = tuple(Channel(id_, Measurand.GAP_UM, -1) for id_ in ("sx", "sy", "bx", "by"))
    unit = Unit("U1", 92.3, 600.0, channels, (bearing(), bearing("LJB")))
    return UnitMonitor(unit, AnalysisSettings())


@pytest.fixture
def in_force(monitor: UnitMonitor, store: SqliteStore, stepped_clock: Clock) -> ReferencesInForce:
    return ReferencesInForce([monitor.unit], store, stepped_clock, monitor.replace_description)


@pytest.fixture
def logged() -> Iterator[list[Any]]:
    with structlog.testing.capture_logs() as lines:
        yield lines


def watched(monitor: UnitMonitor) -> dict[str, tuple[float, float]]:
    return {bearing.id: bearing.gap_reference_um for bearing in monitor.unit.bearings}


async def test_a_bearing_is_watched_with_the_reference_set_last(in_force, monitor, store):
    store.gap_references.add(reference(x_um=1.0))
    store.gap_references.add(reference())
    await in_force.look()

    assert watched(monitor) == {"UJB": (1998.5, 2003.1), "LJB": (2000.0, 2000.0)}
    assert in_force.of("U1", "UJB") == reference()
    assert in_force.of("U1", "LJB") is None
    assert in_force.bearing("U1", "UJB").gap_reference_um == (1998.5, 2003.1)
    assert in_force.bearing("U1", "LJB").gap_reference_um == (2000.0, 2000.0)


async def test_a_reference_set_while_the_service_runs_is_taken_over_at_the_next_look_and_said_once(
    in_force, monitor, store, stepped_clock, logged
):
    async with at_work(in_force.run()):
        for x_um in (1990.0, 1991.0, 1992.0):
            store.gap_references.add(reference(x_um=x_um))
            await until(lambda x_um=x_um: watched(monitor)["UJB"][0] == x_um)
        taken_s = stepped_clock.monotonic_s()
        quiet_s = 3 * LOOK_EVERY_S
        await until(lambda: stepped_clock.monotonic_s() >= taken_s + quiet_s)  # nothing new

    assert stepped_clock.monotonic_s() % LOOK_EVERY_S == 0.0
    assert LOOK_EVERY_S <= 5.0
    assert [line["event"] for line in logged] == ["reference in force"] * 3
    assert logged[0]["gap_reference_um"] == (1990.0, 2003.1)


async def test_a_reference_of_a_bearing_that_is_gone_is_ignored_and_said_once(
    in_force, monitor, store, logged
):
    store.gap_references.add(reference("TJB"))
    store.gap_references.add(reference(unit="U9"))
    store.gap_references.add(reference())
    for _ in range(3):
        await in_force.look()

    ignored = [line for line in logged if line["log_level"] == "warning"]
    assert [(line["unit"], line["bearing"]) for line in ignored] == [("U1", "TJB"), ("U9", "UJB")]
    assert watched(monitor)["UJB"] == (1998.5, 2003.1)


async def test_references_outlast_an_unreadable_store(in_force, monitor, store, tmp_path, logged):
    store.gap_references.add(reference())
    await in_force.look()
    path, away = tmp_path / "padwatch.sqlite3", tmp_path / "away"
    path.rename(away)
    with pytest.raises(StoreError):
        store.gap_references.in_force()
    for _ in range(3):
        await in_force.look()
    assert watched(monitor)["UJB"] == (1998.5, 2003.1)

    away.rename(path)
    store.gap_references.add(reference(x_um=1990.0))
    await in_force.look()

    assert watched(monitor)["UJB"] == (1990.0, 2003.1)
    assert [line["log_level"] for line in logged] == ["info", "error", "info", "info"]


def test_opposite_gaps_are_taken_over_where_there_are_such_gaps_and_such_probes():
    both = GapReference("U1", "UJB", 7, "A. Name", (1e3, 2e3), (3e3, 4e3), ReferenceSource.MEASURED)

    assert with_reference(FOUR, reference()).opposite_reference_um == (1900.0, 1901.0)
    assert with_reference(FOUR, reference()).gap_reference_um == (1998.5, 2003.1)
    assert with_reference(FOUR, both).opposite_reference_um == (3e3, 4e3)
    assert with_reference(bearing(), both).opposite_reference_um is None


NOW = 1_767_225_600_000_000_000
MINUTE = 60_000_000_000
NONE = (None, None)


FOUR = bearing(opposite_x="fx", opposite_y="fy", opposite_reference_um=(1900.0, 1901.0))
THREE = bearing(opposite_x="fx", opposite_reference_um=(1900.0, 1901.0))


def newest(age_min: float = 1.0, **readings: Reading) -> StoredReadings:
    absent = missing(Reason.NOT_MEASURED)
    everything = {
        "gap_x_um": Reading(1998.5),
        "gap_y_um": Reading(2003.1),
        "opposite_gap_x_um": absent,
        "opposite_gap_y_um": absent,
    }
    return StoredReadings(NOW - round(age_min * MINUTE), everything | readings)


def test_as_many_gaps_are_needed_as_there_are_probes():
    assert given_gaps(bearing(), (1.0, 2.0), NONE) == ((1.0, 2.0), None)
    assert given_gaps(FOUR, (1.0, 2.0), (3.0, 4.0)) == ((1.0, 2.0), (3.0, 4.0))
    assert given_gaps(THREE, (1.0, 2.0), (3.0, None)) == ((1.0, 2.0), (3.0, 1901.0))


@pytest.mark.parametrize(
    ("of", "near", "opposite", "said"),
    [
        (bearing(), (1.0, None), NONE, "give the gaps in x and y"),
        (bearing(), (None, 1.0), NONE, "give the gaps in x and y"),
        (bearing(), NONE, NONE, "give the gaps in x and y"),
        (bearing(), (1.0, 2.0), (None, 3.0), "no opposite probe in y"),
        (FOUR, (1.0, 2.0), NONE, "an opposite probe in x; give its gap"),
        (FOUR, (1.0, 2.0), (3.0, None), "an opposite probe in y; give its gap"),
        (THREE, (1.0, 2.0), (3.0, 4.0), "no opposite probe in y"),
    ],
)
def test_gaps_that_do_not_fit_the_probes_are_refused(of, near, opposite, said):
    with pytest.raises(ReferenceRefusedError, match=said):
        given_gaps(of, near, opposite)


def test_the_newest_mean_gaps_become_the_reference_and_doubtful_ones_are_named():
    for age_min in (0.0, 9.9, -9.9):
        assert measured_gaps(bearing(), newest(age_min), NOW) == ((1998.5, 2003.1), None)
    found = newest(opposite_gap_x_um=Reading(7.0), opposite_gap_y_um=Reading(8.0))

    assert measured_gaps(FOUR, found, NOW) == ((1998.5, 2003.1), (7.0, 8.0))
    assert measured_gaps(THREE, found, NOW) == ((1998.5, 2003.1), (7.0, 1901.0))

    found = newest(gap_x_um=Reading(1998.5, uncertain(Reason.NON_STATIONARY)))

    assert measured_gaps(bearing(), found, NOW) == ((1998.5, 2003.1), None)
    assert doubts(found) == ["gap_x_um is uncertain: non_stationary"]
    assert doubts(newest()) == []


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (None, "no result is stored yet"),
        (newest(23.0), r"from 2025-12-31T23:37:00\.000Z, 23 min ago; the maximum age is 10 min"),
        (newest(10.1), "10 min ago"),
        (newest(-23.0), "23 min ahead of this computer's clock"),
        (newest(gap_y_um=missing(Reason.SENSOR_FAILURE)), "gap_y_um .* no value .sensor_failure"),
        (StoredReadings(NOW, {"gap_y_um": Reading(1.0)}), "has no gap_x_um"),
    ],
)
def test_gaps_that_are_old_or_unusable_are_refused(found, said):
    with pytest.raises(ReferenceRefusedError, match=said):
        measured_gaps(bearing(), found, NOW)
    with pytest.raises(ReferenceRefusedError, match=r"opposite_gap_y_um .*not_measured"):
        measured_gaps(FOUR, newest(opposite_gap_x_um=Reading(7.0)), NOW)
