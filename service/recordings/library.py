"""Finished recordings: listed, described, opened, and a stretch of time out of one."""

import json
import re
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.delivery.calibration import calibrate
from acquisition.errors import ConfigError
from acquisition.recordings.export import csv_tables
from acquisition.recordings.manifest import Manifest, checksum_of, read_manifest
from acquisition.recordings.reader import Recording, open_recording
from acquisition.recordings.source import all_of
from acquisition.recordings.summary import RecordingSummary, summary_of
from core.samples.blocks import SampleBlock
from core.units import ns_from_s
from service.recordings.folders import ALARM, FILES, KIND, finished, n_bytes_of, unit_of
from service.runtime.files import Sink, zipped
from service.store.waveforms import WaveformKind

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,119}")

MOMENT = re.compile(r"\d{8}T\d{6}\.\d{3}Z")
CONTINUOUS = re.compile(rf"{MOMENT.pattern}-{KIND}")

MAX_ALARM_BYTES = 1_000_000


@dataclass(frozen=True)
class Kept:
    """A recording on the shelf.

    Parameters
    ----------
    manifest
        None if it cannot be read.
    fault
        Why not.
    alarms
        What it was made for, as its file says it.
    n_bytes
        Of all its files.
    """

    name: str
    kind: WaveformKind
    manifest: Manifest | None
    fault: str | None
    alarms: Sequence[Mapping[str, Any]]
    n_bytes: int


class Shelf:
    """Recordings below some folders; all methods read the disk, so call them in a thread.

    Parameters
    ----------
    roots
        Need not be there yet.
    faults
        Recordings that are known to be damaged, by name, and why: nothing of them is handed out.
    """

    def __init__(self, roots: Sequence[Path], faults: Mapping[str, str] | None = None) -> None:
        self._roots, self._faults = roots, faults or {}

    def newest(
        self, most: int, unit: str | None = None, kind: WaveformKind | None = None
    ) -> list[Kept]:
        """The newest recordings, newest first; of one unit, or of all."""
        folders = [
            folder
            for folder in self._folders()
            if unit in (None, unit_of(folder.name)) and kind in (None, kind_of(folder.name))
        ]
        by_age = sorted(folders, key=_age, reverse=True)
        return [self._kept(folder) for folder in by_age[:most]]

    def one(self, name: str) -> Kept | None:
        """A recording by its name; None if there is none."""
        folder = self._folder(name)
        return None if folder is None else self._kept(folder)

    def opened(self, name: str) -> Recording:
        """A recording that has been checked from end to end.

        Raises
        ------
        ConfigError
            If it is damaged, or not there.
        """
        folder = self._folder(name)
        if folder is None:
            raise ConfigError(f"{name}: no such recording")
        if name in self._faults:
            raise ConfigError(f"{name}: {self._faults[name]}")
        return open_recording(folder)

    def summary(self, name: str) -> RecordingSummary:
        """What happened in a recording, after it has been checked from end to end.

        Raises
        ------
        ConfigError
            If it is damaged, or not there.
        """
        return summary_of(self.opened(name))

    def zip_pieces(self, name: str) -> Generator[bytes, None, None]:
        """Its files as one ZIP file, piece by piece, after it has been checked from end to end.

        Raises
        ------
        ConfigError
            If it is damaged, or not there.
        OSError
            If a file cannot be read.
        """
        folder = self.opened(name).folder
        there = [file for file in FILES if (folder / file).is_file()]
        return zipped({f"{name}/{file}": folder / file for file in there})

    def csv_pieces(self, name: str) -> Generator[bytes, None, None]:
        """Its samples as CSV, units in the headings, piece by piece.

        Raises
        ------
        ConfigError
            If it is damaged, or not there.
        """
        recording, sink = self.opened(name), Sink()
        for _ in csv_tables(recording, sink):
            yield from sink.taken()

    def _folder(self, name: str) -> Path | None:
        """By looking through what is there, so that no name leads out of the folder."""
        if NAME.fullmatch(name) is None:
            return None
        return next((folder for folder in self._folders() if folder.name == name), None)

    def _folders(self) -> Iterator[Path]:
        for root in self._roots:
            yield from (root / name for name in finished(root))

    def _kept(self, folder: Path) -> Kept:
        try:
            manifest, fault = read_manifest(folder), self._faults.get(folder.name)
        except ConfigError as error:
            manifest, fault = None, str(error).replace(str(folder), folder.name)
        kind = kind_of(folder.name)
        alarms = _alarms(folder / ALARM)
        return Kept(folder.name, kind, manifest, fault, alarms, n_bytes_of(folder))


def kind_of(name: str) -> WaveformKind:
    """What a recording was made for, by its name."""
    return WaveformKind.CONTINUOUS if CONTINUOUS.search(name) else WaveformKind.CAPTURE


def _age(folder: Path) -> tuple[str, str]:
    """By what the name says, which costs nothing where there are many thousands."""
    found = MOMENT.search(folder.name)
    return found[0] if found else "", folder.name


def _alarms(path: Path) -> list[Mapping[str, Any]]:
    """What a recording was made for; nothing where that cannot be read."""
    try:
        with path.open("rb") as file:
            document = json.loads(file.read(MAX_ALARM_BYTES))
        if document.get("checksum") not in (None, checksum_of(document)):  # older ones have none
            return []
        return [
            {key: each[key] for key in ("alarm", "occurrence", "change", "level", "time")}
            for each in document["alarms"]
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return []


@dataclass(frozen=True)
class RecordingWindow:
    """Blocks of a recording within a stretch of time.

    Parameters
    ----------
    start_ns, stop_ns
        Of the whole recording: its first sample, and the first one after its last.
    blocks
        Those with samples in the stretch, as far as they are of one epoch; empty in a hole.
    n_other
        Blocks of the stretch that are left out: the device began to count anew before them.
    """

    start_ns: int
    stop_ns: int
    blocks: Sequence[SampleBlock]
    n_other: int


def window_of(recording: Recording, start_s: float, seconds: float) -> RecordingWindow:
    """Read what lies within a stretch of time.

    Parameters
    ----------
    start_s
        From the first sample of the recording.

    Raises
    ------
    ConfigError
        If it cannot be read any more.
    """
    rate_hz = recording.manifest.rate_hz
    spans = [(h.start_ns, h.start_ns + ns_from_s(h.n_samples / rate_hz)) for h in recording.heads()]
    if not spans:
        raise ConfigError(f"{recording.folder}: no blocks")
    from_ns = spans[0][0] + ns_from_s(start_s)
    to_ns = from_ns + ns_from_s(seconds)
    wanted = [n for n, (begin, end) in enumerate(spans) if end > from_ns and begin < to_ns]
    blocks = _read(recording, wanted)
    same = [block for block in blocks if block.epoch == blocks[0].epoch]
    return RecordingWindow(spans[0][0], spans[-1][1], same, len(blocks) - len(same))


def _read(recording: Recording, wanted: Sequence[int]) -> list[SampleBlock]:
    calibration = all_of(recording.manifest).calibration
    if not wanted:
        return []
    raws = recording.raw_blocks(wanted[0], wanted[-1] + 1)
    return [calibrate(raw, calibration) for raw in raws]
