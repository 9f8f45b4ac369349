"""The same samples through any wire make the same blocks, to the last bit."""

import hashlib
import itertools

import pytest
from rigs.tiers import covering, fast_and_long

from acquisition.clock import SystemClock
from acquisition.daq.can_device import CanDevice
from acquisition.daq.can_slcan import SlcanTcpServer
from acquisition.delivery import Delivery
from acquisition.raw import FeedEndedError

LONG_IDS = {"extended": True, "base_id": 0x18FF0100}
KINDS = {
    "classic": {},
    "fd": {"fd": True},
    "classic, long ids": LONG_IDS,
    "fd, long ids": {"fd": True, **LONG_IDS},
}


def fingerprint(blocks) -> list[str]:
    """A hash of everything in a block but how the host's clock stands."""
    return [
        hashlib.sha256(
            repr(
                (
                    b.unit, b.epoch, b.first_index, b.start_ns, b.rate_hz, b.samples.tobytes(),
                    b.samples.dtype, b.samples.shape, b.channel_quality, sorted(b.slow.items()),
                    b.rejected, b.stamp_fault,
                )
            ).encode()
        ).hexdigest()
        for b in blocks
    ]  # fmt: skip


def straight(feed, calibration, n_samples: int = 50) -> list:
    delivery = Delivery(calibration)
    blocks = []
    try:
        while True:
            blocks += delivery.take(feed.advance(n_samples))
    except FeedEndedError:
        return blocks


@pytest.mark.parametrize("seed", fast_and_long(1, 2))
@pytest.mark.parametrize("floats", [False, True], ids=["counts", "floats"])
@pytest.mark.parametrize("fd", [False, True], ids=["classic", "fd"])
async def test_a_recording_with_gaps_and_restarts_comes_through_unchanged(
    fd, floats, seed, eventful_feed, shape_of, source_of, counts_calibration, read_up_to
):
    direct = straight(eventful_feed(floats=floats, seed=seed), counts_calibration(n_channels=4))
    shape = shape_of(fd=fd, floats=floats)
    device = CanDevice(eventful_feed(floats=floats, seed=seed), shape)
    async with SlcanTcpServer(device, on_demand=True) as server:
        source = source_of(shape, server.endpoint, when_full="wait")
        wired = await read_up_to(source, direct[-1].epoch, direct[-1].stop_index)
        await server.run()
    assert fingerprint(wired) == fingerprint(direct)
    assert len({b.epoch for b in direct}) > 1
    assert any(a.stop_index < b.first_index for a, b in itertools.pairwise(direct))
    assert source.refused_frames == {}


@pytest.mark.parametrize(("n_samples", "kind"), covering([1, 3, 48, 51], list(KINDS)))
async def test_blocks_of_any_length_come_through(
    kind, n_samples, eventful_feed, shape_of, source_of, counts_calibration, read_up_to
):
    """Also where they end within a frame of five samples."""
    feeds = [eventful_feed(n_blocks=200) for _ in range(2)]
    direct = straight(feeds[0], counts_calibration(n_channels=4), n_samples)
    shape = shape_of(**KINDS[kind])
    device = CanDevice(feeds[1], shape, block_samples=n_samples)
    async with SlcanTcpServer(device, on_demand=True) as server:
        source = source_of(shape, server.endpoint, when_full="wait")
        wired = await read_up_to(source, direct[-1].epoch, direct[-1].stop_index)
    assert fingerprint(wired) == fingerprint(direct)


async def test_a_paced_daq_serves_the_same_at_any_speed(
    eventful_feed, shape_of, source_of, counts_calibration, read_up_to, stepped_clock
):
    direct = straight(eventful_feed(), counts_calibration(n_channels=4))
    shape = shape_of()
    device = CanDevice(eventful_feed(), shape)
    async with SlcanTcpServer(device, stepped_clock) as server:
        source = source_of(shape, server.endpoint, clock=SystemClock(), when_full="wait")
        wired = await read_up_to(source, direct[-1].epoch, direct[-1].stop_index)
        await server.run()
    assert fingerprint(wired) == fingerprint(direct)
    assert stepped_clock.monotonic_s() > direct[-1].stop_index / 600.0
