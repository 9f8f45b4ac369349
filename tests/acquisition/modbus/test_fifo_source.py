"""Samples from queues: each one once, losses exact, restarts and repetitions flagged."""

import itertools
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.fifo_assembly import FifoKind, FifoLayout
from acquisition.modbus.fifo_source import FifoSettings, FifoSource
from acquisition.modbus.transport import TcpTransport
from acquisition.simulated.devices.fifo_device import FifoDevice
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from core.samples.blocks import SampleBlock

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


@pytest.fixture
def queues(counting_feed, counts_calibration, stepped_clock) -> Callable:
    """Serves queues of a layout, on a stepped clock; other settings as keywords."""
    return partial(queue_plant, counting_feed(), counts_calibration(), stepped_clock)


BOTH_LAYOUTS = pytest.mark.parametrize("layout", [INTERLEAVED, PER_CHANNEL])


@pytest.mark.parametrize(("layout", "n_steps"), [(INTERLEAVED, 4000), (UNCOUNTED, 20)])
async def test_waiting_samples_are_exact_by_the_clock_or_thrown_away(queues, layout, n_steps):
    """The loss is longer than the counter; without one it ends the epoch."""
    async with queues(layout) as p:
        async with p.source.connect() as stream:
            p.run(1)
            before = await anext(stream)
        p.run(n_steps)
        async with p.source.connect() as stream:
            p.run(2)
            after = await anext(stream)

    assert after.epoch == before.epoch + (not layout.has_counter)
    if layout.has_counter:
        assert after.first_index > 3 * 65_536
        assert_right([after])
    else:
        assert after.samples[0, 0] >= (n_steps + 2) * STEP


async def test_an_overflow_is_an_exact_gap(queues):
    async with queues(depth_samples=200) as p, p.source.connect() as stream:
        first = await anext(stream)
        p.run(10)
        rest = await up_to(stream, 550)

    assert p.device.n_lost == 300
    assert gaps([first, *rest]) == [(50, 300)]
    assert_right([first, *rest])


async def test_a_queue_that_reading_does_not_empty_gives_each_sample_once(queues):
    async with queues(KEPT, step=5) as p, p.source.connect() as stream:
        blocks = []
        for n in range(40):
            p.run(1)
            if n % 10 == 9:
                blocks += await up_to(stream, 50 * (n // 10 + 1) - 50) if n > 9 else []
        n_taken = sum(b.n_samples for b in blocks)

    assert (
        n_taken + sum(n for _, n in gaps(blocks)) == blocks[-1].stop_index - blocks[0].first_index
    )
    assert_right(blocks)


async def test_times_are_even_and_rise_with_the_index(queues):
    async with queues() as p, p.source.connect() as stream:
        blocks = []
        for n in range(1, 400):
            p.run(1)
            blocks += await up_to(stream, n * STEP)

    starts = np.array([b.start_ns for b in blocks])
    expected = np.array([b.first_index for b in blocks]) / 600.0 * 1e9
    assert np.all(np.diff(starts) > 0)
    assert np.ptp(starts - expected) < 5e6
    assert blocks[-1].clock.offset_s is None


async def test_without_a_counter_a_loss_ends_the_epoch(queues):
    async with queues(UNCOUNTED) as p, p.source.connect() as stream:
        p.run(1)
        first = await anext(stream)
        for _ in range(30):
            p.run(1)
            last = await anext(stream)
        p.device.spoil("drop", 5)
        p.run(6)
        p.run_by_itself()
        after = await up_to(stream, STEP, first.epoch + 1)

    assert last.epoch == first.epoch
    assert after[-1].epoch == first.epoch + 1
    for block in after:
        number = np.arange(block.first_index, block.stop_index)
        lost = block.samples[0] - number
        assert len(set(lost.tolist())) == 1
        assert (lost[0] == 0.0) == (block.epoch == first.epoch)


async def test_a_device_that_gives_nothing_new_is_not_connected(queues):
    async with queues(settings={"poll_period_s": 0.5}) as p:
        async with p.source.connect() as stream:
            await anext(stream)
            with pytest.raises(LinkError, match="the newest sample has not changed"):
                await anext(stream)
        p.run(2)
        async with p.source.connect() as stream:
            assert (await anext(stream)).first_index == STEP


@pytest.mark.parametrize(
    ("fault", "error", "said"),
    [
        ("exception_3", ConfigError, "illegal data value"),
        ("exception_11", LinkError, "gateway target"),
    ],
)
async def test_a_refused_reading_is_never_repeated(queues, fault, error, said):
    async with queues() as p, p.source.connect() as stream:
        await anext(stream)
        n_before = p.server.function_codes[0x18]
        p.server.inject(fault)
        with pytest.raises(error, match=said):
            await anext(stream)
        assert p.server.function_codes[0x18] == n_before + 1
        assert set(p.server.function_codes) == {0x18}


@pytest.mark.parametrize(
    ("reads", "layout", "error", "said"),
    [
        ("device", UNCOUNTED, LinkError, "14 registers are not whole records of 3"),
        ("source", replace(INTERLEAVED, addresses=(2000,)), ConfigError, "illegal data address"),
    ],
)
async def test_a_queue_of_other_records_or_none_is_refused(queues, reads, layout, error, said):
    async with queues(step=7) as p:
        getattr(p, reads)._layout = layout
        with pytest.raises(error, match=said):
            async with p.source.connect() as stream:
                await anext(stream)


N_READ = 7
"""Readings of each queue before the link is lost."""


def lose_the_link_after(p, n_answers: int) -> None:
    """Let the answer after so many be lost on its way."""
    answer, n_asked = p.device.read_fifo, 0

    def answer_or_cut(address: int) -> bytes | None:
        nonlocal n_asked
        n_asked += 1
        if n_asked == n_answers + 1:
            p.server.cut()
        return answer(address)

    p.device.read_fifo = answer_or_cut


async def until_lost(stream, said: str | None = None) -> list[SampleBlock]:
    blocks = []

    async def take() -> None:
        async for block in stream:
            blocks.append(block)

    with pytest.raises(LinkError, match=said):
        await take()
    return blocks


@BOTH_LAYOUTS
async def test_a_lost_link_loses_no_more_than_the_answer_that_was_on_its_way(queues, layout):
    async with queues(layout) as p:
        async with p.source.connect() as stream:
            first = await up_to(stream, STEP)
            p.run(10)
            lose_the_link_after(p, N_READ * len(layout.addresses))
            before = await until_lost(stream)
        async with p.source.connect() as stream:
            after = await up_to(stream, 10 * STEP)

    blocks = [*first, *before, *after]
    assert gaps(blocks) == [(STEP + N_READ * layout.most_samples, layout.most_samples)]
    assert_right(blocks)


async def test_samples_that_are_not_counted_are_not_kept_where_some_may_be_missing(queues):
    async with queues(UNCOUNTED) as p, p.source.connect() as stream:
        p.run(10)
        lose_the_link_after(p, N_READ)
        assert await until_lost(stream) == []


async def test_what_was_read_over_too_slow_a_link_is_kept_too(queues):
    async with queues(depth_samples=100_000) as p, p.source.connect() as stream:
        first = await up_to(stream, STEP)
        answer = p.device.read_fifo

        def slowly(address: int) -> bytes | None:
            p.run(1)
            return answer(address)

        p.device.read_fifo = slowly
        before = await until_lost(stream, "too slow for 600 samples/s")
    assert sum(block.n_samples for block in before) > STEP
    assert gaps([*first, *before]) == []
    assert_right([*first, *before])
