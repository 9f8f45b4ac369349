"""`RecordingWriter`: atomic writing of a recording from sample blocks."""

import hashlib
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa

from acquisition.errors import ConfigError
from acquisition.recordings import tables
from acquisition.recordings.manifest import (
    BLOCKS,
    BLOCKS_PER_GROUP,
    FORMAT,
    MANIFEST,
    MAX_SAMPLES,
    ROWS_PER_GROUP,
    SAMPLES,
    VERSION,
    Manifest,
    RecordedFile,
    RecordedUnit,
    manifest_text,
)
from acquisition.recordings.messages import Heads, Progress, heads_of
from core.arrays import FloatArray, RawArray
from core.samples.blocks import Rejection, SampleBlock
from core.samples.calibration import UnitCalibration

INCOMPLETE = ".incomplete"
"""Suffix of the folder of a recording that is being written."""


class RecordingWriter:
    """Writer of a recording; its folder has a temporary name until it is complete and synced.

    As a context manager, the writer finishes the recording, or removes it after an exception. The
    first block determines the sample type.

    Parameters
    ----------
    folder
        Folder of the recording; it must not exist. Missing parent folders are created.
    made_by
        Program and person that make the recording, for the manifest.

    Raises
    ------
    ConfigError
        If the folder exists, is being written by another process, or cannot be created.
    """

    def __init__(self, folder: Path, unit: RecordedUnit, made_by: str) -> None:
        self.unit = unit
        self._folder = folder
        self._aside = folder.with_name(folder.name + INCOMPLETE)
        self._made_by = made_by
        self._calibration = unit.calibration
        self._progress = Progress()
        self._start_ns = 0
        self._samples_file: Any = None
        self._counts: list[RawArray] = []
        self._n_waiting = 0
        self._heads: list[Heads] = []
        self._rejected: list[Sequence[Rejection]] = []
        if os.path.lexists(folder):
            raise ConfigError(f"{folder}: folder exists already; a recording is not overwritten")
        if os.path.lexists(self._aside):
            raise ConfigError(
                f"{self._aside}: the folder exists already; delete it unless another program is"
                " writing to it"
            )
        with tables.foreign_errors_of(self._aside):
            self._aside.mkdir(parents=True)
            self._blocks_file = tables.blocks_writer(self._aside / BLOCKS, unit)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            self.abandon()
            return
        try:
            self.finish()
        except ConfigError:
            with suppress(ConfigError):
                self.abandon()
            raise

    @property
    def n_samples(self) -> int:
        """Number of samples per channel that were written so far."""
        return self._progress.n_samples

    @property
    def duration_s(self) -> float:
        """Duration of the recording in seconds, including gaps within but not between epochs."""
        return self._progress.n_passed / self.unit.rate_hz

    def write(self, block: SampleBlock) -> None:
        """Append a sample block; each of its cells is recorded as a block.

        Slow values measured by another device are included; a missing value is recorded as NaN.

        Raises ConfigError if the unit, the calibration or the sample type of the block differ, it
        exceeds the limits of the format, or it cannot be written.
        """
        if not self._progress.n_blocks:
            self.unit = self.unit.model_copy(update={"sample_type": block.counts.dtype.name})
        self._require_fit(block)
        side = replace(block.side, slow=_slow(block, self._calibration))
        heads = heads_of(replace(block, calibration=self._calibration, side=side))
        progress = self._progress.after(heads, {0: block.rejected}, len(block.counts))
        if progress.n_samples > MAX_SAMPLES:
            raise ConfigError(f"more than {MAX_SAMPLES} samples per channel; begin a new recording")
        if not self._progress.n_blocks:
            self._start_ns = block.start_ns
        self._progress = progress
        self._counts.append(block.counts)
        self._n_waiting += block.n_samples
        self._heads.append(heads)
        self._rejected += [block.rejected, *[()] * (len(heads) - 1)]
        with tables.foreign_errors_of(self._aside):
            while self._n_waiting >= ROWS_PER_GROUP:
                self._write_counts(ROWS_PER_GROUP)
            while len(self._rejected) >= BLOCKS_PER_GROUP:
                self._write_heads(BLOCKS_PER_GROUP)

    def finish(self) -> Manifest:
        """Sync all files, rename the recording to its final name, and return its manifest.

        Raises ConfigError if no block was written, or writing to the disk fails.
        """
        if not self._progress.n_blocks:
            self.abandon()
            raise ConfigError(f"{self._folder}: nothing was recorded, because no samples arrived")
        with tables.foreign_errors_of(self._aside):
            self._write_counts(self._n_waiting)
            self._write_heads(len(self._rejected))
            self._close()
            manifest = self._manifest()
            (self._aside / MANIFEST).write_text(manifest_text(manifest), encoding="utf-8")
            for name in (SAMPLES, BLOCKS, MANIFEST):
                _sync(self._aside / name)
            _sync(self._aside)
            self._aside.rename(self._folder)
            _sync(self._folder.parent)
        return manifest

    def abandon(self) -> None:
        """Remove the unfinished recording.

        Raises ConfigError if its files cannot be removed.
        """
        with suppress(ConfigError), tables.foreign_errors_of(self._aside):
            self._close()  # writes the footer, which fails on a full disk
        with tables.foreign_errors_of(self._aside):
            for name in (SAMPLES, BLOCKS, MANIFEST):
                (self._aside / name).unlink(missing_ok=True)
            self._aside.rmdir()

    def _require_fit(self, block: SampleBlock) -> None:
        own, expected = block.calibration, self._calibration
        known = {channel.id: channel for channel in expected.slow}
        if (own.unit, own.rate_hz, own.channels) != (
            expected.unit,
            expected.rate_hz,
            expected.channels,
        ) or any(known.get(channel.id) != channel for channel in own.slow):
            raise ConfigError(
                f"the samples of unit {own.unit} from index {block.first_index} on differ"
                " from the recording in rate or calibration; begin a new recording"
            )
        if block.counts.dtype.name != self.unit.sample_type:
            raise ConfigError(
                f"samples must be {self.unit.sample_type}, got {block.counts.dtype.name}"
            )

    def _write_counts(self, n_samples: int) -> None:
        if n_samples == 0:
            return
        if self._samples_file is None:
            self._samples_file = tables.samples_writer(self._aside / SAMPLES, self.unit)
        counts: Any = np.concatenate(self._counts, axis=1)
        schema = tables.samples_schema(self.unit)
        self._samples_file.write_table(pa.table(list(counts[:, :n_samples]), schema=schema))
        rest = counts[:, n_samples:].copy()
        self._counts, self._n_waiting = [rest], rest.shape[1]

    def _write_heads(self, n_blocks: int) -> None:
        if n_blocks == 0:
            return
        heads, rejected = np.concatenate(self._heads), self._rejected[:n_blocks]
        self._blocks_file.write_table(tables.blocks_table(heads[:n_blocks], rejected, self.unit))
        self._heads, self._rejected = [heads[n_blocks:]], self._rejected[n_blocks:]

    def _close(self) -> None:
        for file in (self._samples_file, self._blocks_file):
            if file is not None:
                file.close()

    def _manifest(self) -> Manifest:
        return Manifest(
            **dict(self.unit),
            format=FORMAT,
            version=VERSION,
            made_by=self._made_by,
            start=f"{np.datetime64(self._start_ns, 'ns')}Z",
            n_blocks=self._progress.n_blocks,
            n_samples=self._progress.n_samples,
            files={name: _recorded_file(self._aside / name) for name in (SAMPLES, BLOCKS)},
        )


def _recorded_file(path: Path) -> RecordedFile:
    with path.open("rb") as file:
        return RecordedFile(
            size=os.fstat(file.fileno()).st_size,
            sha256=hashlib.file_digest(file, "sha256").hexdigest(),
        )


def _slow(block: SampleBlock, calibration: UnitCalibration) -> FloatArray:
    """Return the values of the recording's slow channels in each cell, (n_slow, n_cells)."""
    ids = block.calibration.slow_ids
    slow = np.full((len(calibration.slow), block.side.n_cells), np.nan)
    for row, channel in enumerate(calibration.slow):
        if channel.id in block.elsewhere:
            value = block.elsewhere[channel.id].value
            slow[row] = np.nan if value is None else value
        elif channel.id in ids:
            slow[row] = block.side.slow[ids.index(channel.id)]
    return slow


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
