"""`RecordingWriter`: atomic writing of a recording from raw blocks."""

import hashlib
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from acquisition.delivery.blocks import RawBlock, cells_of
from acquisition.errors import ConfigError
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
    Progress,
    RecordedFile,
    RecordedUnit,
    SampleType,
    manifest_text,
)
from acquisition.recordings.tables import (
    blocks_table,
    blocks_writer,
    foreign_errors_of,
    samples_table,
    samples_writer,
)
from core.arrays import RawArray
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration

INCOMPLETE = ".incomplete"
"""Suffix of the folder of a recording that is being written."""


class RecordingWriter:
    """Writer of a recording; its folder has a temporary name until it is complete and synced.

    As a context manager, the writer finishes the recording, or removes it after an exception.

    Parameters
    ----------
    folder
        Folder of the recording; it must not exist.
    made_by
        Program and person that make the recording, for the manifest.
    first_decides
        Whether the first block determines the sample type; otherwise `unit` does.

    Raises
    ------
    ConfigError
        If the folder exists, is being written by another process, or cannot be created.
    """

    def __init__(
        self, folder: Path, unit: RecordedUnit, made_by: str, *, first_decides: bool = False
    ) -> None:
        self.unit = unit
        self.n_samples = 0
        self.n_blocks = 0
        self._folder = folder
        self._aside = folder.with_name(folder.name + INCOMPLETE)
        self._made_by = made_by
        self._calibration = unit.calibration
        self._progress = Progress()
        self._start_ns = 0
        self._first_decides = first_decides
        self._samples_file: Any = None
        self._counts: list[RawArray] = []
        self._n_waiting = 0
        self._blocks: list[RawBlock] = []
        if os.path.lexists(folder):
            raise ConfigError(f"{folder}: folder exists already; a recording is not overwritten")
        if os.path.lexists(self._aside):
            raise ConfigError(
                f"{self._aside}: the folder exists already; delete it unless another program is"
                " writing to it"
            )
        with foreign_errors_of(self._aside):
            self._aside.mkdir()
            self._blocks_file = blocks_writer(self._aside / BLOCKS, unit)

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
    def duration_s(self) -> float:
        """Duration of the recording in seconds, including gaps within but not between epochs."""
        return self._progress.n_passed / self.unit.rate_hz

    def write(self, raw: RawBlock) -> None:
        """Append a raw block.

        Raises
        ------
        ConfigError
            If the block does not match the unit, exceeds the limits of the format, or cannot be
            written.
        """
        if self._first_decides:
            self._decide(_type_of(raw))
        _require_fit(raw, self.unit)
        n_samples = raw.counts.shape[1]
        progress = self._progress.after(raw.epoch, raw.first_index, n_samples, raw.rejected)
        if self.n_samples + n_samples > MAX_SAMPLES:
            raise ConfigError(f"more than {MAX_SAMPLES} samples per channel; begin a new recording")
        self._progress = progress
        if self.n_blocks == 0:
            self._start_ns = raw.start_ns
        self.n_blocks += 1
        self.n_samples += n_samples
        self._counts.append(raw.counts)
        self._n_waiting += n_samples
        self._blocks.append(raw)
        with foreign_errors_of(self._aside):
            if self._n_waiting >= ROWS_PER_GROUP:
                self._write_counts(ROWS_PER_GROUP)
            if len(self._blocks) >= BLOCKS_PER_GROUP:
                self._write_blocks()

    def write_block(self, block: SampleBlock) -> None:
        """Append a sample block, with one raw block for each of its cells.

        Slow values measured by another device are included; a missing value is recorded as NaN.

        Raises
        ------
        ConfigError
            As in :meth:`write`, and if the unit or the calibration of the block differs.
        """
        _require_calibration(block, self._calibration)
        for raw in _cells(block, self._calibration):
            self.write(raw)

    def finish(self) -> Manifest:
        """Sync all files, rename the recording to its final name, and return its manifest.

        Raises
        ------
        ConfigError
            If no block was written, or writing to the disk fails.
        """
        if self.n_blocks == 0:
            self.abandon()
            raise ConfigError(f"{self._folder}: nothing was recorded, because no samples arrived")
        with foreign_errors_of(self._aside):
            self._write_counts(self._n_waiting)
            self._write_blocks()
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

        Raises
        ------
        ConfigError
            If its files cannot be removed.
        """
        with suppress(ConfigError), foreign_errors_of(self._aside):
            self._close()  # writes the footer, which fails on a full disk
        with foreign_errors_of(self._aside):
            for name in (SAMPLES, BLOCKS, MANIFEST):
                (self._aside / name).unlink(missing_ok=True)
            self._aside.rmdir()

    def _decide(self, sample_type: SampleType) -> None:
        self.unit = self.unit.model_copy(update={"sample_type": sample_type})
        self._first_decides = False

    def _write_counts(self, n_samples: int) -> None:
        if n_samples == 0:
            return
        if self._samples_file is None:
            self._samples_file = samples_writer(self._aside / SAMPLES, self.unit)
        counts: Any = np.concatenate(self._counts, axis=1)
        self._samples_file.write_table(samples_table(counts[:, :n_samples], self.unit))
        rest = counts[:, n_samples:].copy()
        self._counts, self._n_waiting = [rest], rest.shape[1]

    def _write_blocks(self) -> None:
        if self._blocks:
            self._blocks_file.write_table(blocks_table(self._blocks, self.unit))
            self._blocks = []

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
            n_blocks=self.n_blocks,
            n_samples=self.n_samples,
            files={name: _recorded_file(self._aside / name) for name in (SAMPLES, BLOCKS)},
        )


def _recorded_file(path: Path) -> RecordedFile:
    with path.open("rb") as file:
        return RecordedFile(
            size=os.fstat(file.fileno()).st_size,
            sha256=hashlib.file_digest(file, "sha256").hexdigest(),
        )


def _type_of(raw: RawBlock) -> SampleType:
    return "int16" if raw.counts.dtype == np.int16 else "float32"


def _require_calibration(block: SampleBlock, calibration: UnitCalibration) -> None:
    own = block.calibration
    known = {channel.id: channel for channel in calibration.slow}
    if (own.unit, own.channels) != (calibration.unit, calibration.channels) or any(
        known.get(channel.id) != channel for channel in own.slow
    ):
        raise ConfigError(
            f"the samples of unit {own.unit!r} from index {block.first_index} on have another"
            " calibration than the recording"
        )


def _cells(block: SampleBlock, calibration: UnitCalibration) -> Iterator[RawBlock]:
    """Yield one raw block per cell of a block, with the slow channels of the recording."""
    side, ids = block.side, block.calibration.slow_ids
    slow = np.full((len(calibration.slow), side.n_cells), np.nan)
    for row, channel in enumerate(calibration.slow):
        if channel.id in block.elsewhere:
            value = block.elsewhere[channel.id].value
            slow[row] = np.nan if value is None else value
        elif channel.id in ids:
            slow[row] = side.slow[ids.index(channel.id)]
    for raw, recorded in zip(cells_of(block), slow.T.tolist(), strict=True):
        yield replace(raw, slow=tuple(recorded))


def _require_fit(raw: RawBlock, unit: RecordedUnit) -> None:
    n_channels, n_slow = len(unit.channels), len(unit.slow_channels)
    found = (len(raw.counts), len(raw.ok), len(raw.slow), raw.counts.dtype.name)
    expected = (n_channels, n_channels, n_slow, unit.sample_type)
    if found != expected:
        raise ConfigError(
            f"channels, OK flags, slow values and sample type of a block must be {expected},"
            f" got {found}"
        )
    if raw.rate_hz != unit.rate_hz:
        raise ConfigError(f"expected a block at {unit.rate_hz} Hz, got {raw.rate_hz} Hz")


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
