"""`Shelf`: the finished recordings in a folder, listed, described and opened to be taken away."""

import json
import re
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.errors import ConfigError
from acquisition.recording.export.arrow import CsvExporter
from acquisition.recording.export.rows import export_rows
from acquisition.recording.manifest import Manifest, read_manifest
from acquisition.recording.reader import Recording, open_recording
from acquisition.recording.summary import RecordingSummary, summary_of
from acquisition.recording.writer import INCOMPLETE
from service.capture.folders import ALARM, FILES
from service.evidence.bundle import Sink, zipped

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,119}")

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
    manifest: Manifest | None
    fault: str | None
    alarms: Sequence[Mapping[str, Any]]
    n_bytes: int


class Shelf:
    """Recordings below one folder; all methods read the disk, so call them in a thread.

    Parameters
    ----------
    root
        Need not be there yet.
    """

    def __init__(self, root: Path) -> None:
        self._root = root

    def newest(self, most: int, unit: str | None = None) -> list[Kept]:
        """The newest recordings, newest first; of one unit, or of all."""
        folders = [folder for folder in self._folders() if unit is None or _is_of(folder, unit)]
        by_age = sorted(folders, key=_age, reverse=True)
        return [_kept(folder) for folder in by_age[:most]]

    def one(self, name: str) -> Kept | None:
        """A recording by its name; None if there is none."""
        folder = self._folder(name)
        return None if folder is None else _kept(folder)

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
        """Its files as one ZIP file, piece by piece.

        Raises
        ------
        OSError
            If one cannot be read.
        """
        folder = self._root / name
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
        exporter = CsvExporter(sink, recording.manifest)
        for rows in export_rows(recording):
            exporter.write(rows)
            yield from sink.taken()
        exporter.close()
        yield from sink.taken()

    def _folder(self, name: str) -> Path | None:
        """By looking through what is there, so that no name leads out of the folder."""
        if NAME.fullmatch(name) is None:
            return None
        return next((folder for folder in self._folders() if folder.name == name), None)

    def _folders(self) -> list[Path]:
        if not self._root.is_dir():
            return []
        return [
            path
            for path in self._root.iterdir()
            if not path.name.endswith(INCOMPLETE) and path.is_dir() and not path.is_symlink()
        ]


def _is_of(folder: Path, unit: str) -> bool:
    return folder.name.startswith(f"{unit}-")


def _age(folder: Path) -> tuple[int, str]:
    try:
        return folder.stat().st_mtime_ns, folder.name
    except FileNotFoundError:  # made room for a newer one meanwhile
        return 0, folder.name


def _kept(folder: Path) -> Kept:
    try:
        manifest, fault = read_manifest(folder), None
    except ConfigError as error:
        manifest, fault = None, str(error).replace(str(folder), folder.name)
    return Kept(folder.name, manifest, fault, _alarms(folder / ALARM), _n_bytes(folder))


def _alarms(path: Path) -> list[Mapping[str, Any]]:
    """What a recording was made for; nothing where that cannot be read."""
    try:
        with path.open("rb") as file:
            found = json.loads(file.read(MAX_ALARM_BYTES))["alarms"]
        return [
            {key: each[key] for key in ("alarm", "occurrence", "change", "level", "time")}
            for each in found
        ]
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _n_bytes(folder: Path) -> int:
    n_bytes = 0
    for name in FILES:
        try:
            n_bytes += (folder / name).stat().st_size
        except OSError:
            continue
    return n_bytes
