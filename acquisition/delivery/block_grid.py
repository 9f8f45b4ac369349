"""`BlockGrid`: the same samples always make the same blocks, whatever the wire cut them into."""

from dataclasses import replace

import numpy as np

from acquisition.delivery.raw import RawBlock
from core.units import NS_PER_S

_STAMP_NS = 1000
"""Resolution of a stamp. It and the single precision of slow values are what every profile can
carry, so that a recording that is replayed over any wire has the very numbers it had."""


class BlockGrid:
    """Cuts and joins raw blocks, so that they begin at multiples of a length and are that long.

    Only where samples are missing, or where the device restarts, is a block shorter. A joined
    block is OK where all its parts are, and has the slow values of its first sample.

    Parameters
    ----------
    block_samples
        Samples of each channel in a block.
    """

    def __init__(self, block_samples: int) -> None:
        self._length = block_samples
        self._parts: list[RawBlock] = []

    def put(self, raw: RawBlock) -> list[RawBlock]:
        """Take what a device delivered; return the blocks that this completes, in order."""
        done = [] if self._continued_by(raw) else self.flush()
        for piece in self._pieces(raw):
            self._parts.append(piece)
            if piece.stop_index % self._length == 0:
                done += self.flush()
        return done

    def flush(self) -> list[RawBlock]:
        """What is left, when nothing will follow on it."""
        parts, self._parts = self._parts, []
        return [_joined(parts)] if parts else []

    def _continued_by(self, raw: RawBlock) -> bool:
        if not self._parts:
            return True
        last = self._parts[-1]
        return (
            not raw.rejected
            and raw.epoch == last.epoch
            and raw.first_index == last.stop_index
            and raw.counts.dtype == last.counts.dtype
        )

    def _pieces(self, raw: RawBlock) -> list[RawBlock]:
        first_cut = -raw.first_index % self._length or self._length
        starts = [0, *range(first_cut, raw.n_samples, self._length)]
        return [
            _part(raw, start, stop)
            for start, stop in zip(starts, [*starts[1:], raw.n_samples], strict=True)
        ]


def _part(raw: RawBlock, start: int, stop: int) -> RawBlock:
    start_ns = raw.start_ns + round(start * NS_PER_S / raw.rate_hz)
    return replace(
        raw,
        first_index=raw.first_index + start,
        start_ns=start_ns // _STAMP_NS * _STAMP_NS,
        counts=raw.counts[:, start:stop],
        slow=tuple(np.array(raw.slow, dtype=np.float32).tolist()),
        rejected=() if start else raw.rejected,
    )


def _joined(parts: list[RawBlock]) -> RawBlock:
    if len(parts) == 1:
        return parts[0]
    return replace(
        parts[0],
        counts=np.concatenate([part.counts for part in parts], axis=1),
        ok=tuple(all(oks) for oks in zip(*(part.ok for part in parts), strict=True)),
    )
