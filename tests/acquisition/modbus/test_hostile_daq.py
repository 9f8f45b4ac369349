"""A hostile DAQ: every kind of wrong reply, 200 random contents of each, and no false sample."""

import asyncio
import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rigs.hostile_modbus import HostileLine, HostileServer
from rigs.wrong_replies import (
    CONTENTS,
    FORMS,
    OF_REGISTERS,
    TIMEOUT_S,
    Words,
    tell,
)

from acquisition.clock import SystemClock
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.modbus.transport import SerialTransport, TcpTransport

N_CONTENTS = 200
N_AT_ONCE = 20
TCP, RTU = (FORMS[link] | OF_REGISTERS | CONTENTS[link] for link in ("tcp", "rtu"))


class Bench:
    """A device whose replies are true but for one lie in each trial, and a source that reads it."""

    def __init__(self, feed, calibration, seed: int) -> None:
        settings = RingDeviceSettings(n_slots=64)
        self.device = RingDevice(feed, settings=settings)
        self.n_told = 0
        self.blocks: list = []
        self._calibration = calibration
        self._random = np.random.default_rng(seed)

    async def try_lies(self, ear, transport, make: Callable[[Words], list], n_lies: int) -> None:
        """Let a lie fall into a random one of the first replies after each connection."""
        link = "tcp" if isinstance(transport, TcpTransport) else "rtu"

        async def lie(request, reply, writer) -> None:
            ear.lie = None
            parts = make(Words(request, reply, self._random, link))
            self.n_told += 1
            self.device.produce(1)
            await tell(parts, writer)

        settings = ModbusRingSettings(transport=transport, timeout_s=TIMEOUT_S, poll_period_s=0.001)
        source = ModbusRingSource(settings, self._calibration, SystemClock())
        while self.n_told < n_lies:
            ear.n_honest, ear.lie = int(self._random.integers(6)), lie
            self.device.produce(2)
            with contextlib.suppress(LinkError, ConfigError):
                await self._read(source, ear)
        while self._stop_index < self.device.ledger.n_samples("U1"):
            with contextlib.suppress(LinkError):
                await self._read(source, ear)

    @property
    def _stop_index(self) -> int:
        return self.blocks[-1].stop_index if self.blocks else 0

    async def _read(self, source, ear) -> None:
        async with source.connect() as stream:
            async for block in stream:
                self.blocks.append(block)
                if block.stop_index < self.device.ledger.n_samples("U1"):
                    continue
                if ear.lie is None:
                    return
                self.device.produce(1)


def assert_nothing_false(bench: Bench) -> None:
    samples = np.concatenate([block.samples[0] for block in bench.blocks])
    index = np.concatenate([np.arange(b.first_index, b.stop_index) for b in bench.blocks])
    np.testing.assert_array_equal(samples, index % 2**15)
    stop = bench.device.ledger.n_samples("U1")
    np.testing.assert_array_equal(index, np.arange(bench.blocks[0].first_index, stop))
    assert len({block.epoch for block in bench.blocks}) == 1
    assert not any(block.rejected or block.stamp_fault for block in bench.blocks)
    assert all(block.slow["slow0"].value == 45.0 for block in bench.blocks)


@pytest.fixture
def benches(counting_feed, counts_calibration) -> list[Bench]:
    calibration = counts_calibration(n_channels=1)
    return [Bench(counting_feed(n_channels=1), calibration, seed) for seed in range(N_AT_ONCE)]


def test_there_are_more_than_two_dozen_kinds_of_wrong_reply():
    assert len(TCP) >= 24
    assert len(RTU) >= 24


@pytest.mark.parametrize("make", TCP.values(), ids=TCP.keys())
async def test_no_wrong_reply_over_tcp_becomes_a_sample(make, benches):
    async def try_on(bench: Bench) -> None:
        async with HostileServer(bench.device) as server:
            transport = TcpTransport(host="127.0.0.1", port=server.port)
            await bench.try_lies(server, transport, make, N_CONTENTS // N_AT_ONCE)

    await asyncio.gather(*(try_on(bench) for bench in benches))
    assert sum(bench.n_told for bench in benches) >= N_CONTENTS
    for bench in benches:
        assert_nothing_false(bench)


@pytest.mark.parametrize("make", RTU.values(), ids=RTU.keys())
async def test_no_wrong_reply_on_a_line_becomes_a_sample(make, benches, tmp_path: Path):
    async def try_on(bench: Bench, path: Path) -> None:
        async with HostileLine(bench.device, path) as line:
            transport = SerialTransport(device=str(path), baudrate=4_000_000, parity="none")
            await bench.try_lies(line, transport, make, N_CONTENTS // N_AT_ONCE)

    await asyncio.gather(*(try_on(b, tmp_path / str(n)) for n, b in enumerate(benches)))
    assert sum(bench.n_told for bench in benches) >= N_CONTENTS
    for bench in benches:
        assert_nothing_false(bench)
