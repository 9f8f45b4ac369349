"""`padwatch demo`: a plant to look at with one command, and nothing left of it afterwards."""

import os
import signal
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.calibration import calibrate
from acquisition.raw import RawBlock, RawFeed
from core.assessment import Assessment
from core.monitor import UnitMonitor
from core.units import NS_PER_S
from service.conversion import analysis_of, calibration_of, machine_of
from service.settings.loading import load_plant_file
from service.settings.units import UnitSettings
from service.wiring.simulations import simulated_feed

from .conftest import Program, Start

Children = Callable[[int], list[int]]
Gone = Callable[[int], Awaitable[None]]

FILMS_N_PER_M = {
    "U1": {"UJB": 0.69e9, "LJB": 0.37e9, "TJB": 1.5e9},
    "U2": {"UJB": 0.69e9, "LJB": 0.37e9, "TJB": 1.5e9},
}
K_EFF = "order1_k_eff_xx_n_per_m"

POLLED = ("oil_temperature_c", "power_mw")
"""Slow readings that wander: their mean depends on when the service happened to ask."""


def has_results(overview: Any) -> bool:
    return all(
        bearing["readings"][K_EFF]["value"] is not None
        for unit in overview["units"]
        for bearing in unit["bearings"]
    )


def all_are(state: str) -> Callable[[Any], bool]:
    return lambda units: all(unit["source"]["state"] == state for unit in units)


@pytest.fixture
async def demo(start: Start, tmp_path: Path) -> Program:
    """The demonstration without a past, ready to answer."""
    program = await start("demo", "--plain", "--port", "0", "--data-folder", str(tmp_path / "data"))
    await program.wait_for_url()
    return program


@pytest.mark.long
async def test_the_demo_shows_stiffness_that_the_offline_analysis_confirms_to_the_last_bit(
    demo: Program, demo_file: Path, children: Children, gone: Gone
) -> None:
    [daq] = children(demo.pid)
    overview = await demo.until("/api/v1/overview", has_results)

    plant = load_plant_file(demo_file)
    for unit, shown in zip(plant.unit, overview["units"], strict=True):
        assert shown["source"]["state"] == "connected"
        expected = offline(unit, analysis_of(plant.analysis), shown["bearings"][0]["window"])
        for bearing, assessment in zip(shown["bearings"], expected, strict=True):
            assert_same(bearing, assessment)
            film = FILMS_N_PER_M[shown["id"]][bearing["bearing"]]
            assert bearing["readings"][K_EFF]["value"] == pytest.approx(film, rel=0.3)
            spectrum = await demo.get(
                f"/api/v1/units/{unit.id}/bearings/{bearing['bearing']}/spectrum"
            )
            if spectrum["time"] == bearing["time"]:
                amplitude = assessment.spectrum.amplitude_um_pk(0).tolist()
                assert spectrum["channels"]["shaft_x"]["amplitude"] == amplitude
    trend = await demo.get(
        "/api/v1/units/U1/bearings/UJB/trends",
        quantity=K_EFF,
        start="2000-01-01T00:00:00Z",
        end="2200-01-01T00:00:00Z",
    )
    first = overview["units"][0]["bearings"][0]["readings"][K_EFF]["value"]
    assert first in trend["series"][K_EFF]["mean"]

    assert await demo.end(signal.SIGTERM) == 0
    await gone(daq)
    assert demo.errors.count("\n") == demo.errors.count('"event": "connected"') == 2


async def test_the_demo_ends_with_ctrl_c_in_order_and_takes_its_daq_along(
    demo: Program, tmp_path: Path, children: Children, gone: Gone
) -> None:
    [daq] = children(demo.pid)

    assert await demo.end(signal.SIGINT) == 0
    await gone(daq)

    assert "Traceback" not in demo.errors
    assert (tmp_path / "data" / "padwatch.sqlite3").exists()


async def test_a_service_that_is_killed_leaves_no_daq_behind(
    demo: Program, children: Children, gone: Gone
) -> None:
    [daq] = children(demo.pid)

    demo.kill()

    await gone(daq)


