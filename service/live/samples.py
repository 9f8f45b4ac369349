"""Newest samples of a unit: what is held of them, and stretches with holes left empty."""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.quality import Level, Quality, Reading, Reason, mean_reading, missing, worst
from core.samples.blocks import SampleBlock
from core.units import ns_from_s


class BlockHistory:
    """Holds the blocks of the last so many samples; what is repeated is not held twice.

    Parameters
    ----------
    n_samples
        Per channel; one block more than that is held at most.
    """

    def __init__(self, n_samples: int) -> None:
        self._n_wanted = n_samples
        self._n_held = 0
        self._blocks: deque[SampleBlock] = deque()

    def __iter__(self) -> Iterator[SampleBlock]:
        """Oldest first."""
        return iter(self._blocks)

    def add(self, block: SampleBlock) -> bool:
        """Take a block in, and let go of what is too old; return whether there is anything new."""
        if self._blocks and _is_repeated(block, self._blocks[-1]):
            return False
        self._blocks.append(block)
        self._n_held += block.n_samples
        while self._n_held - self._blocks[0].n_samples >= self._n_wanted + block.n_samples:
            self._n_held -= self._blocks.popleft().n_samples
        return True


def _is_repeated(block: SampleBlock, newest: SampleBlock) -> bool:
    return block.epoch == newest.epoch and block.stop_index <= newest.stop_index


@dataclass(frozen=True)
class ShaftStretch:
    """Samples of some channels with consecutive indices of one epoch.

    Parameters
    ----------
    samples
        (n_samples,) of each channel, by id; NaN where there is none, or it is bad.
    slow
        Mean of each slow channel.
    """

    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float
    samples: Mapping[str, FloatArray]
    slow: Mapping[str, Reading]

    def of(self, channel: str | None) -> FloatArray | None:
        """Samples of a channel; None if it is not among them."""
        return None if channel is None else self.samples.get(channel)

    def mean_of(self, slow_channel: str | None) -> Reading:
        """Mean of a slow channel."""
        return self.slow.get(slow_channel or "", missing(Reason.NOT_MEASURED))


def stretch_of(
    blocks: Sequence[SampleBlock], rows: Mapping[str, int], first_index: int, n_samples: int
) -> ShaftStretch:
    """Lay blocks side by side.

    Parameters
    ----------
    blocks
        Of one epoch, oldest first, at least one; what lies outside the stretch is left out.
    rows
        Where channels stand in the blocks, by id.
    """
    samples = {id_: np.full(n_samples, np.nan) for id_ in rows}
    for block in blocks:
        start = max(block.first_index, first_index)
        stop = min(block.stop_index, first_index + n_samples)
        for id_, row in rows.items():
            if start < stop and block.channel_quality[row].level is not Level.BAD:
                part = block.samples[row, start - block.first_index : stop - block.first_index]
                samples[id_][start - first_index : stop - first_index] = part
    nearest = blocks[0]
    offset_s = (first_index - nearest.first_index) / nearest.rate_hz
    return ShaftStretch(
        epoch=nearest.epoch,
        first_index=first_index,
        start_ns=nearest.start_ns + ns_from_s(offset_s),
        rate_hz=nearest.rate_hz,
        samples=samples,
        slow={id_: mean_reading([b.slow[id_] for b in blocks]) for id_ in nearest.slow},
    )


def newest_of(blocks: Sequence[SampleBlock], seconds: float) -> tuple[list[SampleBlock], int, int]:
    """The newest blocks, and first index and number of the newest samples; at least one block."""
    newest = blocks[-1]
    since = newest.stop_index - max(1, round(seconds * newest.rate_hz))
    held = [b for b in blocks if b.epoch == newest.epoch and b.stop_index > since]
    first_index = max(since, held[0].first_index)
    return held, first_index, newest.stop_index - first_index


@dataclass(frozen=True)
class Stretch:
    """Consecutive indices of one epoch.

    Parameters
    ----------
    samples
        (n_channels, n_samples); NaN where there is none, or it is bad.
    quality
        For each channel, the worst of the blocks.
    """

    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float
    samples: FloatArray
    quality: tuple[Quality, ...]


def newest_stretch(blocks: Sequence[SampleBlock], rows: Sequence[int], n_samples: int) -> Stretch:
    """The newest samples of some rows; fewer than asked for if no more are held.

    Parameters
    ----------
    blocks
        At least one, oldest first.
    """
    newest = blocks[-1]
    stop, since = newest.stop_index, newest.stop_index - n_samples
    held = [b for b in blocks if b.epoch == newest.epoch and b.stop_index > since]
    first = max(since, min(block.first_index for block in held))
    samples = np.full((len(rows), stop - first), np.nan)
    for block in held:
        _lay(block, rows, first, samples)
    return Stretch(
        epoch=newest.epoch,
        first_index=first,
        start_ns=newest.stop_ns - ns_from_s((stop - first) / newest.rate_hz),
        rate_hz=newest.rate_hz,
        samples=samples,
        quality=tuple(worst(block.channel_quality[row] for block in held) for row in rows),
    )


def _lay(block: SampleBlock, rows: Sequence[int], first: int, samples: FloatArray) -> None:
    begin = max(block.first_index, first)
    for number, row in enumerate(rows):
        if block.channel_quality[row].level is not Level.BAD:
            part = block.samples[row, begin - block.first_index :]
            samples[number, begin - first : begin - first + part.size] = part
