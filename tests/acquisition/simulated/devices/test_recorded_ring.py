"""A ring behind a recording: gaps, restarts and the end arrive as they were recorded."""

import asyncio
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rigs.blocks import cell_block
from rigs.modbus import transport_of

from acquisition.clock import SystemClock
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.ring_profile import RingLayout
from acquisition.modbus.ring_source import RingSettings, RingSource
from acquisition.simulated.devices.modbus_links import ModbusRtuServer, ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from acquisition.simulated.devices.ring_faults import ReadingWatch
from acquisition.simulated.feed import FeedEndedError
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration

START_NS = 1_767_225_600 * 10**9


class PiecewiseFeed:
    """Sample numbers of some stretches: (epoch, first, stop); fewer at once where one ends."""

    def __init__(self, *stretches: tuple[int, int, int]) -> None:
        self._stretches = list(stretches)

    def advance(self, n_samples: int) -> SampleBlock:
        if not self._stretches:
            raise FeedEndedError
        epoch, first, stop = self._stretches[0]
        end = min(first - first % n_samples + n_samples, stop)
        self._stretches[0] = (epoch, end, stop)
        if end == stop:
            del self._stretches[0]
        index = np.arange(first, end)
        return cell_block(
            epoch=epoch,
            first_index=first,
            start_ns=START_NS + epoch * 10**12 + round(first * 1e9 / 600),
            rate_hz=600.0,
            counts=np.array([index % 2**15, (index + 1) % 2**15], dtype=np.int16),
            ok=(True, True),
            slow=(float(first // 50), float("nan")),
        )


def source_of(server, calibration: UnitCalibration, **settings: float) -> RingSource:
    given = {"poll_period_s": 0.0001, "timeout_s": 3.0} | settings
    settings = RingSettings(transport=transport_of(server), **given)
    return RingSource(settings, calibration, SystemClock())


async def replayed(server, calibration: UnitCalibration) -> list[SampleBlock]:
    """All that a reader gets until the server says that everything was read."""
    source = source_of(server, calibration)
    blocks: list[SampleBlock] = []

    async def read() -> None:
        async with source.connect() as stream:
            async for block in stream:
                blocks.append(block)

    reading, serving = asyncio.create_task(read()), asyncio.create_task(server.run())
    await asyncio.wait([reading, serving], return_when=asyncio.FIRST_COMPLETED)
    assert serving.done(), reading
    reading.cancel()
    await asyncio.wait([reading])
    return blocks


SETTINGS = RingDeviceSettings(n_slots=8)


PIECES = ((1, 0, 130), (1, 275, 1000), (1, 9000, 29_000), (2, 20, 400), (9, 5000, 5300))
FOUND = {(1, 0): 2, (1, 300): 14, (1, 9000): 400, (2, 50): 7, (9, 5000): 6}
"""First slots and their number: 100 to 130, 275 to 300 and 20 to 50 of epoch 2 fill none."""


def assert_recorded(blocks: list[SampleBlock], found: dict[tuple[int, int], int]) -> None:
    """Blocks are these slots, with the samples and times of the recording."""
    slots = [
        (epoch, first + 50 * n) for (epoch, first), n_slots in found.items() for n in range(n_slots)
    ]
    assert all((block.rejected, block.stamp_fault) == ((), None) for block in blocks)
    cells = [cell for block in blocks for cell in block.cells()]
    assert [(cell.epoch, cell.first_index) for cell in cells] == slots
    for cell in cells:
        index = np.arange(cell.first_index, cell.stop_index)
        np.testing.assert_array_equal(cell.counts[0], index % 2**15)
        passed_us = round(cell.first_index * 1e9 / 600) // 1000
        assert cell.start_ns == START_NS + cell.epoch * 10**12 + passed_us * 1000
        assert cell.side.slow[0, 0] == cell.first_index // 50


@pytest.mark.parametrize("kind", [ModbusTcpServer, ModbusRtuServer, "patient"])
async def test_a_replay_loses_nothing_with_a_small_ring_and_a_fast_clock(kind, counts_calibration):
    """Gaps are as long behind the wire, and epochs are those of the recording."""
    device = RingDevice(PiecewiseFeed(*PIECES), settings=SETTINGS)
    device.patient = kind == "patient"
    device.on_demand = not device.patient
    how = ModbusTcpServer(device, Hurry(), patient=True) if device.patient else kind(device)
    async with how as server:
        blocks = await replayed(server, counts_calibration())
    assert_recorded(blocks, FOUND)


async def test_a_paced_gap_takes_the_time_it_took():
    device = RingDevice(PiecewiseFeed((1, 0, 100), (1, 500, 600)), settings=SETTINGS)
    newest = []
    for _ in range(11):
        device.produce(1)
        newest.append(device.newest)
    assert newest == [1, 1, 1, 1, 1, 1, 1, 1, 1, 10, 11]
    assert not device.ended
    device.produce(1)
    assert device.ended
    assert device.ledger.n_samples("U1") == 600


def test_a_restart_of_the_recording_takes_no_time():
    device = RingDevice(PiecewiseFeed((1, 0, 100), (2, 7000, 7100)), settings=SETTINGS)
    device.produce(2)
    assert (device.epoch, device.newest) == (2, 0)
    device.produce(1)
    assert (device.epoch, device.newest) == (2, 1)


async def test_a_paced_server_ends_with_its_recording_when_nobody_reads(stepped_clock):
    device = RingDevice(PiecewiseFeed((1, 0, 500)), settings=SETTINGS)
    async with ModbusTcpServer(device, stepped_clock) as server:
        await server.run()
    assert device.ended
    assert device.ledger.n_samples("U1") == 500


class Hurry(SystemClock):
    """A clock that runs a thousand times as fast."""

    def monotonic_s(self) -> float:
        return 1000.0 * super().monotonic_s()

    async def sleep(self, duration_s: float) -> None:
        await super().sleep(duration_s / 1000.0)


def read(device: RingDevice, *sequences: int) -> None:
    """Read slots as a source does, and let far more time pass than the ring is long."""
    for sequence in sequences:
        address = device.layout.slot_address(sequence)
        device.read_registers(3, address, device.layout.slot_registers)
    device.produce(1000)


def test_time_stands_still_when_the_ring_is_full_of_what_nobody_has_read():
    pieces = ((7, 0, 200), (7, 350, 600), (8, 0, 600))
    device = RingDevice(PiecewiseFeed(*pieces), settings=RingDeviceSettings(n_slots=8))
    device.patient = True
    device.produce(1000)
    assert device.newest == 0  # a reader that has not begun would leave out what came before
    for sequence, newest in ((0, 3), (3, 3), (2, 3), (1, 7)):  # slot 7 is four places on from 3
        read(device, sequence)
        assert device.newest == newest
    read(device, 2, 3)
    read(device, 7, 8, 9, 10)
    assert (device.epoch, device.newest) == (7, 11)  # a restart waits for the last slot
    read(device)
    assert (device.epoch, device.newest) == (7, 11)
    device.read_registers(3, device.layout.slot_address(11), device.layout.slot_registers)
    device.produce(1)
    assert (device.epoch, device.newest) == (8, 0)


async def test_a_reader_that_comes_late_gets_what_is_left_and_its_end(counts_calibration):
    device = RingDevice(PiecewiseFeed((1, 0, 20_000)), settings=SETTINGS)
    device.patient = True
    async with ModbusTcpServer(device, Hurry(), patient=True) as server:
        async with source_of(server, counts_calibration()).connect() as stream:
            before = await anext(stream)
        after = await replayed(server, counts_calibration())
    start = after[0].first_index
    assert before.stop_index <= start
    assert_recorded(after, {(1, start): (20_000 - start) // 50})


async def test_a_device_whose_recording_has_ended_stands_still(counts_calibration):
    device = RingDevice(PiecewiseFeed((1, 0, 100)), settings=SETTINGS)
    device.produce(10)
    device.restart()
    assert (device.newest, device.ended) == (1, True)
    assert device.ledger.n_samples("U1") == 100
    async with ModbusTcpServer(device) as server:
        source = source_of(server, counts_calibration(), poll_period_s=0.001, stale_after_s=0.05)
        async with source.connect() as stream:
            await anext(stream)
            with pytest.raises(LinkError, match="newest usable slot has not changed"):
                await anext(stream)


def test_a_feed_without_a_whole_slot_is_refused():
    with pytest.raises(ConfigError, match="no slot of 50 samples without a gap"):
        RingDevice(PiecewiseFeed((1, 0, 49), (1, 60, 99)))


def test_a_feed_in_engineering_units_is_refused(counting_feed):
    raw = counting_feed().advance(50)
    feed = SimpleNamespace(advance=lambda _: replace(raw, counts=raw.counts.astype(np.float32)))
    with pytest.raises(ConfigError, match="must be int16 counts, got float32"):
        RingDevice(feed)


LAYOUT = RingLayout(1, 10, 8, 600_000, 0, ring_address=100, slot_stride=40)
LOOK = ()


@pytest.mark.parametrize(
    ("written_read_or_looked", "n_unread", "waiting"),
    [
        pytest.param([(0, 1, 2), LOOK, [0, 1]], 1, False, id="one is left"),
        pytest.param([(0, 1, 2), LOOK, [0, 1], [2], LOOK], 0, True, id="read in order"),
        pytest.param([(0, 1, 2), LOOK, [2], LOOK], 0, True, id="older ones are left out"),
        pytest.param([(0,), LOOK, [0], (1, 2, 3), [3]], 3, False, id="the newest was not told of"),
        pytest.param([(0, 1), LOOK, (2, 3), [1], LOOK], 2, False, id="those after the look"),
        # read where the two slots before the first one would be, and the first one
        pytest.param(
            [(0,), LOOK, (1, 2, 3, 4, 5, 6), [6, 7, 0], LOOK], 6, False, id="places of older slots"
        ),
        pytest.param([(0, 1), LOOK, [0, 1], None, (0,), LOOK], 1, False, id="an empty ring"),
    ],
)
def test_a_slot_is_read_when_a_reader_that_was_told_of_it_cannot_come_back_for_it(
    written_read_or_looked, n_unread, waiting
):
    """Sequences in tuples are written, places in lists are read."""
    watch = ReadingWatch(LAYOUT)
    for done in written_read_or_looked:
        if done is None:
            watch.clear()
        elif done == LOOK:
            watch.note_look()
        for number in done or ():
            if isinstance(done, tuple):
                watch.note_written(number)
            else:
                start = LAYOUT.slot_address(number)
                watch.note_read(range(start, start + LAYOUT.slot_registers))
    assert (watch.n_unread, watch.waiting) == (n_unread, waiting)
