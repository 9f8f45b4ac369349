"""`padwatch demo` with its simulated past, and what a simulated DAQ answers to its user."""

import asyncio
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from socket import create_server, socket

import numpy as np
import pytest
from rigs.command_line import padwatch

from acquisition.errors import LinkError
from core.baseline.history import StiffnessHistory
from core.change.decision import JUDGED, Verdict
from core.machine.unit import Estimator
from core.units import NS_PER_S
from service.app.simulated_daq import execute_command, run_daq
from service.cli import processes as demo
from service.cli.daq import FastClock, RunningDaq, held_lines
from service.cli.offline.demo_history import fill, without_past
from service.measuring.simulated_sources import simulated_history
from service.settings.plant import PlantFile, load_plant_file
from service.store.baselines import versions_after
from service.store.film_readings import FilmQuery
from service.store.port import TrendQuery
from service.store.sqlite import SqliteStore

PORTS = {"U1": 5021, "U2": 5022}
PAST_YEARS = 0.2
"""Of which a baseline is learned."""

Begun = list[tuple[PlantFile, int]]


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> Begun:
    """Plants that would be run, each with its port, beside a DAQ that is not there."""
    found: Begun = []
    daq = RunningDaq({unit: {"port": port} for unit, port in PORTS.items()}, {})
    monkeypatch.setattr("service.cli.daq.daq_process", lambda _: nullcontext(daq))

    def run(plant: PlantFile, listener: socket, *, is_demo: bool) -> None:
        assert is_demo
        found.append((plant, listener.getsockname()[1]))

    monkeypatch.setattr(demo, "run_plant", run)
    past = partial(simulated_history, years=PAST_YEARS)
    monkeypatch.setattr("service.measuring.simulated_sources.simulated_history", past)
    return found


def test_a_port_in_use_is_reported_before_a_year_is_simulated(begun, tmp_path):
    with create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = padwatch("demo", "--port", port, "--data-folder", tmp_path)

    assert (done.exit_code, done.stdout, begun) == (1, "", [])
    assert done.stderr.endswith(
        f"use another port: --port {port + 1}, or make run PORT={port + 1}\n"
    )


def test_a_plain_demo_has_no_past(begun, tmp_path):
    done = padwatch("demo", "--plain", "--port", 0, "--data-folder", tmp_path)

    assert (done.exit_code, len(begun)) == (0, 1), done.output
    assert begun[0][0].service.data_folder == str(tmp_path)
    assert not list(tmp_path.iterdir())


NOW_NS = 1_794_657_615 * NS_PER_S
YEARS = 0.3
K = "stiffness_xx_n_per_m"


@pytest.fixture(scope="module")
def plant() -> PlantFile:
    return load_plant_file(Path(__file__).parents[3] / "deploy" / "demo-life.toml")


@pytest.fixture(scope="module")
def pasts(plant: PlantFile) -> Mapping[str, Mapping[str, StiffnessHistory]]:
    return {"U1": simulated_history(plant.unit[0], NOW_NS, YEARS)}


@pytest.fixture(scope="module")
def store(tmp_path_factory, plant, pasts) -> Iterator[SqliteStore]:
    opened = SqliteStore(tmp_path_factory.mktemp("demo") / "padwatch.sqlite3")
    assert [unit.id for unit in without_past(opened.films, plant)] == ["U1", "U2"]
    fill(opened.films, plant, pasts, NOW_NS)
    yield opened
    opened.close()


@pytest.mark.long
def test_the_past_is_there_marked_and_judged(store, pasts):
    for bearing, past in pasts["U1"].items():
        found = store.films.history(FilmQuery("U1", bearing, Estimator.DYNAMIC))
        np.testing.assert_array_equal(found.history.ln_k, past.ln_k)
        assert found.is_simulated.all()
        assert store.films.past_end_ns("U1", bearing) == past.time_ns[-1]
        settled = found.verdict[:, found.is_settled]
        assert np.mean(np.isin(settled, [int(v) for v in JUDGED])) > 0.8
        assert set(np.unique(found.verdict[:, ~found.is_settled])) <= {Verdict.TRANSIENT}
        assert np.nanstd(found.deviation) < 0.05
    assert store.films.past_end_ns("U2", "UJB") is None


@pytest.mark.long
def test_trends_show_the_past(store, pasts):
    past = pasts["U1"]["UJB"]
    asked = TrendQuery("U1", "UJB", (K, "power_mw"), 0, NOW_NS, 10**6, 10**12)
    trend = store.trend(asked)
    shown = np.array([np.nan if k is None else k for k in trend.series[K].mean])
    there = np.isin(np.array(trend.time_ns), past.time_ns)  # between them, holes
    np.testing.assert_array_equal(shown[there], np.exp(past.ln_k[0]))


