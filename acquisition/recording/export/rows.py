"""A recording as rows: what every exported file has."""

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from acquisition.calibration import calibrate, slow_reading
from acquisition.errors import ConfigError
from acquisition.raw import RawBlock
from acquisition.recording.manifest import Manifest
from acquisition.recording.reader import Recording
from core.arrays import FloatArray, SampleArray
from core.machine import Measurand
from core.quality import Level
from core.units import NS_PER_S

UNITS = {
    Measurand.GAP_UM: "um",
    Measurand.DISPLACEMENT_UM: "um",
    Measurand.VELOCITY_MM_S: "mm/s",
    Measurand.ACCELERATION_M_S2: "m/s2",
    Measurand.KEY_PHASE_V: "V",
}
"""Of waveform channels, spelt so that every tool can print them."""

_BLOCKS_AT_ONCE = 512


@dataclass(frozen=True)
class ExportRows:
    """Samples one after the other. Where some are missing there are no rows: time and index jump.

    Parameters
    ----------
    times_ns, epochs, index
        (n,) int64; UTC in whole microseconds.
    samples
        (n_channels, n) engineering units; NaN where a channel was bad.
    block_rows
        (n_blocks,) first row of each block.
    slow
        (n_slow, n_blocks) one value for each block; NaN where there was none, or none that can be.
    """

    times_ns: np.ndarray
    epochs: np.ndarray
    index: np.ndarray
    samples: SampleArray
    block_rows: np.ndarray
    slow: FloatArray

    @property
    def slow_of_rows(self) -> FloatArray:
        """(n_slow, n) the value of its block for every row."""
        lengths = np.diff([*self.block_rows, len(self.index)])
        return np.repeat(self.slow, lengths, axis=1)


def require_free_names(ids: Collection[str], taken: Collection[str]) -> None:
    """Refuse channels that are called as the file itself calls something else.

    Raises
    ------
    ConfigError
        Naming the first.
    """
    for id_ in ids:
        if id_ in taken:
            raise ConfigError(f"channel {id_!r} has a name that such a file needs itself; take csv")


class Exporter(Protocol):
    """A file that is being written."""

    def write(self, rows: ExportRows) -> None:
        """Append rows."""
        ...

    def close(self) -> None:
        """Finish the file."""
        ...


def export_rows(recording: Recording) -> Iterator[ExportRows]:
    """All rows of a recording, some thousands at once.

    Raises
    ------
    ConfigError
        If a file of the recording cannot be read any more.
    """
    waiting: list[RawBlock] = []
    for raw in recording.raw_blocks():
        waiting.append(raw)
        if len(waiting) == _BLOCKS_AT_ONCE:
            yield _rows(waiting, recording.manifest)
            waiting = []
    if waiting:
        yield _rows(waiting, recording.manifest)


def _rows(blocks: list[RawBlock], manifest: Manifest) -> ExportRows:
    lengths = [block.n_samples for block in blocks]
    slow = [_slow(block, manifest) for block in blocks]
    return ExportRows(
        times_ns=np.concatenate([_times_ns(block) for block in blocks]),
        epochs=np.repeat([block.epoch for block in blocks], lengths),
        index=np.concatenate([np.arange(b.first_index, b.stop_index) for b in blocks]),
        samples=np.concatenate([_samples(block, manifest) for block in blocks], axis=1),
        block_rows=np.cumsum([0, *lengths[:-1]]),
        slow=np.array(slow, dtype=np.float64).reshape(len(blocks), -1).T,
    )


def _times_ns(block: RawBlock) -> np.ndarray:
    since_ns = np.rint(np.arange(block.n_samples) * (NS_PER_S / block.rate_hz)).astype(np.int64)
    return np.asarray((block.start_ns + since_ns) // 1000 * 1000)


def _samples(block: RawBlock, manifest: Manifest) -> SampleArray:
    calibrated = calibrate(block, manifest.calibration)
    bad = [quality.level is Level.BAD for quality in calibrated.channel_quality]
    return np.where(np.array(bad)[:, np.newaxis], np.float32(np.nan), calibrated.samples)


def _slow(block: RawBlock, manifest: Manifest) -> list[float]:
    channels = manifest.calibration.slow
    readings = [slow_reading(v, c) for v, c in zip(block.slow, channels, strict=True)]
    return [math.nan if reading.value is None else reading.value for reading in readings]
