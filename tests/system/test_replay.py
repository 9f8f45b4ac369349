"""Recorded runs through the whole service: straight, and through a DAQ over each real wire."""

import asyncio
import hashlib
import json
import math
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

RECORDINGS = Path(__file__).parents[1] / "recordings"
RUNS = {"U1": "part_load", "U2": "full_load"}
YEAR = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}
N_ALARM_EVENTS = 3
LONGEST_RUN_S = 100.0
MOST_QUANTITIES = 40
WIRES = ["modbus_tcp", "modbus_rtu", "can", "can_fd"]

pytestmark = pytest.mark.long


def known(unit: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((RECORDINGS / f"{RUNS[unit]}.known.json").read_text())
    return found


async def played(start: Callable, *options: str, runs: tuple[str, ...] = tuple(RUNS)) -> Any:
    """A service that has played the runs to their end."""
    folders = [str(RECORDINGS / RUNS[unit]) for unit in runs]
    plant = ("--plant", str(RECORDINGS / "plant.toml"))
    program = await start("replay", *folders, *plant, "--serve", *options)
    await program.wait_for_url()

    def all_ended(units: list[dict[str, Any]]) -> bool:
        return all(unit["source"]["state"] == "ended" for unit in units)

    await program.until("/api/v1/units", all_ended, within_s=LONGEST_RUN_S)
    return program


async def trends(program: Any, unit: str) -> dict[str, Any]:
    """All quantities of a unit's bearing, once all results are on the disk."""
    last_s = known(unit)["time_ns"][-1] / 1_000_000_000
    names = list(known(unit)["series"])
    parts = [
        await program.until(
            f"/api/v1/units/{unit}/bearings/UJB/trends",
            lambda answer: last_s in answer["time"],
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


def bits(answer: dict[str, Any]) -> str:
    """A digest that is equal only for the same numbers to the last bit."""
    return hashlib.sha256(json.dumps(answer, sort_keys=True).encode()).hexdigest()


async def test_a_replayed_run_gives_the_known_trends_over_http(start: Callable) -> None:
    program = await played(start, "--speed", "0")
    for unit in RUNS:
        answer, expected = await trends(program, unit), known(unit)
        # between results that are far apart the API says that there is a hole
        known_s = [ns / 1_000_000_000 for ns in expected["time_ns"]]
        assert [t for t in answer["time"] if t in known_s] == known_s
        rows = [answer["time"].index(t) for t in known_s]
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


async def test_the_known_stiffness_is_the_films(start: Callable) -> None:
    """The known results are judged by what was simulated, not only by themselves."""
    film_n_per_m = 0.69e9
    program = await played(start, "--speed", "0")
    answer = await trends(program, "U1")
    for name in ("dynamic_k_xx_n_per_m", "dynamic_k_yy_n_per_m"):
        usable = [value for value in answer["series"][name]["mean"] if value is not None]
        assert usable[-1] == pytest.approx(film_n_per_m, rel=0.1)


@pytest.mark.parametrize("wire", WIRES)
async def test_every_wire_gives_the_same_results_to_the_last_bit(
    start: Callable, wire: str
) -> None:
    straight = await played(start, "--speed", "0")
    over_wire = await played(start, "--speed", "0", "--through", wire)
    for unit in RUNS:
        assert bits(await trends(over_wire, unit)) == bits(await trends(straight, unit))
        path = f"/api/v1/units/{unit}/gaps"
        assert await over_wire.get(path, **YEAR) == await straight.get(path, **YEAR)
    events = await alarm_events(straight)
    assert await alarm_events(over_wire) == events
    assert [(event["alarm"], event["change"]) for event in events] == [
        ("U1:ujb_shaft_y:channel_not_ok", "raised"),
        ("U1:ujb_shaft_y:channel_not_ok", "returned"),
        ("U2:ujb_shaft_x:channel_not_ok", "raised"),
    ]


@pytest.mark.parametrize("speed", ["1", "50"])
async def test_a_run_gives_the_same_results_at_any_speed(start: Callable, speed: str) -> None:
    unpaced = await played(start, "--speed", "0", runs=("U2",))
    paced = await played(start, "--speed", speed, runs=("U2",))
    assert bits(await trends(paced, "U2")) == bits(await trends(unpaced, "U2"))


async def test_a_replay_says_so_and_stays_apart_from_the_live_plant(
    start: Callable, tmp_path: Path
) -> None:
    program = await played(start, "--speed", "0", "--out", str(tmp_path / "again"))
    overview = await program.get("/api/v1/overview")
    assert overview["plant"]["origin"] == "replay"
    await program.end()

    text = (RECORDINGS / "plant.toml").read_text().replace("port = 0", "port = 502")
    live = tmp_path / "live.toml"
    live.write_text(text.replace("[analysis]", '[service]\ndata_folder = "again"\n\n[analysis]'))
    refused = await start("run", str(live), "--port", "0")
    assert await refused.process.wait() == 1
    await refused.end()
    assert "holds replay results and is not opened for live ones" in refused.errors


async def test_a_replay_that_only_shall_be_stored_ends_by_itself_and_is_not_mixed_with_another(
    start: Callable, tmp_path: Path
) -> None:
    program = await start(
        *("replay", str(RECORDINGS / "full_load"), "--plant", str(RECORDINGS / "plant.toml")),
        *("--speed", "0", "--out", "results", "--json"),
    )
    output = (await program.process.stdout.read()).decode().splitlines()
    assert await program.process.wait() == 0
    assert json.loads(output[-1]) == {"database": "results/padwatch.sqlite3"}
    assert (tmp_path / "results" / "padwatch.sqlite3").exists()

    again = await start(
        *("replay", str(RECORDINGS / "full_load"), "--plant", str(RECORDINGS / "plant.toml")),
        *("--speed", "0", "--out", "results"),
    )
    assert await again.process.wait() == 1
    await again.end()
    assert "holds results already; a replay needs a folder of its own" in again.errors


async def test_a_replay_whose_daq_is_killed_ends_and_says_that_results_are_incomplete(
    start: Callable, children: Callable
) -> None:
    program = await start(
        *("replay", str(RECORDINGS / "full_load"), "--plant", str(RECORDINGS / "plant.toml")),
        *("--speed", "1", "--through", "modbus_tcp", "--out", "results"),
    )
    await program.wait_for_url()
    [daq] = children(program.pid)
    os.kill(daq, signal.SIGKILL)
    async with asyncio.timeout(LONGEST_RUN_S):
        assert await program.process.wait() == 1
    await program.end()
    assert "ended before its recordings did: results are incomplete" in program.errors
