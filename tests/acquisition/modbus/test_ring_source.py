"""A block-ring source of a device that loses, tears, repeats, restarts, resets or stops."""

import numpy as np
import pytest

from acquisition.clock import SystemClock
from acquisition.errors import LinkError
from acquisition.modbus.ring_profile import RingHeader
from acquisition.simulated.devices import ring_faults as faults
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.register_image import encode_header, encode_slot
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from core.quality import Reason

U32 = 2**32


def samples_of(blocks) -> np.ndarray:
    return np.concatenate([block.samples[0] for block in blocks])


def cells_of(blocks) -> list[int]:
    """First sample of each cell."""
    return [block.first_index + start for block in blocks for start in block.side.starts.tolist()]


async def test_a_slot_that_is_being_written_is_read_again(device, server, source_at):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        written = []
        device.produce(1, lambda slot: faults.torn(written.append(slot) or slot))
        address = device.layout.slot_address(written[0].sequence)

        def finish_writing(read_address, _):
            if read_address == address and len(written) == 1:
                written.append(None)
            elif read_address == address:
                device.memory.write(address, encode_slot(written[0]))

        device.memory.before_read = finish_writing
        block = await anext(stream)
    assert (block.first_index, block.rejected) == (50, ())


async def test_slots_overwritten_while_they_are_read_are_a_gap_and_never_a_mixture(
    device, server, source_at, read_until
):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(6)
        n_reads = 0

        def run_on(address, _):
            nonlocal n_reads
            n_reads += address >= device.layout.ring_address
            if n_reads == 2:
                n_reads = 100
                device.produce(4)

        device.memory.before_read = run_on
        blocks = await read_until(stream, 550)
    assert blocks[0].first_index == 150
    np.testing.assert_array_equal(samples_of(blocks), np.arange(blocks[0].first_index, 550))


async def test_a_sequence_that_falls_back_repeats_nothing(device, server, source_at, read_until):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(3)
        await read_until(stream, 200)
        device.memory.write(0, encode_header(RingHeader(device.layout, device.epoch, 2)))
        n_polls = 0

        def recover(address, _):
            nonlocal n_polls
            n_polls += address == 0
            if n_polls == 3:
                device.produce(1)

        device.memory.before_read = recover
        block = await anext(stream)
    assert (block.first_index, block.stop_index) == (200, 250)


@pytest.mark.parametrize(
    "shape", [{"slot_padding": 5}, {"first_sequence": U32 - 3, "first_index": U32 - 146}]
)
async def test_wrapping_counters_and_padding_between_slots_leave_no_trace(
    counting_feed, source_at, read_until, shape
):
    start = shape.get("first_index", 0)
    settings = RingDeviceSettings(n_slots=8, **shape)
    device = RingDevice(counting_feed(n_channels=3), settings=settings)
    async with ModbusTcpServer(device) as server, source_at(server.port).connect() as stream:
        blocks = [await anext(stream)]
        for n in range(1, 5):
            device.produce(3)
            blocks += await read_until(stream, start + 50 + n * 150)
    assert [first - start for first in cells_of(blocks)] == list(range(0, 650, 50))
    np.testing.assert_array_equal(samples_of(blocks), np.arange(650))


async def test_a_channel_the_device_calls_broken_is_bad_from_that_slot_on(counting_feed, source_at):
    feed = counting_feed(n_channels=3)
    device = RingDevice(feed)
    async with ModbusTcpServer(device) as server, source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(1)
        healthy = await anext(stream)
        feed.ok = (True, False, True)
        device.produce(1)
        broken = await anext(stream)
    assert [q.reason for q in healthy.channel_quality] == [Reason.OK] * 3
    reasons = [Reason.OK, Reason.SENSOR_FAILURE, Reason.OK]
    assert [q.reason for q in broken.channel_quality] == reasons


async def test_more_slow_values_than_fit_one_read_arrive_in_order(
    counting_feed, counts_calibration, source_at
):
    feed = counting_feed(n_channels=3, slow=tuple(float(i) for i in range(80)))
    device = RingDevice(feed)
    async with ModbusTcpServer(device) as server:
        source = source_at(server.port, calibration=counts_calibration(n_channels=3, n_slow=80))
        async with source.connect() as stream:
            block = await anext(stream)
    assert [reading.value for reading in block.slow.values()] == list(range(80))


class ShiftedClock(SystemClock):
    """Shows another time of day."""

    def __init__(self, by_s: int) -> None:
        self._by_s = by_s

    def now_ns(self) -> int:
        return super().now_ns() + self._by_s * 10**9


async def test_a_new_epoch_is_read_from_its_start_though_its_newest_slot_is_lost(
    device, server, source_at, read_until
):
    async with source_at(server.port).connect() as stream:
        before = await anext(stream)
        device.produce(7)
        await read_until(stream, 400)
        device.restart()
        device.produce(2)
        device.produce(1, faults.dropped)
        restarted = await read_until(stream, 150)
        device.produce(1)
        block = await anext(stream)
    assert cells_of(restarted) == [0, 50, 100]
    assert restarted[0].epoch != before.epoch
    np.testing.assert_array_equal(samples_of(restarted), np.arange(400, 550))
    assert (block.first_index, block.epoch) == (200, restarted[0].epoch)


async def test_a_slot_of_an_ended_epoch_is_never_one_of_the_new_one(device, server, source_at):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(1)
        await anext(stream)
        address = device.layout.slot_address(1)
        left_behind = device.memory.read(address, device.layout.slot_registers)
        device.restart()
        device.produce(1, faults.dropped)
        device.memory.write(address, left_behind)
        device.produce(1)
        blocks = [await anext(stream), await anext(stream)]
    assert [block.first_index for block in blocks] == [0, 100]
    np.testing.assert_array_equal(blocks[1].samples[0], np.arange(200, 250))


async def test_a_header_of_an_ended_epoch_does_not_make_old_samples_new(device, server, source_at):
    source = source_at(server.port)
    old_header = device.memory.read(0, 16)
    device.restart()
    async with source.connect() as stream:
        device.produce(3)
        blocks = [await anext(stream)]
        new_header = device.memory.read(0, 16)
        n_looks = 0

        def show_old_header_once(address, _):
            nonlocal n_looks
            if address == 0:
                n_looks += 1
                device.memory.write(0, old_header if n_looks == 1 else new_header)

        device.memory.before_read = show_old_header_once
        with pytest.raises(LinkError, match="epoch or layout differ"):
            await anext(stream)
    device.memory.before_read = None
    device.produce(1)
    async with source.connect() as stream:
        blocks.append(await anext(stream))
    assert blocks[1].first_index == blocks[0].stop_index
    assert blocks[1].epoch == blocks[0].epoch


async def test_what_another_life_of_the_program_calls_a_restart_that_was_not_told(
    device, server, source_at, read_until
):
    """It is another count, and where the device told all, it is the same one."""
    found = []
    for begun_s in (0, 3600):
        async with source_at(server.port, ShiftedClock(begun_s)).connect() as stream:
            before = await anext(stream)
            device.produce(200)
            await read_until(stream, before.stop_index + 200 * 50)
            device.restart(next_epoch=False)
            device.produce(2)
            after = await read_until(stream, 150)
        assert after[0].first_index == 0
        found.append((before.epoch, after[-1].epoch))
    (first, first_again), (second, second_again) = found
    assert first == second == device.epoch
    assert len({first, first_again, second_again}) == 3
