"""`Recording`: checked folder of a recording, and sequential access to its blocks."""

import hashlib
import stat
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from acquisition.delivery.blocks import RawBlock, cells_of
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import (
    BLOCKS,
    MAX_BLOCK_SAMPLES,
    MAX_INDEX,
    Manifest,
    Progress,
    RecordedFile,
    read_manifest,
)
from acquisition.recordings.messages import BlockHead, BlockLayout, Message, follows
from acquisition.recordings.reading import confined_messages
from core.samples.blocks import Rejection, SampleBlock


@dataclass(frozen=True)
class Recording:
    """Recording whose files match its manifest; see :func:`open_recording`.

    The Parquet files are read in the confined child process. All methods raise ConfigError if a
    file has become unreadable.
    """

    folder: Path
    manifest: Manifest

    def raw_blocks(
        self, first_block: int = 0, stop_block: int | None = None
    ) -> Generator[RawBlock]:
        """Yield the blocks as written, from `first_block` to `stop_block` (excluded; None for all).

        The first block of the recording has number 0.
        """
        for run in self.runs(first_block, stop_block):
            yield from cells_of(run)

    def runs(self, first_block: int = 0, stop_block: int | None = None) -> Generator[SampleBlock]:
        """Yield the same blocks as `raw_blocks`; blocks without a gap between them are joined."""
        stop_block = self.manifest.n_blocks if stop_block is None else stop_block
        for message in self._messages(first_block, stop_block, with_samples=True):
            yield from self._layout.runs(message)

    def heads(self) -> Iterator[BlockHead]:
        """Yield the headers of all blocks."""
        for message in self._messages(0, self.manifest.n_blocks, with_samples=False):
            yield from self._layout.heads(message)

    def rows(self) -> Iterator[tuple[npt.NDArray[np.void], Mapping[int, list[Rejection]]]]:
        """Yield the headers of all blocks in arrays, with rejections; see `BlockLayout.parts`."""
        for message in self._messages(0, self.manifest.n_blocks, with_samples=False):
            rows, rejected, _ = self._layout.parts(message)
            if rows.size:
                yield rows, rejected

    @cached_property
    def _layout(self) -> BlockLayout:
        return BlockLayout(self.manifest.calibration, (self.manifest.sample_type,))

    def _messages(self, first: int, stop: int, *, with_samples: bool) -> Iterator[Message]:
        request = {"first": first, "stop": stop, "samples": with_samples}
        manifest = {"manifest": self.manifest.model_dump(mode="json")}
        return confined_messages(self.folder, "recording", "blocks", request | manifest)


def open_recording(folder: Path) -> Recording:
    """Open a recording and check it fully: manifest, file sizes, checksums, columns, lengths.

    Raises
    ------
    ConfigError
        If a check fails; the message states the file and the fault in one sentence.
    """
    manifest = read_manifest(folder)
    for name, expected in manifest.files.items():
        _require_file(folder / name, expected)
    recording = Recording(folder, manifest)
    _require_lengths(recording)
    return recording


def _require_file(path: Path, expected: RecordedFile) -> None:
    try:
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode):
            raise ConfigError(f"{path}: not a regular file")
        if status.st_size != expected.size:
            raise ConfigError(f"{path}: file has {status.st_size} bytes, expected {expected.size}")
        with path.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    if found != expected.sha256:
        raise ConfigError(
            f"{path}: file is damaged: its checksum is {found[:12]}…, expected"
            f" {expected.sha256[:12]}…"
        )


def _require_lengths(recording: Recording) -> None:
    """Check the block headers: each must be valid, and the total length must match the manifest."""
    path, manifest = recording.folder / BLOCKS, recording.manifest
    n_samples, n_blocks, progress = 0, 0, Progress()
    for rows, rejected in recording.rows():
        first_index, length = rows["first_index"], rows["n_samples"]
        has_more = rows["ok"] >> len(manifest.channels) != 0
        is_plain = follows(rows, rejected) & ~has_more & (first_index <= MAX_INDEX)
        is_plain &= (length >= 1) & (length <= MAX_BLOCK_SAMPLES)
        for row in np.flatnonzero(~is_plain).tolist():
            try:
                if has_more[row]:
                    raise ConfigError("OK bits are set for channels that are not recorded")
                before = progress if row == 0 else _end_of(rows[row - 1])
                epoch, first, n = rows[["epoch", "first_index", "n_samples"]][row].tolist()
                before.after(epoch, first, n, rejected.get(row, ()))
            except ConfigError as error:
                raise ConfigError(f"{path}: block {n_blocks + row}: {error}") from error
        progress = _end_of(rows[-1])
        n_samples, n_blocks = n_samples + int(length.sum()), n_blocks + len(rows)
    if n_samples != manifest.n_samples:
        raise ConfigError(f"{path}: blocks have {n_samples} samples, expected {manifest.n_samples}")


def _end_of(row: np.void) -> Progress:
    stop_index = int(row["first_index"]) + int(row["n_samples"])
    return Progress(epoch=int(row["epoch"]), stop_index=stop_index)
