"""The measuring process and its serving process: one ends or hangs, the other must not."""

import asyncio
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx2
import pytest

from acquisition.clock import SystemClock
from service.app import measuring_process
from service.app.serving_process import WRONG_VERSION
from service.live import exchange
from service.runtime import child
from service.runtime.heartbeats import UNHEARD
from service.settings.plant import load_plant_file
from service.settings.storage import Origin

from .conftest import SERVING, Program, Start

STORMS = Path(__file__).parents[2] / "benchmarks" / "storms.py"
PATIENCE_S = 280.0


async def demo(start: Start, folder: Path, port: int = 0) -> Program:
    """Start the demonstration without a past, and wait for its first samples."""
    where = ("--port", str(port), "--data-folder", str(folder / "data"))
    program = await start("demo", "--plain", *where)
    await program.wait_for_url()
    await program.until("/api/v1/units", are("connected"))
    return program


def are(state: str) -> Callable[[Any], bool]:
    return lambda units: all(unit["source"]["state"] == state for unit in units)


async def answers(program: Program) -> bool:
    """Whether the API answers."""
    with suppress(httpx2.TransportError):
        await program.get("/livez")
        return True
    return False


@pytest.mark.long  # tests/torture/test_serving_kills.py has the example
async def test_a_killed_serving_process_is_replaced_on_the_same_port_and_measuring_goes_on(
    start, tmp_path, serving_of
):
    program = await demo(start, tmp_path)
    first = serving_of(program.pid)

    os.kill(first, signal.SIGKILL)
    while not await answers(program):
        await asyncio.sleep(0.05)

    units = await program.until("/api/v1/units", are("connected"))
    assert serving_of(program.pid) != first
    assert [unit["source"]["n_gap"] for unit in units] == [0, 0]
    assert await program.end() == 0
    assert "the serving process has ended and is started again" in program.errors
    assert "Traceback" not in program.errors


async def test_a_measuring_process_that_hangs_leaves_nothing_shown_as_current(start, tmp_path):
    program = await demo(start, tmp_path)

    os.kill(program.pid, signal.SIGSTOP)
    try:
        units = await program.until("/api/v1/units", are("not_connected"))
        latest = await program.get("/api/v1/units/U1/bearings/UJB/latest")
    finally:
        os.kill(program.pid, signal.SIGCONT)

    assert {unit["source"]["reason"] for unit in units} == {"no process is analysing this unit"}
    assert latest["quality"]["level"] == "bad"
    assert {reading["value"] for reading in latest["readings"].values()} == {None}
    await program.until("/api/v1/units", are("connected"))


async def test_a_killed_measuring_process_ends_the_program_which_can_start_again_at_once(
    start, tmp_path, serving_of, gone
):
    program = await demo(start, tmp_path)
    serving, port = serving_of(program.pid), int(program.url.rpartition(":")[2])

    with socket.create_connection(("127.0.0.1", port)) as idle:
        idle.sendall(b"GET /api/v1/units HTTP/1.1\r\nHost: local")
        program.kill()
        again = await demo(start, tmp_path, port)

    assert await program.process.wait() == -signal.SIGKILL
    await gone(serving)
    assert again.url == program.url


async def test_a_hanging_serving_process_is_killed_and_restarted(tmp_path, demo_file, monkeypatch):
    (tmp_path / "deaf.py").write_text("import signal\nsignal.pause()\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(child, "PROGRAM", "deaf")
    monkeypatch.setattr(measuring_process, "PAUSE_S", 0.0)
    monkeypatch.setattr(measuring_process, "STOPS_WITHIN_S", 0.1)
    monkeypatch.setattr(exchange, "TAKEN_WITHIN_S", 0.1)
    plant = exchange.Start(load_plant_file(demo_file), Origin.LIVE, is_demo=False)

    async def refuse(question: exchange.Question) -> None:
        raise AssertionError(question)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        end = exchange.MeasuringEnd(lambda _: bytes(1_000_000), refuse, period_s=0.5)
        serving = measuring_process.ServingChild(plant, listener, end, SystemClock())
        running = asyncio.create_task(serving.run(UNHEARD))
        while serving.child is None:
            await asyncio.sleep(0.01)
        first = serving.child.process
        while serving.child is None or serving.child.process is first:
            await asyncio.sleep(0.01)
        assert first.returncode == -signal.SIGKILL
        last = serving.child.process
        running.cancel()
        await asyncio.wait([running])
        last.kill()
        last.wait()


def test_a_serving_process_of_another_version_is_refused_with_both_named(tmp_path):
    ours, theirs = socket.socketpair()
    with ours, theirs, socket.create_server(("127.0.0.1", 0)) as listener:
        socket.send_fds(ours, [b"."], [listener.fileno()])
        ours.sendall(struct.pack(">I", 9) + b"0.0.1\nabc")
        serving = subprocess.run(
            [sys.executable, "-m", SERVING, str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(STORMS.parents[1])},
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )

    assert serving.returncode == WRONG_VERSION
    assert "the serving process is padwatch 0.1.0" in serving.stderr
    assert "the measuring process padwatch 0.0.1: restart padwatch" in serving.stderr
    assert "Traceback" not in serving.stderr


@pytest.mark.long
@pytest.mark.parametrize(
    "storms",
    [
        pytest.param(["members"], id="members"),
        pytest.param(
            ["login", "document", "polling", "browsers", "half-open", "kills"],
            id="all",
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_storm_on_the_port_costs_no_sample(storms):
    chosen = [word for storm in storms for word in ("--storm", storm)]
    times = ("--settle", "4", "--rest", "2", "--seconds", "3")
    command = [sys.executable, str(STORMS), "--units", "1", *times, *chosen]

    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)

    assert done.returncode == 0, done.stdout + done.stderr
    assert "samples per channel lost: 0, allowed 0" in done.stdout
