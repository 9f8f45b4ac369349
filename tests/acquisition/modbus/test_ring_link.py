"""Whom a block-ring source talks to, how often, and when it gives up."""

import numpy as np
import pytest
from rigs.tiers import covering

from acquisition.delivery.arrival import Arrival, ArrivalModel
from acquisition.delivery.polling import incommensurate_period_s
from acquisition.errors import ConfigError, LinkError
from acquisition.simulated.devices import ring_faults as faults
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from core.alarms.judgements import drift_reading


@pytest.mark.parametrize(
    ("trouble", "complaint"),
    [(trouble, "newest usable slot has not") for trouble in ("frozen", "writes nothing")],
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
        async with source.connect() as stream:
            with pytest.raises(LinkError, match=complaint):
                await anext(stream)
        device.frozen = False
        device.produce(1)
        async with source.connect() as stream:
            assert (await anext(stream)).first_index == 50


@pytest.mark.parametrize(
    ("expected", "complaint"),
    [
        ({"n_channels": 4}, "n_channels of the device is 3, of the plant file 4"),
        (
            {"n_channels": 3, "rate_hz": 500.0},
            "rate in mHz of the device is 600000, of the plant file 500000",
        ),
        ({"n_channels": 3, "n_slow": 3}, "n_slow of the device is 2, of the plant file 3"),
    ],
)
async def test_another_device_than_configured_is_refused_with_found_and_expected(
    expected, complaint, server, source_at, counts_calibration
):
    source = source_at(server.port, calibration=counts_calibration(**expected))
    with pytest.raises(ConfigError, match=complaint):
        async with source.connect():
            pass


async def test_a_device_without_a_ring_or_elsewhere_is_a_config_error(device, server, source_at):
    device.memory.clear()
    for base_address, complaint in (
        (0, "magic is 0x0000, expected 0x5057"),
        (40_000, "illegal data a"),
    ):
        with pytest.raises(ConfigError, match=complaint):
            async with source_at(server.port, base_address=base_address).connect():
                pass


async def test_input_registers_bring_the_same_samples(device, server, source_at, read_until):
    source = source_at(server.port, function=4)
    async with source.connect() as stream:
        await anext(stream)
        device.produce(2)
        blocks = await read_until(stream, 150)
    samples = np.concatenate([block.samples[0] for block in blocks])
    np.testing.assert_array_equal(samples, np.arange(50, 150))
    assert set(server.function_codes) == {4}


async def test_a_source_polls_four_times_a_ring_and_piles_no_polls(
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
    pace_s = incommensurate_period_s(2 * device.layout.slot_duration_s, 1 / 12)
    assert np.diff(polled_at_s) == pytest.approx([pace_s, pace_s, pace_s, 7.3, pace_s])


async def test_samples_that_a_ring_has_kept_come_bit_by_bit(counting_feed, source_at, read_until):
    device = RingDevice(counting_feed(n_channels=3), settings=RingDeviceSettings(n_slots=32))
    asked: list[int] = []
    read = device.memory.read

    def read_and_note(address: int, count: int) -> bytes:
        asked.append(address)
        return read(address, count)

    async with ModbusTcpServer(device) as server:
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
    assert n_read <= 18 * reads_per_slot  # of thirty
    starts = [block.first_index + block.side.starts for block in [first, *rest]]
    assert np.concatenate(starts).tolist() == list(range(50, 50 * 31, 50))


RATE_HZ = 600.0
DURATION_S = 1800.0
LIMIT_PPM = 200.0
"""The default of ``max_clock_drift_ppm``."""


def readings(drift_ppm: float, period_s: float, slot_samples: int, seed: int):
    """Clock estimate every ten seconds for a ring whose link takes 3 ms, at times more."""
    random, estimate = np.random.default_rng(seed), ArrivalModel(RATE_HZ)
    slot_s = slot_samples / RATE_HZ
    begun_s = random.uniform(0.0, slot_s)
    told_s, seen, pace_s = 0.0, 0, incommensurate_period_s(period_s, slot_s)
    for polled_s in np.arange(pace_s, DURATION_S, pace_s).tolist():
        n_slots = int((begun_s + polled_s) * (1.0 + drift_ppm * 1e-6) / slot_s)
        if n_slots == seen:
            continue
        seen = n_slots
        arrived_s = polled_s + 0.003 + random.exponential(0.002)
        arrived = Arrival(1_767_225_600 * 10**9 + round(arrived_s * 1e9), arrived_s)
        estimate.add(1, n_slots * slot_samples, None, arrived)
        if polled_s - told_s >= 10.0:
            told_s = polled_s
            yield estimate.device_clock()


@pytest.mark.parametrize(
    ("drift_ppm", "polls"),
    covering([-50.0, 0.0, 10.0, 100.0, 150.0, 1000.0], [(0.25, 50), (0.25, 600), (1.0, 60)]),
)
def test_a_ring_polled_in_step_with_its_slots_tells_its_drift(drift_ppm, polls):
    period_s, slot_samples = polls
    for seed in range(5):
        found = list(readings(drift_ppm, period_s, slot_samples, seed))
        assert found[-1].u_drift_ppm < 5.0
        assert abs(found[-1].drift_ppm - drift_ppm) < 3.0 * found[-1].u_drift_ppm + 0.5
        surely_ppm = [drift_reading(clock).value or 0.0 for clock in found]
        lasts = [min(surely_ppm[n : n + 6]) for n in range(len(surely_ppm) - 5)]
        assert (max(lasts) > LIMIT_PPM) == (drift_ppm > LIMIT_PPM)


@pytest.mark.parametrize("slot_s", [0.01, 0.0833, 0.1, 0.24, 0.25, 0.26, 0.5, 1.0, 7.0])
def test_polls_come_no_later_than_asked_for_and_not_much_sooner(slot_s):
    period_s = incommensurate_period_s(0.25, slot_s)
    assert 0.5 * 0.25 < period_s <= 0.25
    if slot_s > 1.0 or slot_s < 0.05:
        assert period_s > 0.8 * 0.25
