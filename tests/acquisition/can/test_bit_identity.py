"""The same samples through any wire make the same blocks, to the last bit."""

import hashlib
import itertools

import pytest
from rigs.tiers import covering, fast_and_long

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


@pytest.fixture
def both_ways(eventful_feed, shape_of, source_of, counts_calibration, read_up_to):
    """Blocks of a feed straight from the converter, those over the wire, and what was refused."""

    async def read(feed: dict, shape: dict, n_samples: int = 50):
        direct = straight(eventful_feed(**feed), counts_calibration(n_channels=4), n_samples)
        shape = shape_of(**shape)
        device = CanDevice(eventful_feed(**feed), shape, block_samples=n_samples)
        async with SlcanTcpServer(device, on_demand=True) as server:
            source = source_of(shape, server.endpoint, when_full="wait")
            wired = await read_up_to(source, direct[-1].epoch, direct[-1].stop_index)
            await server.run()
        return direct, wired, source.refused_frames

    return read


@pytest.mark.parametrize("seed", fast_and_long(1, 2))
@pytest.mark.parametrize("floats", [False, True], ids=["counts", "floats"])
@pytest.mark.parametrize("fd", [False, True], ids=["classic", "fd"])
async def test_a_recording_with_gaps_and_restarts_comes_through_unchanged(
    fd, floats, seed, both_ways
):
    feed, shape = {"floats": floats, "seed": seed}, {"fd": fd, "floats": floats}
    direct, wired, refused = await both_ways(feed, shape)
    assert fingerprint(wired) == fingerprint(direct)
    assert len({b.epoch for b in direct}) > 1
    assert any(a.stop_index < b.first_index for a, b in itertools.pairwise(direct))
    assert refused == {}


@pytest.mark.parametrize(("n_samples", "kind"), covering([1, 3, 48, 51], list(KINDS)))
async def test_blocks_of_any_length_come_through(kind, n_samples, both_ways):
    """Also where they end within a frame of five samples."""
    direct, wired, _ = await both_ways({"n_blocks": 200}, KINDS[kind], n_samples)
    assert fingerprint(wired) == fingerprint(direct)
