"""A hundred devices that vanish and return: what they see of it, at their own sockets."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack
from typing import Any

import pytest

from acquisition.clock import SystemClock
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.modbus.transport import TcpTransport
from core.monitor import UnitMonitor
from core.settings import AnalysisSettings
from service.live import LinkState, LiveView
from service.roles.acquiring import CONNECTS_PER_S, Acquirer
from service.roles.link_news import LinkNews
from service.roles.watched_unit import WatchedUnit

from .conftest import RATE_HZ, SEGMENT, unit_named

N_DEVICES = 100
POLL_S = 0.25
PATIENCE_S = 120.0
TIMER_S = 0.01
"""By so much a timer of the event loop may be early."""


class Sockets:
    """The sockets of many devices, which may be away: then whoever connects is cut off."""

    def __init__(self, device_port: int) -> None:
        self.is_away = False
        self.connected_s: list[float] = []
        self._device_port = device_port
        self._writers: set[asyncio.StreamWriter] = set()

    def vanish(self) -> float:
        """Cut all off; return when that was, and count from there on."""
        self.is_away = True
        self.connected_s.clear()
        for writer in self._writers:
            writer.transport.abort()
        return time.monotonic()

    async def accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connected_s.append(time.monotonic())
        if self.is_away:
            writer.transport.abort()
            return
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._device_port)
        self._writers.add(writer)
        try:
            await asyncio.wait(
                [
                    asyncio.create_task(_pump(reader, far_writer)),
                    asyncio.create_task(_pump(far_reader, writer)),
                ]
            )
        finally:
            self._writers.discard(writer)


async def _pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    try:
        while data := await reader.read(65_536):
            writer.write(data)
            await writer.drain()
    except ConnectionError:
        pass
    finally:
        writer.transport.abort()


class Plant:
    """A hundred units, each with a socket of its own, before one ring that all may read."""

    def __init__(self, sockets: Sockets, ports: list[int], calibration: Callable[..., Any]) -> None:
        clock, settings = SystemClock(), AnalysisSettings(segment_samples=SEGMENT)
        units = {f"U{n}": port for n, port in enumerate(ports)}
        self.sockets, self._news = sockets, asyncio.Event()
        self._up: set[str] = set()
        watched = {
            unit: WatchedUnit(
                ModbusRingSource(
                    ModbusRingSettings(
                        transport=TcpTransport(host="127.0.0.1", port=port),
                        poll_period_s=POLL_S,
                        timeout_s=PATIENCE_S,
                        stale_after_s=PATIENCE_S,
                    ),
                    calibration(rate_hz=RATE_HZ),
                    clock,
                ),
                UnitMonitor(unit_named(unit), settings),
                retry_s=POLL_S,
            )
            for unit, port in units.items()
        }
        live = LiveView([*units, "U1"], clock, 60.0)
        self.acquirer = Acquirer(watched, live, clock, self._publish, self._tell)

    async def all_are(self, up: bool) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while len(self._up) != (N_DEVICES if up else 0):
                self._news.clear()
                await self._news.wait()

    async def _publish(self, _: object) -> None:
        await asyncio.sleep(0)

    def _tell(self, news: LinkNews) -> None:
        (self._up.add if news.state is LinkState.CONNECTED else self._up.discard)(news.unit)
        self._news.set()


@pytest.fixture
async def plant(counting_feed, counts_calibration) -> AsyncIterator[Plant]:
    device = RingDevice(counting_feed(rate_hz=RATE_HZ))
    async with AsyncExitStack() as stack:
        ring = await stack.enter_async_context(ModbusRingServer(device, SystemClock()))
        sockets, ports = Sockets(ring.port), []
        for _ in range(N_DEVICES):
            server = await asyncio.start_server(sockets.accept, "127.0.0.1", 0)
            stack.callback(server.close)
            ports.append(server.sockets[0].getsockname()[1])
        plant = Plant(sockets, ports, counts_calibration)
        running = asyncio.create_task(plant.acquirer.run())
        yield plant
        running.cancel()
        await asyncio.wait([running])
        sockets.vanish()
        while sockets._writers:
            await asyncio.sleep(0)


async def test_a_hundred_devices_that_vanish_and_return_see_no_storm_of_connections(
    plant: Plant,
) -> None:
    await plant.all_are(up=True)
    vanished_s = plant.sockets.vanish()
    await plant.all_are(up=False)
    async with asyncio.timeout(PATIENCE_S):
        while len(plant.sockets.connected_s) < 2 * N_DEVICES:
            await asyncio.sleep(POLL_S)
    n_away, plant.sockets.is_away = len(plant.sockets.connected_s), False
    await plant.all_are(up=True)

    seen_s = plant.sockets.connected_s
    for n, connected_s in enumerate(seen_s):
        assert connected_s - vanished_s >= n / CONNECTS_PER_S - TIMER_S
    assert len(seen_s) - n_away == N_DEVICES  # each of them once, and then it stayed
