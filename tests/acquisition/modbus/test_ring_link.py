"""Whom a block-ring source talks to, how often, and when it gives up."""

import numpy as np
import pytest

from acquisition.daq import faults
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.ring_pace import out_of_step_s


@pytest.mark.parametrize(
    ("trouble", "complaint"), [("frozen", "stand still"), ("writes nothing", "no usable slot")]
)
async def test_a_device_that_stands_still_or_counts_but_writes_nothing_is_not_connected(
    trouble, complaint, device, server, source_at, stepped_clock
):
    source = source_at(server.port, clock=stepped_clock, poll_period_s=1.0, stale_after_s=5.0)
    async with source.connect() as stream:
        await anext(stream)
        device.frozen = trouble == "frozen"
        if not device.frozen:
            device.memory.before_read = lambda at, _: at or device.produce(1, faults.dropped)
        with pytest.raises(LinkError, match=complaint):
            await anext(stream)
    if device.frozen:
        with pytest.raises(LinkError, match=complaint):
            async with source.connect():
                pass
        device.frozen = False
        device.produce(1)
        async with source.connect() as stream:
            assert (await anext(stream)).first_index == 50


@pytest.mark.parametrize(
    ("expected", "complaint"),
    [
        ({"n_channels": 4}, "n_channels is 3, expected 4"),
        ({"n_channels": 3, "rate_hz": 500.0}, "rate in mHz is 600000, expected 500000"),
        ({"n_channels": 3, "n_slow": 3}, "n_slow is 2, expected 3"),
    ],
)
async def test_another_device_than_configured_is_refused_with_found_and_expected(
    expected, complaint, server, source_at, counts_calibration
):
    source = source_at(server.port, calibration=counts_calibration(**expected))
    with pytest.raises(ConfigError, match=complaint):
        async with source.connect():
            pass


async def test_a_device_without_a_ring_or_at_another_address_is_a_config_error(
    device, server, source_at
):
    device.memory.clear()
    for base_address, complaint in ((0, "magic is 0x0000, expected 0x5057"), (40_000, "illegal a")):
        with pytest.raises(ConfigError, match=complaint):
            async with source_at(server.port, base_address=base_address).connect():
                pass


async def test_input_registers_and_small_reads_bring_the_same_samples(
    device, server, source_at, read_until
):
    source = source_at(server.port, function=4, max_registers=7)
    async with source.connect() as stream:
        await anext(stream)
        device.produce(2)
        blocks = await read_until(stream, 150)
    samples = np.concatenate([block.samples[0] for block in blocks])
    np.testing.assert_array_equal(samples, np.arange(50, 150))
    assert set(server.function_codes) == {4}


async def test_a_source_waits_a_poll_period_and_never_piles_polls_up(
    device, server, source_at, stepped_clock
):
    source = source_at(server.port, clock=stepped_clock, poll_period_s=1.0)
    polled_at_s = []

    def note(address, _):
        if address == 0:
            polled_at_s.append(stepped_clock.monotonic_s())
            device.produce(1)
            if len(polled_at_s) == 4:
                stepped_clock.step(7.3)  # a consumer or a device that takes its time

    async with source.connect() as stream:
        device.memory.before_read = note
        for _ in range(6):
            await anext(stream)
    pace_s = out_of_step_s(1.0, device.layout.slot_duration_s)
    assert np.diff(polled_at_s) == pytest.approx([pace_s, pace_s, pace_s, 7.3, pace_s])


async def test_samples_that_a_ring_has_kept_come_bit_by_bit(counting_feed, source_at, read_until):
    device = RingDevice(counting_feed(n_channels=3), settings=RingDeviceSettings(n_slots=32))
    asked: list[int] = []
    read = device.memory.read

    def read_and_note(address: int, count: int) -> bytes:
        asked.append(address)
        return read(address, count)

    async with ModbusRingServer(device) as server:
        source = source_at(server.port)
        async with source.connect() as stream:
            await anext(stream)
        device.produce(30)
        device.memory.read = read_and_note
        async with source.connect() as stream:
            first = await anext(stream)
            n_read = sum(address >= device.layout.ring_address for address in asked)
            rest = await read_until(stream, 50 * 31)
    reads_per_slot = -(-device.layout.slot_registers // 125)
    assert n_read <= 6 * reads_per_slot  # of thirty
    assert [block.first_index for block in [first, *rest]] == list(range(50, 50 * 31, 50))
