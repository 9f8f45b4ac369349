"""What a block-ring source makes of a device that loses, tears, repeats, restarts or stops."""

import numpy as np
import pytest

from acquisition.daq import faults
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.modbus.profile import RingHeader, encode_header
from acquisition.modbus.slot import encode_slot
from core.blocks import Rejection
from core.quality import Reason

U32 = 2**32


async def test_only_the_newest_slot_is_read_on_the_first_connection(device, server, source_at):
    device.produce(6)
    async with source_at(server.port).connect() as stream:
        block = await anext(stream)
    assert (block.first_index, block.stop_index) == (300, 350)


async def test_slots_that_follow_each_other_come_as_one_block(device, server, source_at):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(6)
        block = await anext(stream)
    assert (block.first_index, block.stop_index) == (50, 350)
    expected = np.arange(50, 350) + np.arange(3)[:, np.newaxis]
    np.testing.assert_array_equal(block.samples, expected)


async def test_a_slot_that_was_never_written_is_an_exact_gap(device, server, source_at):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(2, faults.dropped)
        device.produce(1)
        block = await anext(stream)
    assert (block.first_index, block.rejected) == (150, ())


async def test_a_reader_that_falls_behind_records_exactly_what_was_overwritten(
    device, server, source_at
):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(7)
        assert (await anext(stream)).first_index == 50
        device.produce(8)
        block = await anext(stream)
    assert (block.first_index, block.stop_index, block.rejected) == (450, 800, ())


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (faults.torn, "torn_slot"),
        (faults.wrong_sequence, "wrong_sequence"),
        (faults.wrong_index, "inconsistent_index"),
        (faults.impossible_time, "impossible_time"),
    ],
)
async def test_a_nonsense_slot_is_refused_and_counted(fault, reason, device, server, source_at):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(1)
        device.produce(1, fault)
        device.produce(2)
        before, after = await anext(stream), await anext(stream)
    assert (before.first_index, before.stop_index) == (50, 100)
    assert (after.first_index, after.stop_index) == (150, 250)
    assert after.rejected == (Rejection(reason, 50),)


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
    device, server, source_at
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
        first, second = await anext(stream), await anext(stream)
    assert (first.first_index, first.stop_index) == (200, 350)
    assert (second.first_index, second.stop_index) == (350, 550)
    np.testing.assert_array_equal(first.samples[0], np.arange(200, 350))


async def test_a_sequence_that_goes_back_for_a_moment_repeats_nothing(device, server, source_at):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(3)
        await anext(stream)
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


async def test_counters_wrap_without_a_trace(counting_feed, source_at):
    settings = RingDeviceSettings(n_slots=8, first_sequence=U32 - 3, first_index=U32 - 120)
    device = RingDevice(counting_feed(n_channels=3), settings=settings)
    async with ModbusRingServer(device) as server, source_at(server.port).connect() as stream:
        blocks = [await anext(stream)]
        for _ in range(4):
            device.produce(3)
            blocks.append(await anext(stream))
    assert [b.first_index - (U32 - 120) for b in blocks] == [0, 50, 200, 350, 500]
    samples = np.concatenate([b.samples[0] for b in blocks])
    np.testing.assert_array_equal(samples, np.arange(650))


async def test_a_restarted_device_starts_a_new_epoch_from_its_first_sample(
    device, server, source_at
):
    async with source_at(server.port).connect() as stream:
        before = await anext(stream)
        device.produce(2)
        await anext(stream)
        device.restart()
        device.produce(2)
        after = await anext(stream)
    assert after.epoch != before.epoch
    assert (after.first_index, after.stop_index) == (0, 150)
    np.testing.assert_array_equal(after.samples[0], np.arange(150, 300))


async def test_a_restart_that_the_device_does_not_tell_is_a_new_epoch_all_the_same(
    device, server, source_at
):
    async with source_at(server.port).connect() as stream:
        before = await anext(stream)
        device.produce(200)
        await anext(stream)
        device.restart(next_epoch=False)
        device.produce(2)
        after = await anext(stream)
    assert after.epoch != before.epoch
    assert (after.first_index, after.stop_index) == (0, 150)


async def test_counters_reset_from_far_are_a_new_epoch_and_not_a_gap_of_years(
    counting_feed, source_at
):
    settings = RingDeviceSettings(n_slots=8, first_sequence=3_000_000_000)
    device = RingDevice(counting_feed(n_channels=3), settings=settings)
    async with ModbusRingServer(device) as server, source_at(server.port).connect() as stream:
        before = await anext(stream)
        device.first_sequence = 0
        device.restart(next_epoch=False)
        device.produce(2)
        after = await anext(stream)
    assert after.epoch != before.epoch
    assert (after.first_index, after.stop_index) == (50, 150)
    assert after.rejected == (Rejection("inconsistent_index", 50),)


async def test_a_channel_the_device_calls_broken_is_bad_from_that_slot_on(counting_feed, source_at):
    feed = counting_feed(n_channels=3)
    device = RingDevice(feed)
    async with ModbusRingServer(device) as server, source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(1)
        feed.ok = (True, False, True)
        device.produce(1)
        healthy, broken = await anext(stream), await anext(stream)
    assert [q.reason for q in healthy.channel_quality] == [Reason.OK] * 3
    assert [q.reason for q in broken.channel_quality] == [
        Reason.OK,
        Reason.SENSOR_FAILURE,
        Reason.OK,
    ]


async def test_slots_with_padding_between_them_are_read_one_by_one(counting_feed, source_at):
    settings = RingDeviceSettings(n_slots=8, slot_padding=5)
    device = RingDevice(counting_feed(n_channels=3), settings=settings)
    async with ModbusRingServer(device) as server, source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(3)
        block = await anext(stream)
    np.testing.assert_array_equal(block.samples[0], np.arange(50, 200))


async def test_more_slow_values_than_fit_one_read_arrive_in_order(
    counting_feed, counts_calibration, source_at
):
    device = RingDevice(counting_feed(n_channels=3, slow=tuple(float(i) for i in range(80))))
    async with ModbusRingServer(device) as server:
        source = source_at(server.port, calibration=counts_calibration(n_channels=3, n_slow=80))
        async with source.connect() as stream:
            block = await anext(stream)
    assert [reading.value for reading in block.slow.values()] == list(range(80))
