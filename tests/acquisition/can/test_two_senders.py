"""C9: two devices under the same ids: neither is believed, and the reason is told."""

from contextlib import AsyncExitStack
from dataclasses import replace

import numpy as np
import pytest
from rigs.tiers import covering

from acquisition.daq.can_bus import CanBusServer
from acquisition.daq.can_device import CanDevice
from acquisition.errors import LinkError

N_BLOCKS = 40
MOST_BELIEVED = 200
"""Samples that may pass until it is noticed: a third of a second."""


class Twin:
    """What a second module measures; it began to count elsewhere."""

    def __init__(self, feed, ahead: int) -> None:
        self._feed = feed
        self._ahead = ahead

    def advance(self, n_samples: int):
        raw = self._feed.advance(n_samples)
        counts = ((raw.counts.astype(int) + 1000) % 2**15).astype(np.int16)
        return replace(raw, first_index=raw.first_index + self._ahead, counts=counts)


async def read_to_the_end(stream) -> tuple[int, str]:
    """How many samples came until the link was given up, and why it was."""
    n_samples = 0
    try:
        async for block in stream:
            n_samples += block.n_samples
    except LinkError as error:
        return n_samples, str(error)
    raise AssertionError("the stream has ended")


@pytest.mark.parametrize(("ahead", "fd"), covering([0, 3, 50, 100_000], [True, False]))
async def test_two_modules_with_the_same_ids_are_not_believed_until_one_is_unplugged(
    fd, ahead, shape_of, source_of, counting_feed
):
    shape = shape_of(fd=fd)
    device = CanDevice(counting_feed(n_channels=4), shape)
    twin = CanDevice(Twin(counting_feed(n_channels=4), ahead), shape)
    channel = f"two senders {fd} {ahead}"
    async with AsyncExitStack() as plugs:
        server = await plugs.enter_async_context(CanBusServer(device, channel=channel))
        source = source_of(shape, server.endpoint, stale_after_s=1.0)
        async with CanBusServer(twin, channel=channel) as second, source.connect() as stream:
            for _ in range(N_BLOCKS):
                server.produce()
                second.produce()
            n_samples, reason = await read_to_the_end(stream)
        assert "no credible sample" in reason
        assert "do two devices send the same ids?" in reason
        assert n_samples <= MOST_BELIEVED
        server.produce(60)  # one is unplugged: that it is alone must show first
        async with source.connect() as stream:
            block = await anext(stream)
    assert block.stop_index <= (N_BLOCKS + 60) * 50
    index = np.arange(block.first_index, block.stop_index)
    np.testing.assert_array_equal(block.samples[0], index % 2**15)


async def test_a_module_that_sends_each_frame_twice_is_believed(shape, device, source_of):
    async with CanBusServer(device, channel="each frame twice") as server:
        source = source_of(shape, server.endpoint)
        server.inject("repeat", N_BLOCKS * 50 * len(shape.waves))
        async with source.connect() as stream:
            server.produce(N_BLOCKS)
            blocks = [await anext(stream) for _ in range(N_BLOCKS)]
    assert blocks[-1].stop_index == N_BLOCKS * 50
    assert set(source.refused_frames) == {"duplicate_frame"}
