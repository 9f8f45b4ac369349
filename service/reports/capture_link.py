"""The link from a bundle to the samples around its alarm, once these are complete."""

import json
from pathlib import Path
from typing import Literal

from pydantic import ValidationError

from acquisition.recordings.manifest import MANIFEST
from service.recordings.folders import ALARM
from service.reports.document import FilePart, file_part
from service.reports.folders import CAPTURE, places
from service.reports.parts import EvidencePart
from service.runtime.files import write_whole


class CapturePart(EvidencePart):
    """What has become of the samples around an alarm."""

    state: Literal["complete", "lost"]
    """Whether they are there."""

    folder: str | None
    """Recording that holds them, seen from the folder of the evidence."""

    manifest: FilePart | None
    """Its manifest, which in turn has the hashes of the samples."""

    reason: str | None
    """Why they are lost."""


def link(folder: Path, capture: Path) -> None:
    """Note in the folder of a bundle which recording holds the samples.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    relative = Path("../../..") / capture.parent.name / capture.name
    manifest = file_part(capture / MANIFEST)
    _write(
        folder,
        CapturePart(state="complete", folder=str(relative), manifest=manifest, reason=None),
    )


def note_lost(folder: Path, reason: str) -> None:
    """Note in the folder of a bundle that the samples are lost.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    _write(folder, CapturePart(state="lost", folder=None, manifest=None, reason=reason))


def linked(folder: Path) -> CapturePart | None:
    """What a bundle says of its samples; None if nothing yet."""
    try:
        return CapturePart.model_validate_json((folder / CAPTURE).read_bytes())
    except (FileNotFoundError, ValidationError):
        return None


def captures_in_use(root: Path) -> frozenset[str]:
    """Names of the recordings that bundles refer to."""
    parts = (linked(each.folder) for each in places(root))
    return frozenset(Path(part.folder).name for part in parts if part and part.folder)


def link_all(root: Path, captures: Path) -> int:
    """Link what a crash has left unlinked; return how many links were made.

    Raises
    ------
    OSError
        If the disk refuses.
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
    """Finished recordings by the occurrences of alarms that they were made for."""
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
        return []  # not written by us


def _write(folder: Path, part: CapturePart) -> None:
    write_whole(folder / CAPTURE, part.model_dump_json(indent=1).encode() + b"\n")
