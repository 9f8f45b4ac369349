"""A ring behind a recording: gaps, restarts and the end arrive as they were recorded."""

import asyncio

import numpy as np
import pytest

from acquisition.calibration import UnitCalibration
from acquisition.clock import SystemClock
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer, RtuRingServer
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.modbus.transport import SerialTransport, TcpTransport
from acquisition.raw import FeedEndedError, RawBlock
from core.blocks import SampleBlock

START_NS = 1_767_225_600 * 10**9


class PiecewiseFeed:
    """Sample numbers of some stretches: (epoch, first, stop); fewer at once where one ends."""

    def __init__(self, *stretches: tuple[int, int, int]) -> None:
        self._stretches = list(stretches)

    def advance(self, n_samples: int) -> RawBlock:
        if not self._stretches:
            raise FeedEndedError
        epoch, first, stop = self._stretches[0]
        end = min(first - first % n_samples + n_samples, stop)
        self._stretches[0] = (epoch, end, stop)
        if end == stop:
            del self._stretches[0]
        index = np.arange(first, end)
        return RawBlock(
            epoch=epoch,
            first_index=first,
            start_ns=START_NS + epoch * 10**12 + round(first * 1e9 / 600),
            rate_hz=600.0,
            counts=np.array([index % 2**15, (index + 1) % 2**15], dtype=np.int16),
            ok=(True, True),
            slow=(float(first // 50), float("nan")),
        )


def transport_of(server) -> TcpTransport | SerialTransport:
    found = dict(server.endpoint)
    return TcpTransport(**found) if "port" in found else SerialTransport(**found)


def source_of(server, calibration: UnitCalibration) -> ModbusRingSource:
    transport = transport_of(server)
    timeout_s = 5.0 if isinstance(transport, TcpTransport) else 0.6
    settings = ModbusRingSettings(transport=transport, poll_period_s=0.0001, timeout_s=timeout_s)
    return ModbusRingSource(settings, calibration, SystemClock())


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


@pytest.fixture(params=[1, 2], ids=["v1", "v2"])
def settings(request) -> RingDeviceSettings:
    return RingDeviceSettings(n_slots=8, version=request.param)


@pytest.fixture(params=[ModbusRingServer, RtuRingServer], ids=["tcp", "rtu"])
def serve(request):
    return lambda device: request.param(device, on_demand=True)


async def test_a_replay_on_demand_loses_nothing_however_small_the_ring(
    settings, serve, counts_calibration
):
    device = RingDevice(PiecewiseFeed((1, 0, 20_000)), settings=settings)
    async with serve(device) as server:
        blocks = await replayed(server, counts_calibration())
    samples = np.concatenate([block.samples[0] for block in blocks])
    np.testing.assert_array_equal(samples, np.arange(20_000))
    assert not any(block.rejected for block in blocks)


async def test_a_gap_of_the_recording_is_as_long_behind_the_wire(
    settings, serve, counts_calibration
):
    # 130 to 275 is missing: what fills no slot of 50 is left out, 100 to 130 and 275 to 300
    device = RingDevice(
        PiecewiseFeed((1, 0, 130), (1, 275, 1000), (1, 9000, 9100)), settings=settings
    )
    async with serve(device) as server:
        blocks = await replayed(server, counts_calibration())
    starts = [block.first_index for block in blocks]
    assert starts == [0, 50, *range(300, 1000, 50), 9000, 9050]
    for block in blocks:
        assert block.samples[0].tolist() == list(range(block.first_index, block.stop_index))
        assert (
            block.start_ns
            == START_NS + 10**12 + round(block.first_index * 1e9 / 600) // 1000 * 1000
        )
        assert not block.rejected
        assert block.stamp_fault is None


async def test_slow_values_and_epochs_are_those_of_the_recording(serve, counts_calibration):
    feed = PiecewiseFeed((1, 0, 500), (2, 20, 400), (9, 5000, 5300))
    device = RingDevice(feed, settings=RingDeviceSettings(n_slots=8))
    async with serve(device) as server:
        blocks = await replayed(server, counts_calibration())
    found = [(block.epoch, block.first_index) for block in blocks]
    assert found == [
        *((1, index) for index in range(0, 500, 50)),
        *((2, index) for index in range(50, 400, 50)),
        *((9, index) for index in range(5000, 5300, 50)),
    ]
    assert all(block.slow["slow0"].value == block.first_index // 50 for block in blocks)


async def test_a_paced_gap_takes_the_time_it_took(settings):
    device = RingDevice(PiecewiseFeed((1, 0, 100), (1, 500, 600)), settings=settings)
    newest = []
    for _ in range(11):
        device.produce(1)
        newest.append(device.newest)
    assert newest == [1, 1, 1, 1, 1, 1, 1, 1, 1, 10, 11]
    assert not device.ended
    device.produce(1)
    assert device.ended
    assert device.ledger.n_samples("U1") == 600


def test_a_restart_of_the_recording_takes_no_time(settings):
    device = RingDevice(PiecewiseFeed((1, 0, 100), (2, 7000, 7100)), settings=settings)
    device.produce(2)
    assert (device.epoch, device.newest) == (2, 0)
    device.produce(1)
    assert (device.epoch, device.newest) == (2, 1)


async def test_a_paced_server_ends_with_its_recording_when_nobody_reads(stepped_clock, settings):
    device = RingDevice(PiecewiseFeed((1, 0, 500)), settings=settings)
    async with ModbusRingServer(device, stepped_clock) as server:
        await server.run()
    assert device.ended
    assert device.ledger.n_samples("U1") == 500


class Hurry(SystemClock):
    """A clock that runs a thousand times as fast."""

    def monotonic_s(self) -> float:
        return 1000.0 * super().monotonic_s()

    async def sleep(self, duration_s: float) -> None:
        await super().sleep(duration_s / 1000.0)


async def test_a_patient_server_loses_nothing_however_fast_its_clock(settings, counts_calibration):
    device = RingDevice(PiecewiseFeed((1, 0, 5000), (2, 100, 3000)), settings=settings)
    async with ModbusRingServer(device, Hurry(), patient=True) as server:
        blocks = await replayed(server, counts_calibration())
    found = [(block.epoch, block.first_index) for block in blocks]
    assert found == [
        *((1, index) for index in range(0, 5000, 50)),
        *((2, index) for index in range(100, 3000, 50)),
    ]


async def test_a_reader_that_comes_late_gets_what_is_left_and_its_end(settings, counts_calibration):
    device = RingDevice(PiecewiseFeed((1, 0, 20_000)), settings=settings)
    async with ModbusRingServer(device, Hurry(), patient=True) as server:
        async with source_of(server, counts_calibration()).connect() as stream:
            before = await anext(stream)
        after = await replayed(server, counts_calibration())
    assert before.stop_index <= after[0].first_index
    assert after[-1].stop_index == 20_000
    for block in after:
        assert block.samples[0].tolist() == [
            n % 2**15 for n in range(block.first_index, block.stop_index)
        ]


async def test_a_device_whose_recording_has_ended_stands_still(settings, counts_calibration):
    device = RingDevice(PiecewiseFeed((1, 0, 100)), settings=settings)
    device.produce(10)
    device.restart()
    assert (device.newest, device.ended) == (1, True)
    assert device.ledger.n_samples("U1") == 100
    async with ModbusRingServer(device) as server:
        reader = ModbusRingSettings(
            transport=transport_of(server), poll_period_s=0.001, stale_after_s=0.05
        )
        source = ModbusRingSource(reader, counts_calibration(), SystemClock())
        async with source.connect() as stream:
            await anext(stream)
            with pytest.raises(LinkError, match="stand still"):
                await anext(stream)


def test_a_feed_without_a_whole_slot_is_refused():
    with pytest.raises(ConfigError, match="not one slot of 50"):
        RingDevice(PiecewiseFeed((1, 0, 49), (1, 60, 99)))


def test_a_feed_in_engineering_units_is_refused(counting_feed):
    feed = counting_feed()
    in_counts = feed.advance

    def in_units(n_samples: int) -> RawBlock:
        raw = in_counts(n_samples)
        return RawBlock(**vars(raw) | {"counts": raw.counts.astype(np.float32)})

    feed.advance = in_units
    with pytest.raises(ConfigError, match="carries 16-bit counts, and the feed gives float32"):
        RingDevice(feed)
