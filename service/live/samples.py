"""Newest sample blocks of a unit, and windows of their samples with NaN in place of gaps."""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from core.arrays import FloatArray
from core.quality import Level, Quality, Reading, Reason, mean_reading, missing, worst
from core.samples.blocks import SampleBlock
from core.units import ns_from_s


class BlockHistory:
    """Newest blocks of a unit, without repeated blocks.

    `n_samples` is the minimum number of newest samples per channel to keep.
    """

    def __init__(self, n_samples: int) -> None:
        self._n_wanted = n_samples
        self._n_held = 0
        self._blocks: deque[SampleBlock] = deque()

    def __iter__(self) -> Iterator[SampleBlock]:
        """Iterate from the oldest block to the newest."""
        return iter(self._blocks)

    def add(self, block: SampleBlock) -> bool:
        """Add a block and drop old ones; return False, without changes, for a repeated block."""
        if self._blocks:
            newest = self._blocks[-1]
            if block.epoch == newest.epoch and block.stop_index <= newest.stop_index:
                return False
        self._blocks.append(block)
        self._n_held += block.n_samples
        while self._n_held - self._blocks[0].n_samples >= self._n_wanted + block.n_samples:
            self._n_held -= self._blocks.popleft().n_samples
        return True


@dataclass(frozen=True)
class SampleWindow:
    """Samples of some channels with consecutive indices of one epoch.

    Parameters
    ----------
    samples
        Samples (n_samples,) of each channel in the unit of the channel, by channel id; NaN for
        missing or bad samples.
    slow
        Mean of each slow channel, by id.
    quality
        Worst quality of each channel over all blocks of the window, by id.
    """

    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float
    samples: Mapping[str, FloatArray]
    slow: Mapping[str, Reading]
    quality: Mapping[str, Quality] = field(default_factory=dict)

    def of(self, channel: str | None) -> FloatArray | None:
        """Return the samples of a channel; None if the window does not contain the channel."""
        return None if channel is None else self.samples.get(channel)

    def mean_of(self, slow_channel: str | None) -> Reading:
        """Return the mean of a slow channel; a missing reading for None or an unknown channel."""
        return self.slow.get(slow_channel or "", missing(Reason.NOT_MEASURED))


def sample_window(
    blocks: Sequence[SampleBlock],
    rows: Mapping[str, int],
    first_index: int,
    n_samples: int,
    stamp: SampleBlock | None = None,
) -> SampleWindow:
    """Return the window of `n_samples` samples per channel that begins at `first_index`.

    Parameters
    ----------
    blocks
        At least one block, oldest first, all of one epoch; they may extend beyond the window.
    rows
        Index of the row of each requested channel in the sample arrays of the blocks, by channel
        id.
    stamp
        Block whose time stamp determines the start time; by default, the oldest block.
    """
    samples = {id_: np.full(n_samples, np.nan) for id_ in rows}
    for block in blocks:
        start = max(block.first_index, first_index)
        stop = min(block.stop_index, first_index + n_samples)
        for id_, row in rows.items():
            if start < stop and block.channel_quality[row].level is not Level.BAD:
                part = block.samples[row, start - block.first_index : stop - block.first_index]
                samples[id_][start - first_index : stop - first_index] = part
    stamp = stamp or blocks[0]
    return SampleWindow(
        epoch=stamp.epoch,
        first_index=first_index,
        start_ns=stamp.start_ns + ns_from_s((first_index - stamp.first_index) / stamp.rate_hz),
        rate_hz=stamp.rate_hz,
        samples=samples,
        slow={id_: mean_reading([b.slow[id_] for b in blocks]) for id_ in stamp.slow},
        quality={id_: worst(b.channel_quality[row] for b in blocks) for id_, row in rows.items()},
    )


def newest_blocks(
    blocks: Sequence[SampleBlock], n_samples: int
) -> tuple[list[SampleBlock], int, int]:
    """Return the blocks with the newest samples, the first sample index, and the sample count.

    `blocks` has at least one block, oldest first; only blocks of the newest epoch are returned.
    The returned number of samples is below `n_samples` if the blocks have fewer.
    """
    newest = blocks[-1]
    since = newest.stop_index - n_samples
    held = [b for b in blocks if b.epoch == newest.epoch and b.stop_index > since]
    first_index = max(since, held[0].first_index)
    return held, first_index, newest.stop_index - first_index
