"""A device with queues on a stepped clock, and a source that reads them."""

import itertools
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import numpy as np

from acquisition.daq.fifo_device import FifoDevice
from acquisition.daq.tcp_server import ModbusTcpServer
from acquisition.modbus.fifo_source import FifoSettings, FifoSource
from acquisition.modbus.transport import TcpTransport
from acquisition.registers.fifo_layout import FifoKind, FifoLayout
from core.blocks import SampleBlock

STEP = 50
INTERLEAVED = FifoLayout(addresses=(1000,), n_channels=2)
PER_CHANNEL = FifoLayout(addresses=(1000, 1100), n_channels=2, kind=FifoKind.PER_CHANNEL)
KEPT = FifoLayout(addresses=(1000,), n_channels=2, removes=False)
UNCOUNTED = FifoLayout(addresses=(1000,), n_channels=2, has_counter=False)


class QueuePlant:
    """A device with queues on a stepped clock, and a source that reads them."""

    def __init__(self, device: FifoDevice, clock, server) -> None:
        self.device, self.clock, self.server = device, clock, server
        self.source: FifoSource

    def run(self, n_steps: int = 1) -> None:
        self.device.produce(n_steps)
        self.clock.step(n_steps * self.device.step_s)

    def run_by_itself(self) -> None:
        """From now on time passes whenever the reader has found a queue empty."""
        answer = self.device.read_fifo

        def answer_and_go_on(address: int) -> bytes | None:
            data = answer(address)
            if not data:
                self.run()
            return data

        self.device.read_fifo = answer_and_go_on


@asynccontextmanager
async def queue_plant(
    feed, calibration, clock, layout: FifoLayout = INTERLEAVED, settings=None, step=STEP, **device
) -> AsyncIterator[QueuePlant]:
    """Serve a feed by queues of a layout."""
    own = FifoDevice(feed, layout, **({"step_samples": step, "depth_samples": 4000} | device))
    async with ModbusTcpServer(own) as server:
        plant = QueuePlant(own, clock, server)
        transport = TcpTransport(host="127.0.0.1", port=server.port)
        given = {"poll_period_s": 1e-6} | (settings or {})
        plant.source = FifoSource(
            FifoSettings(transport=transport, **given), layout, calibration, clock
        )
        yield plant


async def up_to(stream, stop_index: int, epoch: int | None = None) -> list[SampleBlock]:
    blocks = [await anext(stream)]
    while blocks[-1].stop_index < stop_index or epoch not in (None, blocks[-1].epoch):
        blocks.append(await anext(stream))
    return blocks


def assert_right(blocks: list[SampleBlock], offset: int = 0) -> None:
    """Channel 0 is the sample's number, channel 1 one ahead."""
    for block in blocks:
        number = np.arange(block.first_index, block.stop_index) + offset
        np.testing.assert_array_equal(block.samples[0], number % 2**15)
        np.testing.assert_array_equal(block.samples[1], (number + 1) % 2**15)


def gaps(blocks: list[SampleBlock]) -> list[tuple[int, int]]:
    return [
        (before.stop_index, after.first_index - before.stop_index)
        for before, after in itertools.pairwise(blocks)
        if after.first_index != before.stop_index
    ]
