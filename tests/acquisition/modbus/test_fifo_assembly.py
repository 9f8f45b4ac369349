"""Records of a queue put in their places: by their counters, channel beside channel."""

import numpy as np
import pytest

from acquisition.errors import FrameError
from acquisition.modbus.counted_samples import CountedSamples
from acquisition.modbus.fifo_assembly import ChannelAssembly, place_records
from acquisition.registers.fifo_layout import FifoPiece


def test_a_counter_that_counts_nothing_is_refused() -> None:
    samples = CountedSamples(600.0, removes=True, epoch=1)
    counters = np.array([5000, 40_000, 12, 33_333])
    with pytest.raises(FrameError, match="does not count"):
        place_records(FifoPiece(counters, np.zeros((2, 4), dtype=np.int16)), samples, 0.0)


def test_channels_that_count_differently_are_not_put_side_by_side() -> None:
    assembly = ChannelAssembly(2, CountedSamples(600.0, removes=True, epoch=1))
    pieces = [
        FifoPiece(first + np.arange(4), np.zeros((1, 4), dtype=np.int16)) for first in (5000, 0)
    ]
    with pytest.raises(FrameError, match="counts -5004 samples apart"):
        assembly.place(pieces, 0.0)


def test_a_channel_that_gives_nothing_holds_the_others_back_in_bounded_memory() -> None:
    assembly = ChannelAssembly(2, CountedSamples(600.0, removes=True, epoch=1))
    nothing = FifoPiece(np.arange(0), np.zeros((1, 0), dtype=np.int16))
    for n in range(1000):
        piece = FifoPiece(30 * n + np.arange(30), np.zeros((1, 30), dtype=np.int16))
        assert assembly.place([piece, nothing], n * 0.05) == []
    assert max(map(len, assembly._waiting)) <= 1100
