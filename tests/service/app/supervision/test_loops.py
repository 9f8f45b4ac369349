"""Each loop is heard of, and what reaches a service manager's socket."""

import asyncio
import os
import socket
from typing import Any

import httpx2
import pytest
import structlog

from acquisition.clock import SystemClock
from service.app.measuring_process import run_service
from service.app.process import Host, Supervision
from service.live.status import LinkState
from service.measuring.live_view import LiveView
from service.measuring.sources import live_units
from service.runtime.heartbeats import PATIENCE_S, Heartbeats, Pulse
from service.runtime.service_manager import ServiceManager
from service.settings.plant import load_plant_file

from .conftest import Gates


class Loop:
    """A loop of the program that beats whenever it is let."""

    def __init__(self) -> None:
        self.turn, self.ends = asyncio.Event(), False
        self.n_turns = 0

    async def run(self, pulse: Pulse) -> None:
        while not self.ends:
            pulse.beat()
            self.n_turns += 1
            await self.turn.wait()
            self.turn.clear()

    async def go_on(self) -> None:
        self.turn.set()
        for _ in range(3):
            await asyncio.sleep(0)


class Program:
    """Two loops, and what supervises them."""

    def __init__(self, manager_socket: Any, clock: Any) -> None:
        self.clock, self.beats = clock, Heartbeats(clock)
        self.live = LiveView(["U1", "U2"], clock, 10.0)
        self.live.set_link("U1", LinkState.CONNECTED)
        host = Host(None, clock, print, ServiceManager(manager_socket.environment))
        self.supervision = Supervision(host, self.beats, self.live.status, ["U1", "U2"])
        self.loops = {"record": Loop(), "alarms": Loop()}
        self.tasks = [
            asyncio.create_task(self.beats.tend(name, loop.run))
            for name, loop in self.loops.items()
        ]


@pytest.fixture
async def program(manager_socket: Any, stepped_clock: Any) -> Any:
    program = Program(manager_socket, stepped_clock)
    await asyncio.sleep(0)
    yield program
    for task in program.tasks:
        task.cancel()
    await asyncio.wait(program.tasks)


async def test_a_manager_hears_how_the_service_begins_and_ends(program, manager_socket):
    program.supervision.ready()
    program.supervision.stopping()

    assert manager_socket.received == [
        {"READY": "1", "STATUS": "1 of 2 units connected"},
        {"STOPPING": "1", "STATUS": "stopping"},
    ]


async def test_the_watchdog_is_fed_while_every_loop_is_alive(program, manager_socket):
    for _ in range(5):
        program.clock.step(0.9 * PATIENCE_S)
        for loop in program.loops.values():
            await loop.go_on()
        program.supervision.look()

    assert program.beats.troubles == {}
    assert manager_socket.received == [{"WATCHDOG": "1", "STATUS": "1 of 2 units connected"}] * 5


async def test_a_stuck_loop_is_named_and_starves_the_watchdog_meanwhile(program, manager_socket):
    program.clock.step(PATIENCE_S + 1.0)
    await program.loops["alarms"].go_on()
    program.supervision.look()

    assert program.beats.look() == {"record": "stuck: no heartbeat for 61 s", "alarms": None}
    assert manager_socket.received == [{"STATUS": "record stuck: no heartbeat for 61 s"}]

    await program.loops["record"].go_on()
    program.supervision.look()

    assert program.beats.troubles == {}
    assert [message.get("WATCHDOG") for message in manager_socket.received] == ["1"]


async def test_a_loop_that_has_ended_is_dead_however_lately_it_beat_unless_its_work_is_done(
    program, manager_socket
):
    program.loops["record"].ends = True
    await program.loops["record"].go_on()
    program.supervision.look()

    assert program.beats.troubles == {"record": "has ended"}
    assert manager_socket.received == [{"STATUS": "record has ended"}]

    program.beats.release("record")
    assert program.beats.look() == {"alarms": None}


async def test_a_loop_may_be_silent_for_as_long_as_it_has_said(stepped_clock):
    beats = Heartbeats(stepped_clock)

    async def learn(pulse: Pulse) -> None:
        pulse.beat(3600.0)
        await asyncio.Event().wait()

    async def wait_for_news(pulse: Pulse) -> None:
        pulse.rest()
        await asyncio.Event().wait()

    tasks = [
        asyncio.create_task(beats.tend("learn", learn)),
        asyncio.create_task(beats.tend("captures", wait_for_news)),
    ]
    await asyncio.sleep(0)
    stepped_clock.step(3600.0 + PATIENCE_S)
    assert beats.troubles == {}
    stepped_clock.step(1.0)
    assert set(beats.troubles) == {"learn"}

    for task in tasks:
        task.cancel()
    await asyncio.wait(tasks)


async def test_a_blocked_event_loop_feeds_nothing(program, manager_socket):
    gates = Gates(program.clock)
    host = Host(None, gates, print, ServiceManager(manager_socket.environment))
    supervision = Supervision(host, program.beats, program.live.status, ["U1", "U2"])
    running = asyncio.create_task(supervision.run())
    await asyncio.sleep(0)
    assert len(manager_socket.received) == 1
    assert gates.asked_s == [5.0]  # half of what the manager allows

    gates.sleepers[-1].set_result(None)
    program.clock.step(100.0)  # the event loop does not turn all this while
    assert manager_socket.received == []

    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert [message.get("WATCHDOG") for message in manager_socket.received] == [None]
    running.cancel()
    await asyncio.wait([running])


