"""The newest samples of a unit as one stretch, holes and bad channels left empty."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.quality import Level, Quality, worst
from core.samples.blocks import SampleBlock
from core.units import ns_from_s


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
