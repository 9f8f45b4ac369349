"""Conversion of file rows to blocks: detects gaps and device restarts in the time stamps."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ImportJob
from acquisition.recordings.imports.times import TimeArray
from core.arrays import FloatArray, RawArray
from core.samples.blocks import SampleBlock, SideValues
from core.units import NS_PER_S

_PIECE = 512
"""Rows compared with one straight line of times; few enough to neglect clock drift."""

_FIRST_ROWS = 64
_FOLLOWED_ROWS = 256
"""Rows over which the line is averaged: enough to smooth jitter, few enough to follow drift."""

_GAP_STEP = 1.5

_MEDIAN_STEP = (0.6, 1.4)
"""Range of the median time step in samples if the rate is correct, even with coarse stamps."""

_MIN_STEPS = 16


@dataclass(frozen=True)
class Rows:
    """Consecutive rows of a file: simultaneous samples of all channels.

    Parameters
    ----------
    times_ns : (n_rows,)
        Times of the rows, UTC in nanoseconds.
    samples : (n_channels, n_rows)
        int16 counts or float32 engineering units.
    slow
        (n_rows,) values of each slow channel, valid at the time of the row.
    done
        Fraction of the file that has been read.
    """

    times_ns: TimeArray
    samples: RawArray
    slow: tuple[FloatArray, ...]
    done: float


@dataclass(frozen=True)
class Stretch:
    """Range of rows without a gap, `stop` excluded, with epoch and index of its first sample."""

    start: int
    stop: int
    epoch: int
    first_index: int


class Indexer:
    """Assigner of sample indices to rows by their time stamps, at the sampling rate of the unit.

    A line of constant rate is fitted to the stamps and follows the drift of their clock. A step off
    the line by a whole number of samples is a gap of that length. A step by a fraction of a sample
    after a pause is a restart of the device and starts a new epoch. All other steps, and a
    different rate, raise an error. Nothing is interpolated.

    `tolerance` is the maximum deviation of a stamp from the line, in samples.
    """

    def __init__(self, rate_hz: float, tolerance: float) -> None:
        self._period_ns = NS_PER_S / rate_hz
        self._rate_hz = rate_hz
        self._tolerance = tolerance
        self._row = 0
        self._epoch = 0
        self._next_index = 0
        self._expected_ns: float | None = None
        self._origin_ns = 0
        self._last_ns = 0

    def stretches(self, times_ns: TimeArray) -> Iterator[Stretch]:
        """Yield the ranges without a gap in the next rows, given by their times (n,).

        Raises ConfigError if times decrease, are irregular or have a wrong rate; the message names
        the row.
        """
        start = 0
        while start < len(times_ns):
            if self._expected_ns is None:
                self._lay_line(times_ns[start : start + _FIRST_ROWS])
            piece = times_ns[start : start + _PIECE]
            n_fit = self._n_fitting(piece)
            if n_fit:
                yield Stretch(start, start + n_fit, self._epoch, self._next_index)
                self._pass(piece[:n_fit])
                start += n_fit
            if n_fit < len(piece):
                self._step(int(times_ns[start]), piece)

    def _lay_line(self, piece: TimeArray) -> None:
        """Fit the phase of the line to the first stamps, unaffected by gaps of whole samples."""
        self._origin_ns, self._expected_ns = int(piece[0]), 0.0
        turns = np.exp(2j * np.pi * self._deviations(piece))
        self._expected_ns = float(np.angle(turns.mean())) / (2 * np.pi) * self._period_ns

    def _deviations(self, piece: TimeArray) -> np.ndarray:
        """Return the deviations of the stamps from the line, in samples."""
        since_ns = (piece - self._origin_ns).astype(np.float64) - (self._expected_ns or 0.0)
        return np.asarray(since_ns / self._period_ns - np.arange(len(piece)))

    def _n_fitting(self, piece: TimeArray) -> int:
        off = np.abs(self._deviations(piece)) > self._tolerance
        self._require_rate(piece)
        return int(off.argmax()) if off.any() else len(piece)

    def _pass(self, piece: TimeArray) -> None:
        gain = len(piece) / (len(piece) + _FOLLOWED_ROWS)
        off_ns = float(self._deviations(piece).mean()) * self._period_ns
        ahead_ns = (self._expected_ns or 0.0) + len(piece) * self._period_ns + gain * off_ns
        moved = int(piece[-1]) - self._origin_ns
        self._origin_ns, self._expected_ns = int(piece[-1]), ahead_ns - moved
        self._last_ns = int(piece[-1])
        self._next_index += len(piece)
        self._row += len(piece)

    def _step(self, time_ns: int, piece: TimeArray) -> None:
        """Update index or epoch for a gap or a device restart before the row at this time."""
        step = (time_ns - self._last_ns) / self._period_ns
        if step <= 0:
            raise ConfigError(
                f"row {self._row + 1}: times must increase, but this time is {abs(step):.3g}"
                " sampling periods before that of the previous row (0: equal)"
            )
        off = float(self._deviations(np.array([time_ns], dtype=np.int64))[0])
        n_missing = round(off)
        is_whole = abs(off - n_missing) <= self._tolerance
        in_one_step = abs(step - 1 - n_missing) <= 2 * self._tolerance
        if step < _GAP_STEP or not in_one_step or n_missing < 1:
            raise self._irregular(piece, f"the time stamp deviates by {off:+.3f} sampling periods")
        if is_whole:
            self._next_index += n_missing
            self._expected_ns = (self._expected_ns or 0.0) + n_missing * self._period_ns
        else:
            self._epoch, self._next_index = self._epoch + 1, 0
            self._expected_ns = None

    def _require_rate(self, piece: TimeArray) -> None:
        """Raise ConfigError if the rate of the stamps is wrong; each step would look like a gap."""
        steps = np.diff(piece) / self._period_ns
        if len(steps) >= _MIN_STEPS or (self._row == 0 and len(steps) > 1):
            low, high = _MEDIAN_STEP
            if not low <= float(np.median(steps)) <= high:
                raise self._irregular(
                    piece, f"the median step is {np.median(steps):.4g} sampling periods"
                )

    def _irregular(self, piece: TimeArray, what: str) -> ConfigError:
        steps = np.diff(piece)
        plain = steps[(steps > 0) & (steps <= 2 * np.median(steps))] if len(steps) else steps
        found = f", found about {NS_PER_S / plain.mean():.6g} Hz" if len(plain) else ""
        return ConfigError(
            f"row {self._row + 1}: {what}; expected samples at {self._rate_hz:.9g} Hz{found};"
            " padwatch does not resample"
        )


def sample_blocks(table: Iterable[Rows], job: ImportJob) -> Iterator[tuple[SampleBlock, float]]:
    """Yield the blocks of a file in order, each with the fraction of the file read so far.

    A block ends at a gap and at the end of each piece read. Its cells begin at multiples of the
    unit's block length; the slow values of a cell are those valid at its first sample.

    Raises ConfigError if the times are inconsistent with the sampling rate of the unit.
    """
    indexer, calibration = Indexer(job.rate_hz, job.time.tolerance), job.calibration
    for rows in table:
        for stretch in indexer.stretches(rows.times_ns):
            length, first_index = job.block_samples, stretch.first_index
            to_grid = -first_index % length or length
            starts = np.append(0, np.arange(to_grid, stretch.stop - stretch.start, length))
            at = stretch.start + starts
            slow = np.array([values[at] for values in rows.slow]).reshape(-1, len(at))
            is_ok = np.ones((len(job.channels), len(at)), dtype=np.bool_)
            yield (
                SampleBlock(
                    calibration=calibration,
                    epoch=stretch.epoch,
                    first_index=first_index,
                    counts=rows.samples[:, stretch.start : stretch.stop],
                    side=SideValues(starts, rows.times_ns[at], is_ok, slow),
                ),
                rows.done,
            )
