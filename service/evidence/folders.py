"""Folders of bundles: their names, how much they may hold, what a crash has left."""

import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from core.alarms.event import AlarmEvent
from core.units import NS_PER_S
from service.evidence.clock_words import compact
from service.evidence.files import sync_folder, write_synced, write_whole

DOCUMENT, CAPTURE = "evidence.json", "capture.json"

INCOMPLETE = ".incomplete"

REMOVED = "removed.txt"

KEPT_SINCE = "kept_since.txt"

MAX_REMOVED = 10_000
"""Names that are remembered of each unit."""

NAME = re.compile(
    r"(\d{8}T\d{6}\.\d{3}Z)-([A-Za-z0-9][A-Za-z0-9_.-]{0,31})-([a-z0-9_]+)-(\d{1,12})"
)

UNIT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")

DAY_NS = 86_400 * NS_PER_S


@dataclass(frozen=True)
class EvidenceLimits:
    """How much space bundles may take.

    Parameters
    ----------
    max_bytes
        Beyond it the oldest go that are older than `keep_days`.
    hard_max_bytes
        Beyond it the oldest go, however young.
    max_per_alarm
        Beyond it the oldest of that alarm go: one that chatters must not push out all others.
    trend_days
        How long before an alarm the readings of its film go with it.
    """

    max_bytes: int = 2_000_000_000
    hard_max_bytes: int = 4_000_000_000
    keep_days: float = 30.0
    max_per_alarm: int = 200
    trend_days: float = 14.0


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
    return Place(
        root / own.unit / name, own.unit, own.subject, own.kind.value, event.occurrence, moment
    )


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


def make_room(root: Path, limits: EvidenceLimits, now_ns: int) -> list[Place]:
    """Remove the oldest bundles until all together fit; the newest always stays.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    found = places(root)
    going = set(_surplus(found, limits.max_per_alarm))
    sizes = {each: _size(each.folder) for each in found}
    n_bytes = sum(size for each, size in sizes.items() if each not in going)
    young = compact(now_ns - round(limits.keep_days * DAY_NS))
    for each in found[:-1]:
        limit = limits.max_bytes if each.moment < young else limits.hard_max_bytes
        if each not in going and n_bytes > limit:
            going.add(each)
            n_bytes -= sizes[each]
    gone = [each for each in found if each in going]
    for each in gone:
        remove(root, each)
    return gone


def remove(root: Path, place: Place) -> None:
    """Remove a bundle, and remember that it was there."""
    path = root / place.unit / REMOVED
    names = [*removed(root, place.unit), place.folder.name][-MAX_REMOVED:]
    write_synced(path, "".join(f"{name}\n" for name in names).encode())
    aside = place.folder.with_name(place.folder.name + INCOMPLETE)
    place.folder.rename(aside)  # never half a bundle under its name
    shutil.rmtree(aside)
    sync_folder(aside.parent)


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


def _surplus(found: list[Place], most: int) -> Iterator[Place]:
    by_alarm: dict[str, list[Place]] = {}
    for each in found:
        by_alarm.setdefault(each.alarm, []).append(each)
    for own in by_alarm.values():
        yield from own[:-most]


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.iterdir())
