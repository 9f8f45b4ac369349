"""What a block-ring source makes of a device that loses, tears, repeats, restarts or stops."""

import numpy as np
import pytest

from acquisition.daq import faults
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.modbus.profile import RingHeader, encode_header
from acquisition.modbus.slot import encode_slot
from core.device_clock import StampFault
from core.quality import Reason

U32 = 2**32


def samples_of(blocks) -> np.ndarray:
    return np.concatenate([block.samples[0] for block in blocks])


async def test_a_slot_with_a_wrong_stamp_keeps_its_samples_and_says_so(
    device, server, source_at, read_until
):
    device.produce(6)
    async with source_at(server.port).connect() as stream:
        first = await anext(stream)
        device.produce(1, faults.wrong_time)
        device.produce(1)
        wrong, right = await read_until(stream, 450)
    assert first.first_index == 300  # only the newest slot is read on the first connection
    assert wrong.stamp_fault is StampFault.JUMPED
    assert abs(wrong.start_ns - first.start_ns - 50e9 / 600) < 2000
    assert right.stamp_fault is None
    assert not wrong.rejected


async def test_a_device_clock_that_was_set_costs_no_sample(counting_feed, source_at, read_until):
    feed = counting_feed(n_channels=3)
    device = RingDevice(feed)
    async with ModbusRingServer(device) as server, source_at(server.port).connect() as stream:
        first = await anext(stream)
        feed._start_ns += 3600 * 10**9
        device.produce(3)
        blocks = await read_until(stream, 200)
    assert [block.stamp_fault for block in blocks] == [StampFault.JUMPED, None, None]
    assert [block.first_index for block in blocks] == [50, 100, 150]
    assert {block.epoch for block in blocks} == {first.epoch}
    assert blocks[1].start_ns - first.start_ns > 3600 * 10**9


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
                device.memory.write(address, encode_slot(written[0], device.layout))

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
    # version 1 leaves the slot alone that may just be overwritten; version 2 sees whether it was
    assert blocks[0].first_index == (200 if device.layout.version == 1 else 150)
    np.testing.assert_array_equal(samples_of(blocks), np.arange(blocks[0].first_index, 550))


async def test_a_sequence_that_goes_back_for_a_moment_repeats_nothing(
    device, server, source_at, read_until
):
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
    counting_feed, source_at, read_until, version, shape
):
    start = shape.get("first_index", 0)
    settings = RingDeviceSettings(n_slots=8, version=version, **shape)
    device = RingDevice(counting_feed(n_channels=3), settings=settings)
    async with ModbusRingServer(device) as server, source_at(server.port).connect() as stream:
        blocks = [await anext(stream)]
        for n in range(1, 5):
            device.produce(3)
            blocks += await read_until(stream, start + 50 + n * 150)
    assert [b.first_index - start for b in blocks] == list(range(0, 650, 50))
    np.testing.assert_array_equal(samples_of(blocks), np.arange(650))


async def test_a_channel_the_device_calls_broken_is_bad_from_that_slot_on(
    counting_feed, source_at, version
):
    feed = counting_feed(n_channels=3)
    device = RingDevice(feed, settings=RingDeviceSettings(version=version))
    async with ModbusRingServer(device) as server, source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(1)
        feed.ok = (True, False, True)
        device.produce(1)
        healthy, broken = await anext(stream), await anext(stream)
    assert [q.reason for q in healthy.channel_quality] == [Reason.OK] * 3
    reasons = [Reason.OK, Reason.SENSOR_FAILURE, Reason.OK]
    assert [q.reason for q in broken.channel_quality] == reasons


async def test_more_slow_values_than_fit_one_read_arrive_in_order(
    counting_feed, counts_calibration, source_at, version
):
    feed = counting_feed(n_channels=3, slow=tuple(float(i) for i in range(80)))
    device = RingDevice(feed, settings=RingDeviceSettings(version=version))
    async with ModbusRingServer(device) as server:
        source = source_at(server.port, calibration=counts_calibration(n_channels=3, n_slow=80))
        async with source.connect() as stream:
            block = await anext(stream)
    assert [reading.value for reading in block.slow.values()] == list(range(80))