@pytest.mark.long
def test_a_past_is_given_once_with_a_baseline_that_says_where_it_comes_from(store, plant, pasts):
    fill(store.films, plant, pasts, NOW_NS + 10**15)
    assert [unit.id for unit in without_past(store.films, plant)] == ["U2"]
    assert versions_after(store.films.steps("U1", "LJB")).in_force == 1
    [entry] = store.films.baselines("U1", "LJB")
    assert (entry.author, entry.event) == ("padwatch demo", "learned from a simulated year")
    assert set(store.films.responses()) == {"U1"}


class Device:
    """A server that notes what it was told to do wrong."""

    def __init__(self) -> None:
        self.endpoint = {"port": 1}
        self.faults: list[tuple[str, int]] = []

    def inject(self, fault: str, count: int = 1) -> None:
        if fault not in ("drop", "tear"):
            raise LookupError(f"unknown fault {fault}; there are drop, tear")
        self.faults.append((fault, count))

    async def run(self) -> None:
        await asyncio.Event().wait()

    async def __aenter__(self) -> "Device":
        return self

    async def __aexit__(self, *_: object) -> None: ...


class Failing(Device):
    """A server whose network goes away."""

    async def run(self) -> None:
        raise LinkError("the network is unreachable")


@pytest.fixture
def devices() -> dict[str, Device]:
    return {"U1": Device(), "U2": Device()}


def test_a_fault_is_injected_where_and_as_often_as_told(devices):
    assert execute_command(devices, "U2 drop 3\n") == {"done": "U2 drop 3"}
    assert execute_command(devices, "U2 tear") == {"done": "U2 tear"}
    assert devices["U2"].faults == [("drop", 3), ("tear", 1)]
    assert devices["U1"].faults == []


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", "command must be UNIT FAULT [COUNT], got ''"),
        ("U1", "command must be UNIT FAULT [COUNT], got 'U1'"),
        ("U1 drop three", "command must be UNIT FAULT [COUNT], got 'U1 drop three'"),
        ("U1 drop -1", "command must be UNIT FAULT [COUNT], got 'U1 drop -1'"),
        ("U1 drop 1000001", "COUNT must be at most 1000000, got 1000001"),
        ("U1 drop 1 2", "command must be UNIT FAULT [COUNT], got 'U1 drop 1 2'"),
        ("U3 drop", "unknown unit U3; known units: U1, U2"),
        ("U1 melt", "unknown fault melt; there are drop, tear"),
    ],
)
def test_a_line_that_is_no_command_changes_nothing_and_says_why(devices, line, words):
    assert execute_command(devices, line) == {"refused": words}
    assert devices["U1"].faults == []


async def test_a_server_that_cannot_go_on_says_why_in_one_error(devices):
    told: list[str] = []
    with pytest.raises(LinkError, match="unreachable"):
        await run_daq(devices | {"U3": Failing()}, told.append, controlled=False)
    assert json.loads(told[0]) == {name: {"port": 1} for name in ("U1", "U2", "U3")}


def test_nobody_else_gets_the_name_of_a_line_whose_daq_has_ended():
    ours, theirs = os.openpty()
    name, others = os.ttyname(theirs), []
    with held_lines({"U1": {"device": name, "parity": "none"}, "U2": {"port": 502}}):
        os.close(ours)
        os.close(theirs)
        others += [os.openpty() for _ in range(3)]
        assert name not in {os.ttyname(line) for _, line in others}
        assert not os.path.exists(name)
    for ends in others:
        for end in ends:
            os.close(end)


async def test_a_fast_clock_passes_a_day_in_a_fiftieth_of_it(stepped_clock):
    clock = FastClock(stepped_clock, 50.0)
    start_ns = clock.now_ns()
    assert start_ns == stepped_clock.now_ns()

    await clock.sleep(86_400.0)

    assert stepped_clock.monotonic_s() == pytest.approx(1728.0)
    assert clock.monotonic_s() == pytest.approx(86_400.0)
    assert clock.now_ns() - start_ns == 86_400_000_000_000


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan")])
def test_a_clock_that_does_not_run_forward_is_refused(stepped_clock, speed):
    with pytest.raises(ValueError, match="speed must be above 0"):
        FastClock(stepped_clock, speed)
