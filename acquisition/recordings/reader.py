"""`Recording`: a folder that has been checked, and its blocks one after the other."""

import hashlib
import stat
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

from acquisition.delivery.calibration import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import (
    BLOCKS,
    Manifest,
    Progress,
    RecordedFile,
    read_manifest,
)
from acquisition.recordings.messages import BlockHead, BlockLayout, Message
from acquisition.recordings.reading import confined_messages


@dataclass(frozen=True)
class Recording:
    """A recording whose files are those of its manifest; see :func:`open_recording`.

    The Parquet files are read in the confined child process.
    """

    folder: Path
    manifest: Manifest

    def raw_blocks(
        self, first_block: int = 0, stop_block: int | None = None
    ) -> Generator[RawBlock]:
        """Blocks from one up to before another, as they were written; memory for one row group.

        Raises
        ------
        ConfigError
            If a file cannot be read any more.
        """
        stop_block = self.manifest.n_blocks if stop_block is None else stop_block
        for message in self._messages(first_block, stop_block, with_samples=True):
            for head, counts in self._layout.blocks(message):
                yield head.raw(self.manifest.rate_hz, counts)

    def heads(self) -> Iterator[BlockHead]:
        """All blocks without their samples.

        Raises
        ------
        ConfigError
            If the file cannot be read any more.
        """
        for message in self._messages(0, self.manifest.n_blocks, with_samples=False):
            yield from self._layout.heads(message)[0]

    def require_lengths(self) -> None:
        """Go through the blocks without their samples: each must be possible, all must add up.

        Raises
        ------
        ConfigError
            If not.
        """
        path = self.folder / BLOCKS
        n_samples, progress = 0, Progress()
        for number, head in enumerate(self.heads()):
            progress = self._past(progress, head, f"{path}: block {number}")
            n_samples += head.n_samples
        if n_samples != self.manifest.n_samples:
            raise ConfigError(
                f"{path}: {n_samples} samples in all, the manifest says {self.manifest.n_samples}"
            )

    @property
    def _layout(self) -> BlockLayout:
        found = self.manifest
        return BlockLayout(len(found.channels), len(found.slow_channels), (found.sample_type,))

    def _messages(self, first: int, stop: int, *, with_samples: bool) -> Iterator[Message]:
        request = {"first": first, "stop": stop, "samples": with_samples}
        manifest = {"manifest": self.manifest.model_dump(mode="json")}
        return confined_messages(self.folder, "recording", "blocks", request | manifest)

    def _past(self, progress: Progress, head: BlockHead, place: str) -> Progress:
        if len(head.ok) > len(self.manifest.channels):
            raise ConfigError(f"{place}: OK bits of more than the recorded channels")
        try:
            return progress.after(head.epoch, head.first_index, head.n_samples, head.rejected)
        except ConfigError as error:
            raise ConfigError(f"{place}: {error}") from error


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
