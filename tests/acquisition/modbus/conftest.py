"""A device that lies: a raw Modbus TCP server that spoils its replies on demand."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable

import pytest

from acquisition.clock import SystemClock
from acquisition.daq.register_memory import RegisterMemory
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.modbus.link import ModbusLink
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.modbus.transport import LinkSettings, TcpTransport
from core.blocks import SampleBlock

HONEST_REQUEST_BYTES = 12


class HostileServer:
    """Answers reads from a memory; after `n_honest` more replies the lie takes over.

    A lie gets request, right reply and the stream, and sends what it likes.
    """

    def __init__(self, memory: RegisterMemory) -> None:
        self.port = 0
        self.lie: Callable | None = None
        self.n_honest = 0
        self.requests: list[bytes] = []
        self._memory = memory
        self._tasks: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> "HostileServer":
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._server.wait_closed()

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        self._tasks.add(task)
        try:
            await self._answer(reader, writer)
        except (asyncio.IncompleteReadError, ConnectionError, asyncio.CancelledError):
            pass
        finally:
            self._tasks.discard(task)
            writer.close()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while True:
            request = await reader.readexactly(HONEST_REQUEST_BYTES)
            self.requests.append(request)
            address, count = (int.from_bytes(request[i : i + 2], "big") for i in (8, 10))
            data = self._memory.read(address, count)
            body = request[6:8] + bytes([len(data)]) + data
            reply = request[:4] + len(body).to_bytes(2, "big") + body
            self.n_honest -= 1
            if self.lie is None or self.n_honest >= 0:
                writer.write(reply)
            else:
                await self.lie(request, reply, writer)
            await writer.drain()


async def blocks_until(stream, stop_index: int) -> list[SampleBlock]:
    """Blocks up to the one that ends at an index."""
    blocks = [await anext(stream)]
    while blocks[-1].stop_index != stop_index:
        blocks.append(await anext(stream))
    return blocks


@pytest.fixture
def read_until() -> Callable[..., Awaitable[list[SampleBlock]]]:
    """Takes blocks of a stream up to the one that ends at an index."""
    return blocks_until


@pytest.fixture(params=[1, 2], ids=["v1", "v2"])
def version(request) -> int:
    """Both versions of the block-ring profile."""
    return request.param


@pytest.fixture
def device(counting_feed, version) -> RingDevice:
    """Three channels of 50 samples: a slot takes two reads."""
    return RingDevice(
        counting_feed(n_channels=3), settings=RingDeviceSettings(n_slots=8, version=version)
    )


@pytest.fixture
async def server(device) -> AsyncIterator[ModbusRingServer]:
    async with ModbusRingServer(device) as server:
        yield server


@pytest.fixture
async def hostile(device) -> AsyncIterator[HostileServer]:
    async with HostileServer(device.memory) as server:
        yield server


@pytest.fixture
def link_to() -> Callable[..., ModbusLink]:
    """Builds links to a port of this machine; other settings as keywords."""

    def build(port: int, host: str = "127.0.0.1", **settings) -> ModbusLink:
        return ModbusLink(LinkSettings(transport=TcpTransport(host=host, port=port), **settings))

    return build


@pytest.fixture
def source_at(counts_calibration) -> Callable[..., ModbusRingSource]:
    """Builds sources for a port; other settings as keywords."""

    def build(port: int, clock=None, calibration=None, **settings) -> ModbusRingSource:
        settings = {"poll_period_s": 0.001, "timeout_s": 5.0} | settings
        return ModbusRingSource(
            ModbusRingSettings(transport=TcpTransport(host="127.0.0.1", port=port), **settings),
            calibration or counts_calibration(n_channels=3),
            clock or SystemClock(),
        )

    return build
