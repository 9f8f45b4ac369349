"""Consecutive samples out of blocks, holes and bad channels left empty."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.quality import Level, Reading, Reason, mean_reading, missing
from core.samples.blocks import SampleBlock
from core.units import ns_from_s


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
