"""A loop that is dead or stuck is named, makes the service unready and starves the watchdog."""

import asyncio
from typing import Any

import pytest

from service.heartbeats import PATIENCE_S, Heartbeats, Pulse
from service.live import LinkState, LiveView
from service.notify import ServiceManager
from service.supervision import Supervision

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
        manager = ServiceManager(manager_socket.environment)
        self.supervision = Supervision(manager, self.beats, self.live, ["U1", "U2"], clock)
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


async def test_a_manager_hears_how_the_service_begins_and_ends(
    program: Any, manager_socket: Any
) -> None:
    program.supervision.ready()
    program.supervision.stopping()

    assert manager_socket.received == [
        {"READY": "1", "STATUS": "1 of 2 units connected"},
        {"STOPPING": "1", "STATUS": "stopping"},
    ]


async def test_the_watchdog_is_fed_while_every_loop_is_alive(
    program: Any, manager_socket: Any
) -> None:
    for _ in range(5):
        program.clock.step(0.9 * PATIENCE_S)
        for loop in program.loops.values():
            await loop.go_on()
        program.supervision.look()

    assert program.beats.troubles == {}
    assert manager_socket.received == [{"WATCHDOG": "1", "STATUS": "1 of 2 units connected"}] * 5


async def test_a_stuck_loop_is_named_and_starves_the_watchdog_until_it_goes_on(
    program: Any, manager_socket: Any
) -> None:
    program.clock.step(PATIENCE_S + 1.0)
    await program.loops["alarms"].go_on()
    program.supervision.look()

    assert program.beats.look() == {"record": "stuck: not heard of for 61 s", "alarms": None}
    assert manager_socket.received == [{"STATUS": "record stuck: not heard of for 61 s"}]

    await program.loops["record"].go_on()
    program.supervision.look()

    assert program.beats.troubles == {}
    assert [message.get("WATCHDOG") for message in manager_socket.received] == ["1"]


async def test_a_loop_that_has_ended_is_dead_however_lately_it_beat_unless_its_work_is_done(
    program: Any, manager_socket: Any
) -> None:
    program.loops["record"].ends = True
    await program.loops["record"].go_on()
    program.supervision.look()

    assert program.beats.troubles == {"record": "has ended"}
    assert manager_socket.received == [{"STATUS": "record has ended"}]

    program.beats.release("record")
    assert program.beats.look() == {"alarms": None}


async def test_a_loop_may_be_silent_for_as_long_as_it_has_said(stepped_clock: Any) -> None:
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


async def test_a_blocked_event_loop_feeds_nothing(program: Any, manager_socket: Any) -> None:
    gates, manager = Gates(program.clock), ServiceManager(manager_socket.environment)
    supervision = Supervision(manager, program.beats, program.live, ["U1", "U2"], gates)
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
