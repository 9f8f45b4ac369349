"""`padwatch demo`: a plant to look at with one command, and nothing left of it afterwards."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from .conftest import Program, Start

Children = Callable[[int], list[int]]
Gone = Callable[[int], Awaitable[None]]

FILMS_N_PER_M = {"UJB": 0.69e9, "LJB": 0.37e9, "TJB": 1.5e9}
K_EFF = "order1_k_eff_xx_n_per_m"


def has_results(overview: Any) -> bool:
    return all(
        bearing["readings"][K_EFF]["value"] is not None
        for unit in overview["units"]
        for bearing in unit["bearings"]
    )


def all_are(state: str) -> Callable[[Any], bool]:
    return lambda units: all(unit["source"]["state"] == state for unit in units)


@pytest.fixture
async def demo(start: Start, tmp_path: Path) -> AsyncIterator[Program]:
    """The demonstration without a past, ready to answer."""
    before = os.umask(0o022)  # as on most computers
    program = await start("demo", "--plain", "--port", "0", "--data-folder", str(tmp_path / "data"))
    await program.wait_for_url()
    yield program
    os.umask(before)


@pytest.mark.long
async def test_the_demo_shows_the_stiffness_of_its_films(demo: Program) -> None:
    overview = await demo.until("/api/v1/overview", has_results)

    for unit in overview["units"]:
        assert unit["source"]["state"] == "connected"
        for bearing in unit["bearings"]:
            film = FILMS_N_PER_M[bearing["bearing"]]
            assert bearing["readings"][K_EFF]["value"] == pytest.approx(film, rel=0.3)
    trend = await demo.get(
        "/api/v1/units/U1/bearings/UJB/trends",
        quantity=K_EFF,
        start="2000-01-01T00:00:00Z",
        end="2200-01-01T00:00:00Z",
    )
    first = overview["units"][0]["bearings"][0]["readings"][K_EFF]["value"]
    assert first in trend["series"][K_EFF]["mean"]
    assert await demo.end(signal.SIGTERM) == 0
    assert demo.errors.count('"event": "connected"') >= 2
    assert '"level": "error"' not in demo.errors


async def test_the_demo_ends_with_ctrl_c_in_order_and_takes_its_daq_along(
    demo: Program, tmp_path: Path, children: Children, gone: Gone
) -> None:
    [daq] = children(demo.pid)
    while not list((tmp_path / "data").rglob("configurations")):  # kept by a task of its own
        await asyncio.sleep(0.05)
    kept = {path.name: path.stat().st_mode & 0o077 for path in (tmp_path / "data").rglob("*")}

    assert await demo.end(signal.SIGINT) == 0
    await gone(daq)

    assert "Traceback" not in demo.errors
    assert kept.keys() >= {"padwatch.sqlite3", "padwatch.sqlite3-wal", "configurations"}
    assert not any(kept.values()), "somebody else may look into it"


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
