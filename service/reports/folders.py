"""Folders of evidence bundles, and links from bundles to the recordings of their samples."""

import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import ValidationError

from acquisition.recordings.manifest import MANIFEST
from core.alarms.alarm import AlarmEvent
from service.recordings.folders import ALARM
from service.reports.document import FilePart, file_part
from service.reports.parts import EvidencePart
from service.runtime.files import write_whole
from service.runtime.times import compact

DOCUMENT, CAPTURE = "evidence.json", "capture.json"

INCOMPLETE = ".incomplete"

REMOVED = "removed.txt"

KEPT_SINCE = "kept_since.txt"

NAME = re.compile(
    r"(\d{8}T\d{6}\.\d{3}Z)-([A-Za-z0-9][A-Za-z0-9_.-]{0,31})-([a-z0-9_]+)-(\d{1,12})"
)


@dataclass(frozen=True)
class Place:
    """Location of a bundle, and its alarm.

    `moment` is the UTC time of the event in the folder's name, such as 20260101T000000.000Z.
    """

    folder: Path
    unit: str
    subject: str
    kind: str
    occurrence: int
    moment: str

    @property
    def alarm(self) -> str:
        """Identifier of the alarm: unit, subject and kind, separated by colons."""
        return f"{self.unit}:{self.subject}:{self.kind}"


def place_of(root: Path, event: AlarmEvent) -> Place:
    """Return the location of the bundle of an alarm event, whether or not the bundle exists."""
    own, moment = event.identity, compact(event.time_ns)
    name = f"{moment}-{own.subject}-{own.kind}-{event.occurrence}"
    return Place(root / own.unit / name, own.unit, own.subject, own.kind, event.occurrence, moment)


def places(root: Path, unit: str | None = None) -> list[Place]:
    """Return the locations of the complete bundles of a unit (None: of all), oldest first."""
    units = [root / unit] if unit else sorted(path for path in root.glob("*") if path.is_dir())
    found = (_place(path) for each in units if each.is_dir() for path in each.iterdir())
    return sorted((each for each in found if each), key=lambda each: (each.moment, each.folder))


def note_beginning(root: Path, now_ns: int) -> None:
    """Write `now_ns`, ns since 1970 UTC, as the time since which evidence is kept, if none is yet.

    Raises `OSError` if the file or its folder cannot be written.
    """
    path = root / KEPT_SINCE
    if not path.exists():
        root.mkdir(parents=True, exist_ok=True)
        write_whole(path, f"{now_ns}\n".encode())


def kept_since_ns(root: Path) -> int | None:
    """Return the time since which evidence is kept, ns since 1970 UTC; None if it is not kept."""
    path = root / KEPT_SINCE
    return int(path.read_text(encoding="utf-8")) if path.is_file() else None


def clear_leftovers(root: Path) -> list[Path]:
    """Remove the folders of bundles that a crash left unfinished; return their paths.

    Raises `OSError` if a folder cannot be removed.
    """
    left = [path for path in root.glob(f"*/*{INCOMPLETE}") if path.is_dir()]
    for path in left:
        shutil.rmtree(path)
    return left


def removed(root: Path, unit: str) -> list[str]:
    """Return the folder names of a unit's bundles that were removed to free space, oldest first."""
    path = root / unit / REMOVED
    return path.read_text(encoding="utf-8").splitlines() if path.is_file() else []


def parsed(name: str) -> tuple[str, str, int] | None:
    """Return subject, kind and occurrence in the folder name of a bundle; None for other names."""
    match = NAME.fullmatch(name)
    return None if match is None else (match[2], match[3], int(match[4]))


def _place(path: Path) -> Place | None:
    found = parsed(path.name)
    if found is None or not path.is_dir() or path.is_symlink():
        return None
    subject, kind, occurrence = found
    return Place(path, path.parent.name, subject, kind, occurrence, path.name.partition("-")[0])


class CapturePart(EvidencePart):
    """Link from a bundle to the recording of the samples around its alarm."""

    state: Literal["complete", "lost"]
    """State of the samples: recorded completely, or lost."""

    folder: str | None
    """Folder of the recording, relative to the folder of the bundle; null if lost."""

    manifest: FilePart | None
    """Manifest of the recording, which contains the checksums of the samples; null if lost."""

    reason: str | None
    """Reason why the samples are lost; null if complete."""


def link(folder: Path, capture: Path) -> None:
    """Write the link from the bundle in `folder` to the recording of its samples in `capture`.

    Raises
    ------
    OSError
        If the manifest cannot be read or the link cannot be written.
    """
    relative = Path("../../..") / capture.parent.name / capture.name
    manifest = file_part(capture / MANIFEST)
    _write_link(
        folder,
        CapturePart(state="complete", folder=str(relative), manifest=manifest, reason=None),
    )


def note_lost(folder: Path, reason: str) -> None:
    """Write the link file of a bundle whose samples are lost, with the reason.

    Raises
    ------
    OSError
        If the link cannot be written.
    """
    _write_link(folder, CapturePart(state="lost", folder=None, manifest=None, reason=reason))


def linked(folder: Path) -> CapturePart | None:
    """Return the link from a bundle to its samples; None if it is missing or invalid."""
    try:
        return CapturePart.model_validate_json((folder / CAPTURE).read_bytes())
    except (FileNotFoundError, ValidationError):
        return None


def captures_in_use(root: Path) -> frozenset[str]:
    """Return the folder names of the recordings that bundles link to."""
    parts = (linked(each.folder) for each in places(root))
    return frozenset(Path(part.folder).name for part in parts if part and part.folder)


def link_all(root: Path, captures: Path) -> int:
    """Link bundles to their recordings where a crash prevented it; return the number of new links.

    `root` is the folder of the bundles, `captures` that of the recordings around alarms.

    Raises
    ------
    OSError
        If a recording cannot be read or a link cannot be written.
    """
    bare = [each for each in places(root) if not (each.folder / CAPTURE).exists()]
    if not bare:
        return 0
    found, n = _captures(captures), 0
    for each in bare:
        capture = found.get((each.alarm, each.occurrence))
        if capture is not None:
            link(each.folder, capture)
            n += 1
    return n


def _captures(folder: Path) -> dict[tuple[str, int], Path]:
    found = {}
    for path in sorted(folder.glob(f"*/{ALARM}")):
        if (path.parent / MANIFEST).is_file():
            for name in _alarms(path):
                found[name] = path.parent
    return found


def _alarms(path: Path) -> list[tuple[str, int]]:
    try:
        events = json.loads(path.read_bytes())["alarms"]
        return [(str(event["alarm"]), int(event["occurrence"])) for event in events]
    except (ValueError, KeyError, TypeError):
        return []  # a file of another program


def _write_link(folder: Path, part: CapturePart) -> None:
    write_whole(folder / CAPTURE, part.model_dump_json(indent=1).encode() + b"\n")


@dataclass(frozen=True)
class EvidenceFolders:
    """Folders of bundles (`evidence`), captures and configurations, below the data folder."""

    evidence: Path
    captures: Path
    configurations: Path
