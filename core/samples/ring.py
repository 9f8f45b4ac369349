"""Ring buffer of the newest samples of one unit, with an account of missing samples."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from core.arrays import IntArray, SampleArray
from core.checks.channels import worst_qualities
from core.quality import NOT_MEASURED, Quality, Reading, mean_reading
from core.samples.blocks import SampleBlock
from core.samples.gaps import Gap, SampleAccount, n_missed
from core.units import ns_from_s


@dataclass(frozen=True)
class Window:
    """Window of consecutive samples of one epoch.

    Parameters
    ----------
    start_ns
        Time of the first sample, UTC nanoseconds since 1970.
    samples : (n_channels, n_samples)
        Samples in the engineering unit of each channel.
    channel_quality
        Worst quality of each channel within the window.
    slow
        Mean of each slow channel, by id.
    """

    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float
    samples: SampleArray
    channel_quality: tuple[Quality, ...]
    slow: Mapping[str, Reading] = field(default_factory=dict)

    @property
    def n_samples(self) -> int:
        """Number of samples per channel."""
        return int(self.samples.shape[1])

    @property
    def stop_index(self) -> int:
        """Index of the first sample after the window."""
        return self.first_index + self.n_samples

    @property
    def stop_ns(self) -> int:
        """Time of the first sample after the window, UTC nanoseconds since 1970."""
        return self.start_ns + ns_from_s(self.n_samples / self.rate_hz)


@dataclass(frozen=True)
class _Part:
    """Part of a block in a window: ranges of cells and samples, and number of samples per cell."""

    block: SampleBlock
    cells: slice
    samples: slice
    weights: IntArray

    @classmethod
    def of(cls, block: SampleBlock, first_index: int, stop_index: int) -> "_Part":
        start = max(0, first_index - block.first_index)
        stop = min(block.n_samples, stop_index - block.first_index)
        starts = block.side.starts
        first = int(np.searchsorted(starts, start, side="right")) - 1
        cells = slice(first, int(np.searchsorted(starts, stop)))
        edges = np.append(starts[cells], stop)
        edges[0] = start
        return cls(block, cells, slice(start, stop), np.diff(edges))

    def readings(self, slow_channel: str) -> list[Reading]:
        """Return the readings of a slow channel, one for each cell."""
        block, n_cells = self.block, len(self.weights)
        if slow_channel in block.elsewhere:
            return [block.elsewhere[slow_channel]] * n_cells
        if slow_channel not in block.calibration.slow_ids:
            return [NOT_MEASURED] * n_cells
        row = block.calibration.slow_ids.index(slow_channel)
        channel = block.calibration.slow[row]
        return [channel.reading(value) for value in block.side.slow[row, self.cells].tolist()]


class Ring:
    """Ring buffer of the newest blocks of one epoch; samples are addressed by index.

    `capacity` is the number of samples held per channel.

    Attributes
    ----------
    epoch, stop_index
        Epoch (None before the first block), and index of the first sample after the newest one.
    contiguous_from
        Index of the first sample after the newest gap.
    account
        Balance of the samples that the device offered.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._blocks: deque[SampleBlock] = deque()
        self.contiguous_from = 0
        self.epoch: int | None = None
        self.stop_index = 0
        self._stop_ns = 0
        self.account = SampleAccount()

    def write(self, block: SampleBlock) -> Gap | None:
        """Append a block and return the gap of lost or rejected samples before it, or None.

        Repeated samples are counted in `account` and dropped. Not more rejected samples are counted
        than the index shows to be missing.
        """
        if self.epoch is None:  # earlier samples do not count as offered
            self.epoch, self.stop_index = block.epoch, block.first_index
            self.contiguous_from = block.first_index
        if block.epoch == self.epoch:
            n_missing = max(block.first_index - self.stop_index, 0)
        else:
            n_missing = n_missed(self._stop_ns, block)
            self._blocks.clear()
            self.epoch, self.stop_index, self.contiguous_from = block.epoch, 0, 0
            self.account = replace(self.account, n_restarts=self.account.n_restarts + 1)
        self.account = self.account.with_missing(n_missing, block.rejected)
        if block.first_index > self.stop_index:
            self.contiguous_from = self.stop_index = block.first_index
        self._take(block)
        if not n_missing:
            return None
        first_index = block.first_index - n_missing
        is_estimated = any(rejection.is_estimated for rejection in block.rejected)
        return Gap(block.epoch, first_index, n_missing, block.start_ns, is_estimated=is_estimated)

    def holds(self, first_index: int, stop_index: int) -> bool:
        """Whether the ring holds the samples `first_index` to `stop_index - 1` without a gap."""
        oldest = max(self.contiguous_from, self.stop_index - self._capacity)
        return oldest <= first_index <= stop_index <= self.stop_index

    def read(self, first_index: int, stop_index: int) -> Window:
        """Return the calibrated window of the samples `first_index` to `stop_index - 1`.

        Raises LookupError if the ring does not hold all of these samples, or the range is empty.
        """
        if first_index == stop_index or not self.holds(first_index, stop_index):
            raise LookupError(f"samples {first_index} to {stop_index - 1} are not in the buffer")
        parts = [
            _Part.of(block, first_index, stop_index)
            for block in self._blocks
            if block.first_index < stop_index and block.stop_index > first_index
        ]
        block, cell = parts[0].block, parts[0].cells.start
        n_before = first_index - block.first_index - int(block.side.starts[cell])
        verdicts = np.concatenate([p.block.verdicts[:, p.cells] for p in parts], axis=1)
        return Window(
            epoch=block.epoch,
            first_index=first_index,
            start_ns=int(block.side.start_ns[cell]) + ns_from_s(n_before / block.rate_hz),
            rate_hz=block.rate_hz,
            samples=_units(parts),
            channel_quality=worst_qualities(verdicts),
            slow=_slow_means(parts),
        )

    def _take(self, block: SampleBlock) -> None:
        n_repeated = min(self.stop_index - block.first_index, block.n_samples)
        fresh = block.from_sample(n_repeated)
        n_flagged = 0
        if fresh.verdicts.any():
            lengths = np.diff(fresh.side.starts, append=fresh.n_samples)
            n_flagged = int(lengths[fresh.verdicts.any(axis=0)].sum())
        self.account = self.account.with_taken(fresh.n_samples, n_flagged, n_repeated)
        if fresh.n_samples == 0:
            return
        self._blocks.append(fresh)
        self.stop_index, self._stop_ns = fresh.stop_index, fresh.stop_ns
        while self._blocks[0].stop_index <= self.stop_index - self._capacity:
            self._blocks.popleft()


def _units(parts: Sequence[_Part]) -> SampleArray:
    """Return the samples of consecutive parts in engineering units, (n_channels, n_samples)."""
    calibration = parts[0].block.calibration
    if all(
        part.block.calibration is calibration and part.block.counts.dtype == np.int16
        for part in parts
    ):
        counts = np.concatenate([part.block.counts[:, part.samples] for part in parts], axis=1)
        return calibration.to_units(counts)
    return np.concatenate([part.block.samples[:, part.samples] for part in parts], axis=1)


def _slow_means(parts: Sequence[_Part]) -> dict[str, Reading]:
    """Return the mean of each slow channel by id, weighted by the samples of each cell."""
    first = parts[0].block
    weights = np.concatenate([part.weights for part in parts])
    are_alike = all(part.block.calibration is first.calibration for part in parts)
    found = {}
    for row, channel in enumerate(first.calibration.slow if are_alike else ()):
        values = np.concatenate([part.block.side.slow[row, part.cells] for part in parts])
        found[channel.id] = channel.mean(values, weights)
    for id_ in first.elsewhere if are_alike else first.slow:
        readings = [reading for part in parts for reading in part.readings(id_)]
        found[id_] = mean_reading(readings, weights.tolist())
    return found
