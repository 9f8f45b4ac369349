"""`Recording`: a folder that has been checked, and its blocks one after the other."""

import hashlib
import stat
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.limits import BLOCKS_PER_GROUP, ROWS_PER_GROUP
from acquisition.recordings.manifest import BLOCKS, SAMPLES, Manifest, RecordedFile, read_manifest
from acquisition.recordings.progress import Progress
from acquisition.recordings.tables import (
    blocks_schema,
    parquet_file,
    read_counts,
    read_rows,
    samples_schema,
)
from core.arrays import RawArray
from core.samples.blocks import Rejection


@dataclass(frozen=True)
class BlockHead:
    """All of a recorded block but its samples; see :class:`acquisition.delivery.raw.RawBlock`."""

    epoch: int
    first_index: int
    start_ns: int
    n_samples: int
    ok: tuple[bool, ...]
    slow: tuple[float, ...]
    rejected: tuple[Rejection, ...]


@dataclass(frozen=True)
class Recording:
    """A recording whose files are those of its manifest; see :func:`open_recording`."""

    folder: Path
    manifest: Manifest

    def raw_blocks(self, first_block: int = 0) -> Generator[RawBlock]:
        """All blocks from this one on, exactly as they were written; memory for one row group.

        Raises
        ------
        ConfigError
            If a file cannot be read any more.
        """
        with self._samples() as samples, self._blocks() as blocks:
            counts = _Counts(samples, self.manifest)
            first_row = 0
            for number, row in enumerate(self._rows(blocks)):
                n_samples = row["n_samples"]
                if number >= first_block:
                    yield self._raw(self._head(row), counts.read(first_row, n_samples))
                first_row += n_samples

    def heads(self) -> Iterator[BlockHead]:
        """All blocks without their samples.

        Raises
        ------
        ConfigError
            If the file cannot be read any more.
        """
        with self._blocks() as blocks:
            for row in self._rows(blocks):
                yield self._head(row)

    def require_lengths(self) -> None:
        """Go through the blocks without their samples: each must be possible, all must add up.

        Raises
        ------
        ConfigError
            If not.
        """
        path = self.folder / BLOCKS
        n_samples, progress = 0, Progress()
        with self._samples(), self._blocks() as blocks:
            for number, row in enumerate(self._rows(blocks)):
                progress = self._past(progress, row, f"{path}: block {number}")
                n_samples += row["n_samples"]
        if n_samples != self.manifest.n_samples:
            raise ConfigError(
                f"{path}: {n_samples} samples in all, the manifest says {self.manifest.n_samples}"
            )

    def _samples(self) -> Any:
        schema, n_rows = samples_schema(self.manifest), self.manifest.n_samples
        return parquet_file(self.folder / SAMPLES, schema, n_rows, ROWS_PER_GROUP)

    def _blocks(self) -> Any:
        schema, n_rows = blocks_schema(self.manifest), self.manifest.n_blocks
        return parquet_file(self.folder / BLOCKS, schema, n_rows, BLOCKS_PER_GROUP)

    def _rows(self, blocks: Any) -> Iterator[dict[str, Any]]:
        for group in range(blocks.num_row_groups):
            yield from read_rows(blocks, group)

    def _head(self, row: dict[str, Any]) -> BlockHead:
        return BlockHead(
            epoch=row["epoch"],
            first_index=row["first_index"],
            start_ns=row["start_ns"],
            n_samples=row["n_samples"],
            ok=tuple(bool(row["ok"] >> i & 1) for i in range(len(self.manifest.channels))),
            slow=tuple(row[f"slow:{channel.id}"] for channel in self.manifest.slow_channels),
            rejected=_rejected(row),
        )

    def _raw(self, head: BlockHead, counts: RawArray) -> RawBlock:
        return RawBlock(
            epoch=head.epoch,
            first_index=head.first_index,
            start_ns=head.start_ns,
            rate_hz=self.manifest.rate_hz,
            counts=counts,
            ok=head.ok,
            slow=head.slow,
            rejected=head.rejected,
        )

    def _past(self, progress: Progress, row: dict[str, Any], place: str) -> Progress:
        if row["ok"] >> len(self.manifest.channels):
            raise ConfigError(f"{place}: OK bits of more than the recorded channels")
        try:
            return progress.after(
                row["epoch"], row["first_index"], row["n_samples"], _rejected(row)
            )
        except ConfigError as error:
            raise ConfigError(f"{place}: {error}") from error


class _Counts:
    """Counts by row, with one row group in memory."""

    def __init__(self, file: Any, manifest: Manifest) -> None:
        self._file = file
        self._group: int | None = None
        self._held: RawArray = np.empty((len(manifest.channels), 0), dtype=manifest.sample_type)

    def read(self, first_row: int, n_rows: int) -> RawArray:
        parts: list[Any] = []
        while n_rows:
            group, offset = divmod(first_row, ROWS_PER_GROUP)
            if group != self._group:
                self._held, self._group = read_counts(self._file, group), group
            part = self._held[:, offset : offset + n_rows]
            parts.append(part)
            first_row += part.shape[1]
            n_rows -= part.shape[1]
        return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)


def open_recording(folder: Path) -> Recording:
    """Check a recording from end to end: manifest, sizes, checksums, columns, lengths.

    Raises
    ------
    ConfigError
        If anything is wrong; one sentence with the file and what is wrong with it.
    """
    manifest = read_manifest(folder)
    for name, expected in manifest.files.items():
        _require_file(folder / name, expected)
    recording = Recording(folder, manifest)
    recording.require_lengths()
    return recording


def _require_file(path: Path, expected: RecordedFile) -> None:
    try:
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode):
            raise ConfigError(f"{path}: not a regular file")
        if status.st_size != expected.size:
            raise ConfigError(f"{path}: {status.st_size} bytes, the manifest says {expected.size}")
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    if found != expected.sha256:
        raise ConfigError(
            f"{path}: damaged: checksum {found[:12]}…, the manifest says {expected.sha256[:12]}…"
        )


def _rejected(row: dict[str, Any]) -> tuple[Rejection, ...]:
    return tuple(Rejection(r["reason"], r["n_samples"]) for r in row["rejected"])
