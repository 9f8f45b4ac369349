"""References from the store on their way to the monitors, while the service runs."""

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import structlog

from acquisition.clock import Clock
from core.machine import Bearing, Channel, Measurand, Unit
from core.monitor import UnitMonitor
from core.settings import AnalysisSettings
from service.references import LOOK_EVERY_S, ReferencesInForce, with_reference
from service.store.gap_reference import GapReference, ReferenceSource
from service.store.port import StoreError
from service.store.sqlite import SqliteStore


def bearing_named(name: str, **more: Any) -> Bearing:
    return Bearing(name, 1e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0), **more)


def reference(bearing: str = "UJB", x_um: float = 1998.5, unit: str = "U1") -> GapReference:
    return GapReference(unit, bearing, 7, "A. Name", (x_um, 2003.1), None, ReferenceSource.GIVEN)


@pytest.fixture
def monitor() -> UnitMonitor:
    channels = tuple(Channel(id_, Measurand.GAP_UM, -1) for id_ in ("sx", "sy", "bx", "by"))
    unit = Unit("U1", 92.3, 600.0, channels, (bearing_named("UJB"), bearing_named("LJB")))
    return UnitMonitor(unit, AnalysisSettings())


@pytest.fixture
def store(tmp_path: Path) -> Iterator[SqliteStore]:
    opened = SqliteStore(tmp_path / "padwatch.sqlite3")
    yield opened
    opened.close()


@pytest.fixture
def in_force(monitor: UnitMonitor, store: SqliteStore, stepped_clock: Clock) -> ReferencesInForce:
    return ReferencesInForce({"U1": monitor}, store, stepped_clock)


@pytest.fixture
def logged() -> Iterator[list[Any]]:
    with structlog.testing.capture_logs() as lines:
        yield lines


def watched(monitor: UnitMonitor) -> dict[str, tuple[float, float]]:
    return {bearing.id: bearing.gap_reference_um for bearing in monitor.unit.bearings}


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(30):
        while not condition():
            await asyncio.sleep(0.001)


async def test_a_bearing_is_watched_with_the_reference_set_last(
    in_force: ReferencesInForce, monitor: UnitMonitor, store: SqliteStore
) -> None:
    store.add_reference(reference(x_um=1.0))
    store.add_reference(reference())
    await in_force.look()

    assert watched(monitor) == {"UJB": (1998.5, 2003.1), "LJB": (2000.0, 2000.0)}
    assert in_force.of("U1", "UJB") == reference()
    assert in_force.of("U1", "LJB") is None
    assert in_force.bearing("U1", "UJB").gap_reference_um == (1998.5, 2003.1)
    assert in_force.bearing("U1", "LJB").gap_reference_um == (2000.0, 2000.0)


async def test_a_reference_set_while_the_service_runs_is_taken_over_at_the_next_look_and_said_once(
    in_force: ReferencesInForce,
    monitor: UnitMonitor,
    store: SqliteStore,
    stepped_clock: Clock,
    logged: list[Any],
) -> None:
    running = asyncio.create_task(in_force.run())
    for x_um in (1990.0, 1991.0, 1992.0):
        store.add_reference(reference(x_um=x_um))
        await until(lambda x_um=x_um: watched(monitor)["UJB"][0] == x_um)
    taken_s = stepped_clock.monotonic_s()
    await until(lambda: stepped_clock.monotonic_s() >= taken_s + 3 * LOOK_EVERY_S)  # nothing new
    running.cancel()
    await asyncio.wait([running])

    assert stepped_clock.monotonic_s() % LOOK_EVERY_S == 0.0
    assert LOOK_EVERY_S <= 5.0
    assert [line["event"] for line in logged] == ["reference taken over"] * 3
    assert logged[0]["gap_reference_um"] == (1990.0, 2003.1)


async def test_a_reference_of_a_bearing_that_is_gone_is_ignored_and_said_once(
    in_force: ReferencesInForce, monitor: UnitMonitor, store: SqliteStore, logged: list[Any]
) -> None:
    store.add_reference(reference("TJB"))
    store.add_reference(reference(unit="U9"))
    store.add_reference(reference())
    for _ in range(3):
        await in_force.look()

    ignored = [line for line in logged if line["log_level"] == "warning"]
    assert [(line["unit"], line["bearing"]) for line in ignored] == [("U1", "TJB"), ("U9", "UJB")]
    assert watched(monitor)["UJB"] == (1998.5, 2003.1)


async def test_while_the_store_cannot_be_read_the_references_stay(
    in_force: ReferencesInForce,
    monitor: UnitMonitor,
    store: SqliteStore,
    tmp_path: Path,
    logged: list[Any],
) -> None:
    store.add_reference(reference())
    await in_force.look()
    path, away = tmp_path / "padwatch.sqlite3", tmp_path / "away"
    path.rename(away)
    with pytest.raises(StoreError):
        store.references()
    for _ in range(3):
        await in_force.look()
    assert watched(monitor)["UJB"] == (1998.5, 2003.1)

    away.rename(path)
    store.add_reference(reference(x_um=1990.0))
    await in_force.look()

    assert watched(monitor)["UJB"] == (1990.0, 2003.1)
    assert [line["log_level"] for line in logged] == ["info", "error", "info", "info"]


def test_opposite_gaps_are_taken_over_where_there_are_such_gaps_and_such_probes() -> None:
    both = GapReference("U1", "UJB", 7, "A. Name", (1e3, 2e3), (3e3, 4e3), ReferenceSource.MEASURED)
    four = bearing_named(
        "UJB", opposite_x="fx", opposite_y="fy", opposite_reference_um=(1.9e3, 2e3)
    )

    assert with_reference(four, reference()).opposite_reference_um == (1.9e3, 2e3)
    assert with_reference(four, reference()).gap_reference_um == (1998.5, 2003.1)
    assert with_reference(four, both).opposite_reference_um == (3e3, 4e3)
    assert with_reference(bearing_named("UJB"), both).opposite_reference_um is None
