"""Whoever reads a device is heard of: hanging he is named, waiting for a lost device he is not."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import pytest

from acquisition.errors import LinkError
from core.samples.blocks import SampleBlock
from service.app.process import Host, Supervision
from service.live.status import LinkState
from service.measuring.acquirer import Acquirer
from service.measuring.live_view import LiveView
from service.measuring.sources import WatchedUnit
from service.runtime.heartbeats import PATIENCE_S, Heartbeats
from service.runtime.polls import TimedSource
from service.runtime.service_manager import ServiceManager

from .conftest import Gates


class Device:
    """A source that polls by its clock; it may be away, hang, or stop being read."""

    def __init__(self, clock: Any) -> None:
        self.clock, self.is_away, self.hangs, self.is_broken = clock, False, False, False

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        if self.is_away:
            raise LinkError("away")
        yield self._blocks()

    async def _blocks(self) -> AsyncIterator[SampleBlock]:
        while True:
            await self.clock.sleep(0.5)
            if self.hangs:
                await asyncio.Event().wait()
            if self.is_away:
                raise LinkError("away")
            if self.is_broken:
                raise asyncio.CancelledError  # a task group takes it for meant
            for never in ():
                yield never


class Plant:
    """Two units and their supervision."""

    def __init__(self, manager_socket: Any, clock: Any) -> None:
        self.gates = Gates(clock)
        self.beats, self.live = Heartbeats(self.gates), LiveView(["U1", "U2"], self.gates, 10.0)
        self.devices: dict[str, Device] = {}
        units = {name: WatchedUnit(self._source(name)) for name in ("U1", "U2")}
        acquirer = Acquirer(units, self.live, self.gates, self._publish, lambda _: None, self.beats)
        host = Host(None, self.gates, print, ServiceManager(manager_socket.environment))
        self.supervision = Supervision(host, self.beats, self.live.status, units)
        self.running = asyncio.create_task(acquirer.run())

    def _source(self, name: str) -> TimedSource:
        return TimedSource(partial(self._device, name), self.gates)

    def _device(self, name: str, clock: Any) -> Device:
        self.devices[name] = Device(clock)
        return self.devices[name]

    async def _publish(self, block: SampleBlock) -> None:
        raise AssertionError(f"these devices have no samples, and not {block}")


@pytest.fixture
async def plant(manager_socket: Any, stepped_clock: Any) -> AsyncIterator[Plant]:
    plant = Plant(manager_socket, stepped_clock)
    yield plant
    plant.running.cancel()
    await asyncio.wait([plant.running])


async def test_devices_that_are_read_or_away_keep_the_watchdog_fed(plant, manager_socket):
    for is_away in (False, True, False):
        plant.devices["U2"].is_away = is_away
        await plant.gates.pass_s(2 * PATIENCE_S)
        plant.supervision.look()

    assert plant.live.status("U2").n_failed > 10
    assert plant.beats.look() == {"acquire U1": None, "acquire U2": None}
    assert [message.get("WATCHDOG") for message in manager_socket.received] == ["1"] * 3


async def test_a_reader_that_hangs_is_named_and_starves_the_watchdog(plant, manager_socket):
    await plant.gates.pass_s(3.0)
    plant.devices["U2"].hangs = True
    await plant.gates.pass_s(PATIENCE_S + 3.0)
    plant.supervision.look()

    assert set(plant.beats.troubles) == {"acquire U2"}
    [told] = manager_socket.received
    assert "WATCHDOG" not in told
    assert told["STATUS"].startswith("acquire U2 stuck")


async def test_a_reader_that_ends_without_an_error_is_dead_not_forgotten(plant, manager_socket):
    await plant.gates.pass_s(3.0)
    plant.devices["U1"].is_broken = True
    await plant.gates.pass_s(3.0)
    plant.supervision.look()

    assert plant.beats.troubles == {"acquire U1": "has ended"}
    assert manager_socket.received == [{"STATUS": "acquire U1 has ended"}]
    assert plant.live.status("U2").state is LinkState.CONNECTING
