"""`Recording`: checked folder of a recording, and sequential access to its blocks."""

import hashlib
import stat
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import BLOCKS, Manifest, RecordedFile, read_manifest
from acquisition.recordings.messages import Heads, Message, Progress, blocks_in, heads_in
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

    def blocks(self, first_block: int = 0, stop_block: int | None = None) -> Generator[SampleBlock]:
        """Yield the blocks from `first_block` to `stop_block` (excluded; None for all).

        Blocks without a gap between them are joined; each is then a cell of the joined block. The
        first block of the recording has number 0.
        """
        calibration = self.manifest.calibration
        stop_block = self.manifest.n_blocks if stop_block is None else stop_block
        for message in self._messages(first_block, stop_block, with_samples=True):
            yield from blocks_in(message, calibration, (self.manifest.sample_type,))

    def heads(self) -> Iterator[tuple[Heads, Mapping[int, list[Rejection]]]]:
        """Yield arrays of some hundred block headers, with the rejections by index of the block."""
        for message in self._messages(0, self.manifest.n_blocks, with_samples=False):
            heads, rejected, _ = heads_in(message, len(self.manifest.slow_channels))
            if heads.size:
                yield heads, rejected

    def _messages(self, first: int, stop: int, *, with_samples: bool) -> Iterator[Message]:
        request = {"first": first, "stop": stop, "samples": with_samples}
        manifest = {"manifest": self.manifest.model_dump(mode="json")}
        return confined_messages(self.folder, "recording", "blocks", request | manifest)


def open_recording(folder: Path) -> Recording:
    """Open a recording and check it fully: manifest, file sizes, checksums, columns, lengths.

    Raises ConfigError if a check fails; the message states the file and the fault in one sentence.
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
    path, manifest, progress = recording.folder / BLOCKS, recording.manifest, Progress()
    for heads, rejected in recording.heads():
        try:
            progress = progress.after(heads, rejected, len(manifest.channels))
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from error
    if progress.n_samples != manifest.n_samples:
        found = f"blocks have {progress.n_samples} samples, expected {manifest.n_samples}"
        raise ConfigError(f"{path}: {found}")