async def test_a_daq_that_is_killed_leaves_numbers_that_are_not_current(
    demo: Program, children: Children
) -> None:
    await demo.until("/api/v1/units", all_are("connected"))
    assert (await demo.get("/readyz"))["status"] == "ok"
    [daq] = children(demo.pid)

    os.kill(daq, signal.SIGKILL)
    units = await demo.until("/api/v1/units", all_are("not_connected"))

    for unit in units:
        assert "127.0.0.1" in unit["source"]["reason"]
        latest = await demo.get(f"/api/v1/units/{unit['id']}/bearings/UJB/latest")
        assert latest["quality"] == {"level": "bad", "reason": "not_connected"}
        assert {r["value"] for r in latest["readings"].values()} == {None}
    assert (await demo.get("/readyz"))["status"] == "ok"
    assert await demo.end(signal.SIGTERM) == 0


class OnTheWire:
    """A feed whose slow values have been through the 32-bit floats of the DAQ's registers."""

    def __init__(self, feed: RawFeed) -> None:
        self._feed = feed

    def advance(self, n_samples: int) -> RawBlock:
        raw = self._feed.advance(n_samples)
        return replace(raw, slow=tuple(float(np.float32(value)) for value in raw.slow))


class Began:
    """The clock at the moment the demo's plant began, to the second, as its epoch tells."""

    def __init__(self, epoch: int) -> None:
        self._epoch = epoch

    def now_ns(self) -> int:
        return self._epoch * NS_PER_S

    def monotonic_s(self) -> float:
        return 0.0

    async def sleep(self, duration_s: float) -> None:
        raise AssertionError(f"nobody waits {duration_s} s offline")


def offline(unit: UnitSettings, analysis: Any, window: Any) -> list[Assessment]:
    """Analyse exactly the samples of a window anew, from the simulation's seed."""
    feed = OnTheWire(simulated_feed(unit, Began(window["epoch"])))
    if window["first_index"]:
        feed.advance(window["first_index"])
    monitor, calibration = UnitMonitor(machine_of(unit), analysis), calibration_of(unit)
    found: list[Assessment] = []
    left = window["last_index"] + 1 - window["first_index"]
    while left:
        n_samples = min(left, 777)
        found += monitor.ingest(calibrate(feed.advance(n_samples), calibration))
        left -= n_samples
    return found[-len(unit.bearing) :]


def assert_same(shown: Any, expected: Assessment) -> None:
    assert shown["bearing"] == expected.bearing
    assert shown["window"]["first_index"] == expected.window.first_index
    assert shown["window"]["last_index"] == expected.window.stop_index - 1
    assert shown["window"]["n_segments"] == expected.window.n_segments
    for name, reading in expected.readings.items():
        value = shown["readings"][name]["value"]
        if name in POLLED:
            assert value == pytest.approx(reading.value, abs=1.0)
        else:
            assert value == reading.value, name
        assert shown["readings"][name]["reason"] == reading.quality.reason.value, name


@pytest.mark.long
async def test_the_demo_begins_with_a_simulated_year_and_goes_on_from_it(
    start: Start, tmp_path: Path
) -> None:
    demo = await start("demo", "--port", "0", "--data-folder", str(tmp_path / "data"))
    await demo.wait_for_url()
    year = {"start": "2020-01-01T00:00:00Z", "end": "2100-01-01T00:00:00Z", "max_points": 50}

    for unit in ("U1", "U2"):
        bearing = f"/api/v1/units/{unit}/bearings/LJB"
        found = await demo.get(f"{bearing}/film/readings", **year)
        assert set(found["provenance"]) == {"simulated"}
        baselines = await demo.get(f"{bearing}/baselines")
        assert baselines["in_force"] == 1
        film = await demo.until(f"{bearing}/film", lambda film: film["condition"] is not None)
        assert film["condition"]["is_settled"]  # as it was before the start
