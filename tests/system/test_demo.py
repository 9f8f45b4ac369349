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
