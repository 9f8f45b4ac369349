"""Modbus sources other than the ring, on a counting plant: polled registers, vectors, queues."""

from contextlib import asynccontextmanager
from dataclasses import replace

import numpy as np

from acquisition.clock import SystemClock
from acquisition.modbus.cells import ByteOrder, Cell, NumberType
from acquisition.modbus.fifo_assembly import FifoKind, FifoLayout
from acquisition.modbus.fifo_source import FifoSettings, FifoSource
from acquisition.modbus.polled_source import PolledSettings, PolledSource, vector_calibration
from acquisition.modbus.register_map import FlagCheck, MapValue, Meaning, RegisterMap, Together
from acquisition.modbus.slow_values import JoinedSource, PolledSlowValues, without_slow
from acquisition.modbus.transport import TcpTransport
from acquisition.simulated.devices.fifo_device import FifoDevice
from acquisition.simulated.devices.map_device import MapDevice
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.source import SampleSource
from core.spectra.polls import VectorPart, VectorRow
from rigs.blocks import cell_block
from rigs.modbus import OnRtu, OnTcp, Rig

SLOW = ("slow0", "slow1")
VECTORS = tuple(VectorRow(f"c{n}", VectorPart.ORDER1_AMPLITUDE) for n in range(2))
STATUS = Cell(address=200)


def value(id_: str, address: int, type_: str = "float32", **settings) -> MapValue:
    cell = Cell(address=address, type=NumberType(type_), byte_order=ByteOrder.CDAB)
    return MapValue(id=id_, cell=cell, **settings)


def registers(rows) -> RegisterMap:
    """A map with a status register, a heartbeat and a block that must not be split."""
    flag = FlagCheck(cell=STATUS, mask=0x0020, set_means=Meaning.BAD)
    values = [value(id_, 101 + 4 * n, "int32", flags=(flag,)) for n, id_ in enumerate(rows)]
    values += [value(id_, 110 + 2 * n) for n, id_ in enumerate(SLOW)]
    return RegisterMap(
        values=tuple(values),
        base=1,
        together=(Together(address=101, count=14),),
        heartbeat=Cell(address=201),
    )


class _ClockedDevice(MapDevice):
    """Shows the sample that belongs to the time of the rig's clock."""

    clock = None

    def read_registers(self, function: int, address: int, count: int) -> bytes | None:
        number = int(self.clock.monotonic_s() * self._calibration.rate_hz + 1e-6)
        self.produce(number - self.newest.first_index)
        return super().read_registers(function, address, count)


class _PolledRig(Rig):
    """Time passes by the source's own waiting; while nobody is connected, by the rig."""

    keeps = False
    rows = ("c0", "c1")

    async def __aenter__(self) -> "_PolledRig":
        device = _ClockedDevice(self._feed, registers(self.rows), self.rows, self._calibration)
        device.clock = self._clock
        self._server = self._serve(device)
        await self.plug_in()
        period_s = 1.0 / self._calibration.rate_hz
        settings = PolledSettings(**self._link(), poll_period_s=period_s)
        self._source = PolledSource(
            settings, registers(self.rows), self.rows, self._source_calibration(), self._clock
        )
        self.source = _Counted(self._source)
        self.client = self._source._reader._client
        return self

    def _source_calibration(self):
        return replace(self._calibration, block_samples=10)

    def run(self, n_samples: int) -> None:
        if not self.source.n_connected:
            self._clock.step(n_samples / self._calibration.rate_hz)

    def stall(self, n_polls: int) -> None:
        """Let so many polls come due while the reader is busy with something else."""
        self._clock.step(n_polls / self._calibration.rate_hz)


class _Counted:
    """A source that counts its connections."""

    def __init__(self, source: SampleSource) -> None:
        self._source, self.n_connected = source, 0

    @asynccontextmanager
    async def connect(self):
        async with self._source.connect() as stream:
            self.n_connected += 1
            try:
                yield stream
            finally:
                self.n_connected -= 1


class PolledTcpRig(OnTcp, _PolledRig):
    """Polled registers over Modbus TCP."""


class PolledRtuRig(OnRtu, _PolledRig):
    """Polled registers over Modbus RTU."""


class VectorTcpRig(OnTcp, _PolledRig):
    """A vector rack over Modbus TCP."""

    rows = tuple(row.id for row in VECTORS)

    def _source_calibration(self):
        return vector_calibration(self._calibration, ("c0", "c1"), VECTORS)


class VectorRtuRig(OnRtu, VectorTcpRig):
    """A vector rack over Modbus RTU."""


class _FifoRig(Rig):
    """Queues, with slow values in the registers of another device."""

    layout = FifoLayout(addresses=(1000,), n_channels=2)

    async def __aenter__(self) -> "_FifoRig":
        self.step_samples = 50
        ids = frozenset(SLOW)
        calibration = replace(self._calibration, channels=())
        beside = MapDevice(SlowFeed(self._feed.slow), registers(()), (), calibration)
        self._device = FifoDevice(self._feed, self.layout, depth_samples=4000, step_samples=50)
        self._server = self._serve(self._device)
        await self.plug_in()
        self._beside = ModbusTcpServer(beside)
        await self._beside.__aenter__()
        settings = FifoSettings(**self._link(), poll_period_s=0.001)
        # patient, for a busy machine: no trouble of this device is part of any test here
        polled = PolledSettings(transport=TcpTransport(**self._beside.endpoint), timeout_s=60.0)
        calibration = without_slow(self._calibration, ids)
        source = FifoSource(settings, self.layout, calibration, self._clock)
        slow = PolledSlowValues(polled, registers(()), self._calibration.slow, SystemClock())
        self.client, self.source = source._client, JoinedSource(source, slow)
        return self

    async def __aexit__(self, *error: object) -> None:
        await self._beside.__aexit__(*error)
        await super().__aexit__(*error)

    def run(self, n_samples: int) -> None:
        self._clock.step(n_samples / self._calibration.rate_hz)
        self._device.produce(n_samples // self.step_samples)


class SlowFeed:
    """A feed of slow values alone, that never ends."""

    def __init__(self, slow) -> None:
        self.slow, self._n = slow, 0

    def advance(self, n_samples: int):
        first, self._n = self._n, self._n + n_samples
        counts = np.zeros((0, n_samples), dtype=np.int16)
        return cell_block(0, first, 0, 600.0, counts, (), self.slow)


class FifoTcpRig(OnTcp, _FifoRig):
    """A queue of all channels over Modbus TCP."""


class FifoRtuRig(OnRtu, _FifoRig):
    """A queue of all channels over Modbus RTU."""


class ChannelFifoTcpRig(OnTcp, _FifoRig):
    """A queue for each channel, over Modbus TCP."""

    layout = FifoLayout(addresses=(1000, 1100), n_channels=2, kind=FifoKind.PER_CHANNEL)


REGISTER_RIGS = [
    PolledTcpRig,
    PolledRtuRig,
    VectorTcpRig,
    VectorRtuRig,
    FifoTcpRig,
    FifoRtuRig,
    ChannelFifoTcpRig,
]
