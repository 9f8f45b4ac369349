"""Folders of bundles: their names, and what a crash has left."""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from core.alarms.alarm import AlarmEvent
from service.runtime.files import write_whole
from service.runtime.times import compact

DOCUMENT, CAPTURE = "evidence.json", "capture.json"

INCOMPLETE = ".incomplete"

REMOVED = "removed.txt"

KEPT_SINCE = "kept_since.txt"

NAME = re.compile(
    r"(\d{8}T\d{6}\.\d{3}Z)-([A-Za-z0-9][A-Za-z0-9_.-]{0,31})-([a-z0-9_]+)-(\d{1,12})"
)

UNIT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")


@dataclass(frozen=True)
class Place:
    """Which bundle a folder holds."""

    folder: Path
    unit: str
    subject: str
    kind: str
    occurrence: int
    moment: str

    @property
    def alarm(self) -> str:
        """Identifier of the alarm."""
        return f"{self.unit}:{self.subject}:{self.kind}"


def place_of(root: Path, event: AlarmEvent) -> Place:
    """Where the bundle of an event belongs."""
    own, moment = event.identity, compact(event.time_ns)
    name = f"{moment}-{own.subject}-{own.kind}-{event.occurrence}"
    return Place(root / own.unit / name, own.unit, own.subject, own.kind, event.occurrence, moment)


def places(root: Path, unit: str | None = None) -> list[Place]:
    """All finished bundles, or those of one unit, oldest first."""
    units = [root / unit] if unit else sorted(path for path in root.glob("*") if path.is_dir())
    found = (_place(path) for each in units if each.is_dir() for path in each.iterdir())
    return sorted((each for each in found if each), key=lambda each: (each.moment, each.folder))


def note_beginning(root: Path, now_ns: int) -> None:
    """Note since when evidence is kept, so that what was before is not taken for lost."""
    path = root / KEPT_SINCE
    if not path.exists():
        root.mkdir(parents=True, exist_ok=True)
        write_whole(path, f"{now_ns}\n".encode())


def kept_since_ns(root: Path) -> int | None:
    """Since when evidence is kept; None if it never was."""
    path = root / KEPT_SINCE
    return int(path.read_text(encoding="utf-8")) if path.is_file() else None


def clear_leftovers(root: Path) -> list[Path]:
    """Remove what was being written when the service was killed."""
    left = [path for path in root.glob(f"*/*{INCOMPLETE}") if path.is_dir()]
    for path in left:
        shutil.rmtree(path)
    return left


def removed(root: Path, unit: str) -> list[str]:
    """Names of bundles that were removed to make room."""
    path = root / unit / REMOVED
    return path.read_text(encoding="utf-8").splitlines() if path.is_file() else []


def parsed(name: str) -> tuple[str, str, int] | None:
    """Subject, kind and occurrence in the name of a folder."""
    match = NAME.fullmatch(name)
    return None if match is None else (match[2], match[3], int(match[4]))


def _place(path: Path) -> Place | None:
    found = parsed(path.name)
    if found is None or not path.is_dir() or path.is_symlink():
        return None
    subject, kind, occurrence = found
    return Place(path, path.parent.name, subject, kind, occurrence, path.name.partition("-")[0])
