"""Library of finished recordings, and the samples in a time window of a recording."""

import json
import re
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import ConfigError
from acquisition.recordings.export import ExportFormat, write_rows
from acquisition.recordings.manifest import Manifest, checksum_of, read_manifest
from acquisition.recordings.reader import Recording, RecordingSummary, open_recording
from core.samples.blocks import SampleBlock
from core.units import NS_PER_S, ns_from_s
from service.recordings.folders import ALARM, CONTINUOUS, FILES, finished, n_bytes_of, unit_of
from service.runtime.files import Sink, zipped
from service.store.waveforms import WaveformKind

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,119}")

_TIME = re.compile(r"\d{8}T\d{6}\.\d{3}Z")
_CONTINUOUS_NAME = re.compile(rf"{_TIME.pattern}-{CONTINUOUS}")

MAX_ALARM_BYTES = 1_000_000


@dataclass(frozen=True)
class RecordingEntry:
    """Recording in the library, with its manifest, alarm events and fault.

    Parameters
    ----------
    manifest
        Manifest; None if it cannot be read.
    fault
        Reason why the recording cannot be opened; None if it can be opened.
    alarms
        Alarm events in the file ``alarm.json`` of a capture; empty for other recordings.
    n_bytes
        Size of all files of the recording.
    """

    name: str
    kind: WaveformKind
    manifest: Manifest | None
    fault: str | None
    alarms: Sequence[Mapping[str, Any]]
    n_bytes: int


class RecordingLibrary:
    """Library of finished recordings. All methods block on the disk: call them in a thread.

    Parameters
    ----------
    roots
        Folders that contain the recordings; a missing folder counts as empty.
    faults
        Faults of damaged recordings, by name; damaged recordings are not opened.
    """

    def __init__(self, roots: Sequence[Path], faults: Mapping[str, str] | None = None) -> None:
        self._roots, self._faults = roots, faults or {}

    def newest(
        self, limit: int, unit: str | None = None, kind: WaveformKind | None = None
    ) -> list[RecordingEntry]:
        """Return at most `limit` recordings, newest first; None for all units or all kinds."""
        folders = [
            folder
            for folder in self._folders()
            if unit in (None, unit_of(folder.name)) and kind in (None, kind_of(folder.name))
        ]
        by_age = sorted(folders, key=_age, reverse=True)
        return [self._entry(folder) for folder in by_age[:limit]]

    def one(self, name: str) -> RecordingEntry | None:
        """Return the entry of the recording with a name; None if the name is invalid or unknown."""
        folder = self._folder(name)
        return None if folder is None else self._entry(folder)

    def opened(self, name: str) -> Recording:
        """Check all files of a recording and open it.

        Raises `ConfigError` if the recording is damaged or does not exist.
        """
        folder = self._folder(name)
        if folder is None:
            raise ConfigError(f"{name}: the recording does not exist; it may have been removed")
        if name in self._faults:
            raise ConfigError(f"{name}: {self._faults[name]}")
        return open_recording(folder)

    def summary(self, name: str) -> RecordingSummary:
        """Return the summary of a recording; raise `ConfigError` if damaged or missing."""
        return self.opened(name).summary

    def zip_pieces(self, name: str) -> Generator[bytes, None, None]:
        """Yield the content of a ZIP file with all files of a recording.

        Raises `ConfigError` if the recording is damaged or does not exist, and `OSError` if a file
        cannot be read.
        """
        folder = self.opened(name).folder
        there = [file for file in FILES if (folder / file).is_file()]
        return zipped({f"{name}/{file}": folder / file for file in there})

    def csv_pieces(self, name: str) -> Generator[bytes, None, None]:
        """Yield the samples of a recording as CSV text with units in the header.

        Raises `ConfigError` if the recording is damaged or does not exist.
        """
        recording, sink = self.opened(name), Sink()
        for _ in write_rows(recording, ExportFormat.CSV, sink):
            yield from sink.taken()

    def _folder(self, name: str) -> Path | None:
        if _NAME.fullmatch(name) is None:
            return None
        return next((folder for folder in self._folders() if folder.name == name), None)

    def _folders(self) -> Iterator[Path]:
        for root in self._roots:
            yield from (root / name for name in finished(root))

    def _entry(self, folder: Path) -> RecordingEntry:
        try:
            manifest, fault = read_manifest(folder), self._faults.get(folder.name)
        except ConfigError as error:
            manifest, fault = None, str(error).replace(str(folder), folder.name)
        kind = kind_of(folder.name)
        alarms = _alarms(folder / ALARM)
        return RecordingEntry(folder.name, kind, manifest, fault, alarms, n_bytes_of(folder))


def kind_of(name: str) -> WaveformKind:
    """Return the kind of a recording, determined from its name."""
    return WaveformKind.CONTINUOUS if _CONTINUOUS_NAME.search(name) else WaveformKind.CAPTURE


def _age(folder: Path) -> tuple[str, str]:
    found = _TIME.search(folder.name)
    return found[0] if found else "", folder.name


def _alarms(path: Path) -> list[Mapping[str, Any]]:
    try:
        with path.open("rb") as file:
            document = json.loads(file.read(MAX_ALARM_BYTES))
        if document.get("checksum") not in (None, checksum_of(document)):  # older files have none
            return []
        return [
            {key: each[key] for key in ("alarm", "occurrence", "change", "level", "time")}
            for each in document["alarms"]
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return []


@dataclass(frozen=True)
class RecordingWindow:
    """Blocks of a recording within a time window.

    Parameters
    ----------
    start_ns, stop_ns
        Start and end of the whole recording, ns since 1970 UTC.
    blocks
        Blocks in the window that have the epoch of the first block in it; empty in a gap.
    n_other
        Number of blocks in the window with other epochs, which are omitted.
    """

    start_ns: int
    stop_ns: int
    blocks: Sequence[SampleBlock]
    n_other: int


def window_of(recording: Recording, start_s: float, seconds: float) -> RecordingWindow:
    """Return the blocks that overlap ``start_s`` to ``start_s + seconds`` after the first sample.

    Raises `ConfigError` if the recording can no longer be read.
    """
    rate_hz = recording.manifest.rate_hz
    heads = np.concatenate([some for some, _ in recording.heads()])
    begin_ns = heads["start_ns"]
    end_ns = begin_ns + np.rint(heads["n_samples"] / rate_hz * NS_PER_S).astype(np.int64)
    from_ns = int(begin_ns[0]) + ns_from_s(start_s)
    to_ns = from_ns + ns_from_s(seconds)
    wanted = np.flatnonzero((end_ns > from_ns) & (begin_ns < to_ns)).tolist()
    blocks: list[SampleBlock] = []
    if wanted:
        blocks = list(recording.blocks(wanted[0], wanted[-1] + 1))
    same = [block for block in blocks if block.epoch == blocks[0].epoch]
    n_other = sum(block.side.n_cells for block in blocks if block.epoch != blocks[0].epoch)
    return RecordingWindow(int(begin_ns[0]), int(end_ns[-1]), same, n_other)
