"""`Recording`: checked folder of a recording, sequential access to its blocks, and summary."""

import hashlib
import stat
from collections import Counter
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import BLOCKS, Manifest, RecordedFile, read_manifest
from acquisition.recordings.messages import Heads, Message, Progress, blocks_in, heads_in
from acquisition.recordings.reading import confined_messages
from core.samples.blocks import Rejection, SampleBlock
from core.samples.gaps import Gap
from core.units import ns_from_s

MAX_GAPS_LISTED = 1000


@dataclass(frozen=True)
class RecordingSummary:
    """Summary of a recording; all numbers of samples are exact and per channel.

    Parameters
    ----------
    start_ns
        Time of the first sample, UTC in ns since 1970.
    stop_ns
        End of the last sample period, UTC in ns since 1970.
    n_samples
        Number of recorded samples.
    n_passed
        Total number of recorded, missing and rejected samples.
    gaps
        First thousand gaps in order of time.
    n_gaps
        Number of all gaps.
    n_gap_samples
        Number of samples missing in all gaps, without rejected samples.
    rejected
        Number of rejected samples by reason.
    epochs
        Epochs in order of time; several if the device restarted.
    n_not_ok
        Number of samples by channel id in blocks where the device reported the channel as not OK;
        without channels that were always OK.
    """

    start_ns: int
    stop_ns: int
    n_samples: int
    n_passed: int
    gaps: tuple[Gap, ...]
    n_gaps: int
    n_gap_samples: int
    rejected: Mapping[str, int]
    epochs: tuple[int, ...]
    n_not_ok: Mapping[str, int]


@dataclass(frozen=True)
class Recording:
    """Recording whose files match its manifest; see :func:`open_recording`.

    The Parquet files are read in the confined child process. All methods raise ConfigError if a
    file has become unreadable.
    """

    folder: Path
    manifest: Manifest

    @cached_property
    def summary(self) -> RecordingSummary:
        """Start, end, gaps and rejections of the recording; computed when it is opened."""
        return _summary_of(self)

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
        """Yield arrays of some hundred block headers, and rejections before them by array index."""
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
    _ = recording.summary  # checks the headers of all blocks
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


def _summary_of(recording: Recording) -> RecordingSummary:
    """Return the summary of a recording, from the headers of all its blocks.

    Raises ConfigError if a header is invalid, or the total length differs from the manifest.
    """
    path, manifest, progress = recording.folder / BLOCKS, recording.manifest, Progress()
    channels = np.arange(len(manifest.channels))[:, np.newaxis]
    start_ns: int | None = None
    stop_ns = n_gaps = n_gap_samples = 0
    gaps: list[Gap] = []
    epochs: list[int] = []
    rejected: Counter[str] = Counter()
    n_not_ok = np.zeros(len(channels), dtype=np.int64)
    for heads, rejections in recording.heads():
        continues, n_missing = progress.missing(heads)
        try:
            progress = progress.after(heads, rejections, len(channels))
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from error
        n_lost = np.where(continues, n_missing, 0)
        for row, before in rejections.items():
            n_lost[row] -= sum(rejection.n_samples for rejection in before)
            rejected.update({rejection.reason: rejection.n_samples for rejection in before})
        rows = np.flatnonzero(n_lost > 0)
        for row in rows[: MAX_GAPS_LISTED - len(gaps)].tolist():
            epoch, index, time_ns, *_ = heads[row].item()
            gaps.append(Gap(epoch, index - int(n_missing[row]), int(n_lost[row]), time_ns))
        n_gaps, n_gap_samples = n_gaps + rows.size, n_gap_samples + int(n_lost[rows].sum())
        epochs += heads["epoch"][~continues].tolist()
        n_not_ok += ((heads["ok"] >> channels & 1 == 0) * heads["n_samples"]).sum(axis=1)
        start_ns = int(heads["start_ns"][0]) if start_ns is None else start_ns
        last_s = int(heads["n_samples"][-1]) / manifest.rate_hz
        stop_ns = int(heads["start_ns"][-1]) + ns_from_s(last_s)
    if progress.n_samples != manifest.n_samples:
        found = (
            f"{progress.n_samples} samples in all blocks, but {manifest.n_samples} in the manifest"
        )
        raise ConfigError(f"{path}: {found}")
    return RecordingSummary(
        start_ns=start_ns or 0,
        stop_ns=stop_ns,
        n_samples=progress.n_samples,
        n_passed=progress.n_samples + n_gap_samples + rejected.total(),
        gaps=tuple(gaps),
        n_gaps=n_gaps,
        n_gap_samples=n_gap_samples,
        rejected=dict(rejected),
        epochs=tuple(epochs),
        n_not_ok={c.id: int(n) for c, n in zip(manifest.channels, n_not_ok, strict=True) if n},
    )