NOT_LOOPS = {
    "report",  # of the connection to the serving process, which "serve" holds
    "run",  # only holds those that are: its end is theirs
    "announce",  # ends by itself once the server answers
    "supervise",  # whoever listens to all others; the watchdog listens to it
    "the service",
}


ENDS_WITHIN_S = 20.0


async def _lasting(tasks: set[asyncio.Task[Any]]) -> set[str]:
    """Names of tasks; of those that were given none, what runs in them, unless it soon ends."""
    named = {task for task in tasks if not task.get_name().startswith("Task-")}
    left = tasks - named
    if left:  # as of a connection that is being tried
        _, left = await asyncio.wait(left, timeout=ENDS_WITHIN_S)
    return {task.get_name() for task in named} | {str(task.get_coro()) for task in left}


async def test_every_task_of_the_program_has_a_pulse(tmp_path, plant_text, monkeypatch):
    plant = tmp_path / "plant.toml"
    text = plant_text.replace("var/demo", str(tmp_path / "data")).replace("port = 0", "port = 1")
    plant.write_text(text, encoding="utf-8")
    settings, clock = load_plant_file(plant), SystemClock()
    before, said = asyncio.all_tasks(), asyncio.Queue()
    stopped = asyncio.Event()
    monkeypatch.setattr("service.app.process.stop_on_signals", lambda: stopped)
    listener = socket.create_server(("127.0.0.1", 0))
    host, units = Host(listener, clock, said.put_nowait), live_units(settings, clock)
    service = asyncio.create_task(run_service(settings, units, host), name="the service")
    url = await asyncio.wait_for(said.get(), 60)
    async with httpx2.AsyncClient(base_url=url, trust_env=False, timeout=60.0) as client:
        answer = await client.get("/readyz")
        nested = await client.post("/api/v1/session", content=b"[" * 20_000 + b"]" * 20_000)
        foreign = await client.get("/livez", headers={"Host": "evil.example"})
    names = await _lasting(asyncio.all_tasks() - before)
    stopped.set()
    await asyncio.wait_for(service, 60)
    listener.close()

    heard = {
        name.removeprefix("loop ") for name in answer.json()["checks"] if name.startswith("loop ")
    }
    assert answer.status_code == 200, answer.text
    assert names - NOT_LOOPS <= heard
    assert heard <= names
    assert {"acquire U1", "acquire U2", "analyse", "record", "alarms", "serve"} <= heard
    assert "references" in heard
    assert (nested.status_code, foreign.status_code) == (413, 421)  # its guards are in their places


@pytest.mark.parametrize("manager_socket", ["", "\0"], ids=["path", "abstract"], indirect=True)
def test_a_manager_hears_what_it_is_told_without_line_breaks(manager_socket):
    manager = ServiceManager(manager_socket.environment)

    manager.notify(READY="1", STATUS="all well\nWATCHDOG=trigger")

    assert manager._address
    assert manager.watchdog_s == 10.0
    assert manager_socket.received == [{"READY": "1", "STATUS": "all well WATCHDOG=trigger"}]


def test_without_a_socket_nobody_is_told(monkeypatch):
    def refuse(*_: object) -> None:
        raise AssertionError("a socket was opened")

    monkeypatch.setattr(socket, "socket", refuse)
    manager = ServiceManager({"WATCHDOG_USEC": "10000000"})
    manager.notify(READY="1")

    assert not manager._address
    assert manager.watchdog_s is None


@pytest.mark.parametrize(
    "given",
    [
        {"WATCHDOG_USEC": "soon"},
        {"WATCHDOG_USEC": "0"},
        {"WATCHDOG_USEC": "-5"},
        {"WATCHDOG_USEC": "10000000", "WATCHDOG_PID": str(os.getpid() + 1)},
    ],
)
def test_a_watchdog_that_is_not_for_this_process_is_not_fed(given):
    assert ServiceManager({"NOTIFY_SOCKET": "@x", **given}).watchdog_s is None


@pytest.mark.parametrize("address", ["relative/path", "vsock:2:1234"])
def test_an_address_of_another_kind_is_not_used(address):
    with structlog.testing.capture_logs() as said:
        manager = ServiceManager({"NOTIFY_SOCKET": address})
        manager.notify(READY="1")

    assert not manager._address
    assert [entry["value"] for entry in said] == [address]


def test_a_manager_that_is_gone_is_logged_once_and_stops_nothing(tmp_path):
    manager = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "gone")})

    with structlog.testing.capture_logs() as said:
        manager.notify(WATCHDOG="1")
        manager.notify(WATCHDOG="1")

    assert [entry["event"] for entry in said] == ["the service manager cannot be reached"]


def test_a_manager_that_does_not_read_never_makes_the_service_wait(manager_socket):
    manager = ServiceManager(manager_socket.environment)

    with structlog.testing.capture_logs() as said:
        for _ in range(100_000):
            manager.notify(WATCHDOG="1")
            if said:
                break

    assert [entry["event"] for entry in said] == ["the service manager cannot be reached"]
    assert manager_socket.received
