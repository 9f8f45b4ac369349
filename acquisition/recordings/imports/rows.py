"""`Rows`: what every reader makes of its file, and the blocks that come of them."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from acquisition.delivery.blocks import BlockGrid
from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ImportJob
from acquisition.recordings.imports.stretches import Indexer, Stretch
from acquisition.recordings.imports.times import TimeArray
from core.arrays import FloatArray, RawArray


@dataclass(frozen=True)
class SlowValues:
    """Values of a slow channel and since when each was valid."""

    times_ns: TimeArray
    values: FloatArray


@dataclass(frozen=True)
class Rows:
    """Samples of all channels at the same times, in the order of the file.

    Parameters
    ----------
    samples
        (n_channels, n_rows) int16 counts or float32 engineering units.
    slow
        For each slow channel what is new up to the last of the rows.
    done
        Share of the file that has been read.
    """

    times_ns: TimeArray
    samples: RawArray
    slow: tuple[SlowValues, ...]
    done: float


class Table(Protocol):
    """An opened file."""

    sample_type: str
    """"int16" or "float32"."""

    def rows(self) -> Iterator[Rows]:
        """All rows; raises ConfigError where the file is not what it should be."""
        ...


class _Hold:
    """The last value that was valid at a time."""

    def __init__(self, id_: str) -> None:
        self._id = id_
        self._times_ns = np.empty(0, np.int64)
        self._values = np.empty(0)
        self._value = np.nan

    def put(self, new: SlowValues) -> None:
        times_ns = np.concatenate([self._times_ns, new.times_ns])
        if np.any(np.diff(times_ns) < 0):
            raise ConfigError(f"the time of slow channel {self._id} goes back")
        self._times_ns, self._values = times_ns, np.concatenate([self._values, new.values])

    def at(self, time_ns: int) -> float:
        n_passed = int(np.searchsorted(self._times_ns, time_ns, side="right"))
        if n_passed:
            self._value = float(self._values[n_passed - 1])
            self._times_ns, self._values = self._times_ns[n_passed:], self._values[n_passed:]
        return self._value


def raw_blocks(tables: Iterable[Rows], job: ImportJob) -> Iterator[tuple[RawBlock, float]]:
    """Blocks on the unit's grid, each with the share of the file that has been read.

    A slow channel has in each block the value that was valid at the block's first sample.

    Raises
    ------
    ConfigError
        If the times cannot be those of samples at the unit's rate.
    """
    indexer = Indexer(job.rate_hz, job.time.tolerance)
    grid = BlockGrid(job.block_samples)
    holds = [_Hold(column.id) for column in job.slow]
    done = 0.0
    for rows in tables:
        done = rows.done
        for hold, new in zip(holds, rows.slow, strict=True):
            hold.put(new)
        for stretch in indexer.stretches(rows.times_ns):
            for raw in _pieces(rows, stretch, holds, job):
                yield from ((block, done) for block in grid.put(raw))
    yield from ((block, 1.0) for block in grid.flush())


def _pieces(rows: Rows, stretch: Stretch, holds: list[_Hold], job: ImportJob) -> Iterator[RawBlock]:
    """Parts of a stretch that begin at multiples of the grid, so that slow values are theirs."""
    to_grid = -stretch.first_index % job.block_samples or job.block_samples
    starts = [stretch.start, *range(stretch.start + to_grid, stretch.stop, job.block_samples)]
    for start, stop in zip(starts, [*starts[1:], stretch.stop], strict=True):
        time_ns = int(rows.times_ns[start])
        yield RawBlock(
            epoch=stretch.epoch,
            first_index=stretch.first_index + start - stretch.start,
            start_ns=time_ns,
            rate_hz=job.rate_hz,
            counts=rows.samples[:, start:stop],
            ok=(True,) * len(job.channels),
            slow=tuple(hold.at(time_ns) for hold in holds),
        )
