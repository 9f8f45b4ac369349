"""Small rings, honest and hostile, and the sources and links that read them."""

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

import pytest
from rigs.hostile_modbus import HostileLine, HostileServer
from rigs.modbus import transport_of
from rigs.polled import CALIBRATION, Follower, device_of, map_of

from acquisition.clock import SystemClock
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.polled_source import PolledSettings, PolledSource
from acquisition.modbus.register_map import RegisterMap
from acquisition.modbus.ring_source import RingSettings, RingSource
from acquisition.modbus.transport import LinkSettings, SerialTransport, TcpTransport
from acquisition.simulated.devices.map_device import MapDevice
from acquisition.simulated.devices.modbus_device import RegisterMemory
from acquisition.simulated.devices.modbus_links import ModbusRtuServer, ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from core.samples.blocks import SampleBlock


@pytest.fixture
def read_until() -> Callable[..., Awaitable[list[SampleBlock]]]:
    """Takes blocks of a stream up to the one that ends at an index."""

    async def take(stream, stop_index: int) -> list[SampleBlock]:
        blocks = [await anext(stream)]
        while blocks[-1].stop_index != stop_index:
            blocks.append(await anext(stream))
        return blocks

    return take


@pytest.fixture
def device(counting_feed) -> RingDevice:
    """Three channels of 50 samples: a slot takes two reads."""
    return RingDevice(counting_feed(n_channels=3), settings=RingDeviceSettings(n_slots=8))


@pytest.fixture
async def server(device) -> AsyncIterator[ModbusTcpServer]:
    async with ModbusTcpServer(device) as server:
        yield server


@pytest.fixture
async def hostile(device) -> AsyncIterator[HostileServer]:
    async with HostileServer(device) as server:
        yield server


@pytest.fixture
async def hostile_line(device, tmp_path) -> AsyncIterator[HostileLine]:
    async with HostileLine(device, tmp_path / "line") as line:
        yield line


@pytest.fixture
def link_on() -> Callable[..., ModbusClient]:
    """Builds links to a serial line; other settings as keywords."""

    def build(path: object, parity: str = "none", **settings) -> ModbusClient:
        transport = SerialTransport(device=str(path), baudrate=230_400, parity=parity)
        return ModbusClient(LinkSettings(transport=transport, **settings))

    return build


@pytest.fixture
def link_to() -> Callable[..., ModbusClient]:
    """Builds links to a port of this machine; other settings as keywords."""

    def build(port: int, host: str = "127.0.0.1", **settings) -> ModbusClient:
        return ModbusClient(LinkSettings(transport=TcpTransport(host=host, port=port), **settings))

    return build


@pytest.fixture
def source_at(counts_calibration) -> Callable[..., RingSource]:
    """Builds sources for a port; other settings as keywords."""

    def build(port: int, clock=None, calibration=None, **settings) -> RingSource:
        settings = {"poll_period_s": 0.001, "timeout_s": 5.0} | settings
        return RingSource(
            RingSettings(transport=TcpTransport(host="127.0.0.1", port=port), **settings),
            calibration or counts_calibration(n_channels=3),
            clock or SystemClock(),
        )

    return build


@pytest.fixture
def plant(stepped_clock) -> Callable:
    """A device that lives on a stepped clock, and a source that polls it once a second."""

    @asynccontextmanager
    async def build(
        registers: RegisterMap | None = None, read_as: RegisterMap | None = None, **settings
    ) -> AsyncIterator[tuple[PolledSource, MapDevice, ModbusTcpServer, Follower]]:
        registers = registers or map_of()
        device = device_of(registers)
        clock = Follower(stepped_clock, device)
        async with ModbusTcpServer(device) as server:
            transport = TcpTransport(host="127.0.0.1", port=server.port)
            source = PolledSource(
                PolledSettings(transport=transport, **({"timeout_s": 5.0} | settings)),
                read_as or registers,
                ("wave",),
                CALIBRATION,
                clock,
            )
            yield source, device, server, clock

    return build


class Bench:
    """A device with some of everything that can be read."""

    def __init__(self) -> None:
        self.drained, self.faults = False, {}
        self.memory = RegisterMemory(100, 300)
        self.memory.write(100, bytes(range(200)))
        self.bits = bytes([0b1010_0101, 0b11, 0xFF] * 100)
        self.queues = {100: b"", 7: bytes(range(62)), 8: b"", 9: bytes(64)}
        self.identification = {0: b"Acme", 1: b"DAQ-12", 2: b"1.4"}

    def read_registers(self, function, address, count):  # noqa: ARG002
        return self.memory.read(address, count)

    def read_bits(self, function, address, count):
        n_bytes = -(-count // 8)
        return self.bits[address // 8 : address // 8 + n_bytes] if function == 2 else bytes(n_bytes)

    def read_fifo(self, address):
        return self.queues.get(address)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture(params=["tcp", "rtu"])
async def bench_server(request, bench):
    kind = {"tcp": ModbusTcpServer, "rtu": ModbusRtuServer}[request.param]
    async with kind(bench) as server:
        yield server


@pytest.fixture
def linked(bench_server):
    """Builds links to the bench; other settings as keywords."""
    links = []

    def build(**settings) -> ModbusClient:
        transport = transport_of(bench_server)
        links.append(
            ModbusClient(LinkSettings(transport=transport, **{"timeout_s": 0.6} | settings))
        )
        return links[-1]

    yield build
    for link in links:
        link.close()
