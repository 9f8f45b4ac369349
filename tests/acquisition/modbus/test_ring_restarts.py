"""What a block-ring source makes of a device that begins to count anew: epochs, told or not."""

import numpy as np
import pytest

from acquisition.clock import SystemClock
from acquisition.daq import faults
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.errors import LinkError
from core.blocks import Rejection


class ShiftedClock(SystemClock):
    """Shows another time of day."""

    def __init__(self, by_s: int) -> None:
        self._by_s = by_s

    def now_ns(self) -> int:
        return super().now_ns() + self._by_s * 10**9


def samples_of(blocks) -> np.ndarray:
    return np.concatenate([block.samples[0] for block in blocks])


async def test_a_restarted_device_starts_a_new_epoch_from_its_first_sample(
    device, server, source_at, read_until
):
    async with source_at(server.port).connect() as stream:
        before = await anext(stream)
        device.produce(2)
        await read_until(stream, 150)
        device.restart()
        device.produce(2)
        after = await read_until(stream, 150)
    assert after[0].epoch != before.epoch
    assert after[0].first_index == 0
    np.testing.assert_array_equal(samples_of(after), np.arange(150, 300))


@pytest.mark.parametrize("version", [2], indirect=True, ids=["v2"])
async def test_a_new_epoch_is_read_from_its_start_though_its_newest_slot_is_lost(
    device, server, source_at, read_until
):
    async with source_at(server.port).connect() as stream:
        await anext(stream)
        device.produce(7)
        await read_until(stream, 400)
        device.restart()
        device.produce(2)
        device.produce(1, faults.dropped)
        [first, second, third] = await read_until(stream, 150)
        device.produce(1)
        block = await anext(stream)
    assert (first.first_index, second.first_index, third.first_index) == (0, 50, 100)
    assert (block.first_index, block.epoch) == (200, first.epoch)


@pytest.mark.parametrize("version", [2], indirect=True, ids=["v2"])
async def test_a_slot_of_an_epoch_that_has_ended_is_never_one_of_the_new_one(
    device, server, source_at
):
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


async def test_counters_reset_from_far_are_a_new_epoch_and_not_a_gap_of_years(
    counting_feed, source_at, read_until, version
):
    settings = RingDeviceSettings(n_slots=8, first_sequence=3_000_000_000, version=version)
    device = RingDevice(counting_feed(n_channels=3), settings=settings)
    async with ModbusRingServer(device) as server, source_at(server.port).connect() as stream:
        before = await anext(stream)
        device.first_sequence = 0
        device.restart(next_epoch=False)
        device.produce(2)
        after = await read_until(stream, 150)
    assert after[0].epoch != before.epoch
    assert (after[0].first_index, after[0].rejected) == (50, (Rejection("inconsistent_index", 50),))


@pytest.mark.parametrize("version", [2], indirect=True, ids=["v2"])
async def test_one_header_of_an_epoch_that_has_ended_does_not_make_old_samples_new(
    device, server, source_at
):
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
        with pytest.raises(LinkError, match="epoch or layout change"):
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
