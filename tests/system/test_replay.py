"""Recorded runs through the whole service: straight, and through a DAQ over each real wire."""

import asyncio
import json
import math
import os
import re
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch, padwatch_program

from service.runtime.times import rfc3339

from .conftest import PATIENCE_S, Start, programs

RECORDINGS = Path(__file__).parents[1] / "recordings"
RUNS = {"U1": "part_load", "U2": "full_load"}
YEAR = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}
N_ALARM_EVENTS = 3
FILM_GN_PER_M = 0.69
"""Film stiffness that was simulated in both directions at part load."""
MOST_QUANTITIES = 40
WIRES = [
    "modbus_tcp",
    *(pytest.param(w, marks=pytest.mark.long) for w in ("modbus_rtu", "can", "can_fd")),
]


def known(unit: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((RECORDINGS / f"{RUNS[unit]}.known.json").read_text())
    return found


async def played(start: Start, *options: str, runs: Sequence[str] = tuple(RUNS)) -> Any:
    """A service that has played the runs to their end."""
    folders = [str(RECORDINGS / RUNS[unit]) for unit in runs]
    plant = ("--plant", str(RECORDINGS / "plant.toml"))
    program = await start("replay", *folders, *plant, "--serve", *options)
    await program.wait_for_url()

    def all_ended(units: list[dict[str, Any]]) -> bool:
        return all(unit["source"]["state"] == "ended" for unit in units)

    await program.until("/api/v1/units", all_ended)
    return program


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a service says that has played both runs without a wire."""

    async def play() -> dict[str, Any]:
        async with programs(tmp_path_factory.mktemp("straight")) as start:
            return await told(await played(start, "--speed", "0"))

    return asyncio.run(play())


async def told(program: Any) -> dict[str, Any]:
    """All that the service says of the runs: trends and gaps of each unit, alarms, the origin."""
    overview = await program.get("/api/v1/overview")
    return {
        "trends": {unit: await trends(program, unit) for unit in RUNS},
        "gaps": {unit: await program.get(f"/api/v1/units/{unit}/gaps", **YEAR) for unit in RUNS},
        "alarms": await alarm_events(program),
        "origin": overview["origin"],
    }


async def trends(program: Any, unit: str) -> dict[str, Any]:
    """All quantities of a unit's bearing, once all results are on the disk."""
    last = rfc3339(known(unit)["time_ns"][-1])
    names = list(known(unit)["series"])
    parts = [
        await program.until(
            f"/api/v1/units/{unit}/bearings/UJB/trends",
            lambda answer: last in answer["time"],
            **YEAR,
            quantity=names[first : first + MOST_QUANTITIES],
        )
        for first in range(0, len(names), MOST_QUANTITIES)
    ]
    series = {name: found for part in parts for name, found in part["series"].items()}
    return {"time": parts[0]["time"], "series": series}


async def alarm_events(program: Any) -> list[dict[str, Any]]:
    """What became of every alarm, once all of it is on the disk; units come in any order."""
    answer = await program.until(
        "/api/v1/alarms/events", lambda found: len(found["events"]) >= N_ALARM_EVENTS
    )
    events = [{k: v for k, v in event.items() if k != "id"} for event in answer["events"]]
    return sorted(events, key=lambda event: (event["alarm"], event["number"]))


def test_a_replayed_run_gives_the_known_trends_over_http(straight):
    for unit, answer in straight["trends"].items():
        expected = known(unit)
        # between results that are far apart the API says that there is a hole
        times = [*map(rfc3339, expected["time_ns"])]
        assert [t for t in answer["time"] if t in times] == times
        rows = [answer["time"].index(t) for t in times]
        for name, values in expected["series"].items():
            series = answer["series"][name]
            assert [series["worst_level"][row] for row in rows] == expected["level"][name], name
            for row, value in zip(rows, values, strict=True):
                found = series["mean"][row]
                # another machine's vector instructions may round the last bits otherwise
                same = found is value or math.isclose(found, value, rel_tol=1e-9, abs_tol=1e-12)
                assert same, (name, found, value)
            holes = [row for row in range(len(answer["time"])) if row not in rows]
            assert all(series["mean"][row] is None for row in holes)


def test_the_known_stiffness_is_the_films(straight):
    """The known results are judged by what was simulated, not only by themselves."""
    for name in ("dynamic_k_xx_n_per_m", "dynamic_k_yy_n_per_m"):
        mean = straight["trends"]["U1"]["series"][name]["mean"]
        usable = [value for value in mean if value is not None]
        assert usable[-1] == pytest.approx(FILM_GN_PER_M * 1e9, rel=0.1)


@pytest.mark.parametrize("wire", WIRES)
async def test_every_wire_gives_the_same_results_to_the_last_bit(start, straight, wire):
    assert await told(await played(start, "--speed", "0", "--through", wire)) == straight
    assert straight["origin"] == "replay"
    assert [(event["alarm"], event["change"]) for event in straight["alarms"]] == [
        ("U1:ujb_shaft_y:channel_not_ok", "raised"),
        ("U1:ujb_shaft_y:channel_not_ok", "returned"),
        ("U2:ujb_shaft_x:channel_not_ok", "raised"),
    ]


@pytest.mark.long
@pytest.mark.parametrize("speed", ["50", "1"])
async def test_a_run_gives_the_same_results_at_any_speed(start, straight, speed):
    paced = await played(start, "--speed", speed, runs=("U2",))
    assert await trends(paced, "U2") == straight["trends"]["U2"]


@pytest.mark.long
def test_a_replay_prints_the_stiffness_of_each_film_with_its_uncertainty(tmp_path):
    command = ("replay", RECORDINGS / "part_load", "--plant", RECORDINGS / "plant.toml")
    done = padwatch_program(*command, "--speed", "0", "--out", tmp_path / "results")

    assert done.exit_code == 0, done.stderr
    assert "padwatch: finished" in done.stdout
    for axis in ("xx", "yy"):
        line = rf"U1 UJB film stiffness {axis}: (\d\.\d{{3}}) ± (\d\.\d{{3}}) GN/m"
        found = re.search(line, done.stdout)
        assert found is not None, done.stdout
        assert abs(float(found[1]) - FILM_GN_PER_M) < float(found[2])


@pytest.mark.long
async def test_the_last_result_stays_when_a_replay_has_ended(start):
    program = await played(start, "--speed", "0", runs=("U1",))

    def is_there(latest: dict[str, Any]) -> bool:  # what was read may still be analysed
        return latest["readings"]["stiffness_xx_n_per_m"]["value"] is not None

    latest = await program.until("/api/v1/units/U1/bearings/UJB/latest", is_there)
    reading = latest["readings"]["stiffness_xx_n_per_m"]
    assert reading["value"] == pytest.approx(FILM_GN_PER_M * 1e9, rel=0.1)


def test_a_replay_that_only_shall_be_stored_ends_by_itself_and_is_mixed_with_nothing_else(tmp_path):
    plant, results = RECORDINGS / "plant.toml", tmp_path / "results"
    command = ("replay", RECORDINGS / "full_load", "--plant", plant, "--speed", "0")
    done = padwatch_program(*command, "--out", results, "--json")
    assert done.exit_code == 0, done.stderr
    database = results / "padwatch.sqlite3"
    assert json.loads(done.stdout.splitlines()[-1]) == {"database": str(database)}
    assert database.exists()

    again = padwatch(*command, "--out", results)
    assert again.exit_code == 1
    assert "contains results already; use a new folder for each replay" in again.stderr

    text = plant.read_text().replace("port = 0", "port = 502")
    live = tmp_path / "live.toml"
    service = f'[service]\ndata_folder = "{results}"\n\n[analysis]'
    live.write_text(text.replace("[analysis]", service))
    refused = padwatch("run", live, "--port", "0")
    assert refused.exit_code == 1
    assert "holds replay results and cannot be used for live ones" in refused.stderr


@pytest.mark.long
async def test_a_replay_whose_daq_is_killed_ends_and_says_results_are_incomplete(start, daq_of):
    program = await start(
        *("replay", str(RECORDINGS / "full_load"), "--plant", str(RECORDINGS / "plant.toml")),
        *("--speed", "0.1", "--through", "modbus_tcp", "--out", "results"),
    )
    await program.wait_for_url()
    daq = daq_of(program.pid)
    os.kill(daq, signal.SIGKILL)
    async with asyncio.timeout(PATIENCE_S):
        assert await program.process.wait() == 1
    await program.end()
    assert "results are incomplete: the simulated DAQ ended early" in program.errors
