"""Names, places and states of recordings in their folders."""

import os
import re
import uuid
from collections.abc import Container, Iterator
from datetime import UTC, datetime
from pathlib import Path

from acquisition.recordings.manifest import BLOCKS, MANIFEST, SAMPLES
from acquisition.recordings.writer import INCOMPLETE
from core.alarms.alarm import AlarmEvent
from core.units import NS_PER_S
from service.runtime.files import write_whole

KIND = "continuous"
"""Last word of a stretch's name, where a capture has the kind of its alarm."""

PARTS = ".parts"
"""Ending of the folder that holds the parts of a stretch until they are joined."""

NAME = re.compile(r"(.+)-\d{8}T\d{6}\.\d{3}Z-")
"""How the name of a recording begins: with its unit and its time."""

DAMAGED = ".damaged"
"""Ending of what was set aside because it cannot be read."""


def stretch_folder(root: Path, unit: str, start_ns: int) -> Path:
    """A folder for a stretch that is not there yet, in any state."""
    seconds, ns = divmod(start_ns, NS_PER_S)
    moment = f"{datetime.fromtimestamp(seconds, UTC):%Y%m%dT%H%M%S}.{ns // 1_000_000:03d}Z"
    name = f"{unit}-{moment}-{KIND}"
    folder, n = root / name, 1
    while os.path.lexists(folder) or os.path.lexists(parts_folder(folder)):
        n += 1
        folder = root / f"{name}-{n}"
    return folder


def unit_of(name: str) -> str | None:
    """The unit that a recording is of by its name; None if that is not the name of one."""
    found = NAME.match(name)
    return found[1] if found else None


def parts_folder(folder: Path) -> Path:
    """Where the parts of a stretch are until they are joined."""
    return folder.with_name(folder.name + PARTS)


def joined_folder(parts: Path) -> Path:
    """Where the stretch is going to be whose parts are in a folder."""
    return parts.with_name(parts.name.removesuffix(PARTS))


def part_folder(folder: Path, number: int) -> Path:
    """A part of a stretch."""
    return parts_folder(folder) / f"{number:05d}"


def damaged_folder(parts: Path, part: Path) -> Path:
    """Where a part goes that cannot be read."""
    stem = joined_folder(parts).name
    folder, n = parts.with_name(f"{stem}-{part.name}{DAMAGED}"), 1
    while os.path.lexists(folder):
        n += 1
        folder = parts.with_name(f"{stem}-{part.name}-{n}{DAMAGED}")
    return folder


ALARM = "alarm.json"

FILES = (ALARM, MANIFEST, BLOCKS, SAMPLES)
"""All that is ever removed: a folder with anything else in it is none of ours."""


def capture_folder(root: Path, event: AlarmEvent) -> Path:
    """A folder for the capture of an alarm that is not there yet."""
    seconds, ns = divmod(event.time_ns, NS_PER_S)
    moment = f"{datetime.fromtimestamp(seconds, UTC):%Y%m%dT%H%M%S}.{ns // 1_000_000:03d}Z"
    name = f"{event.identity.unit}-{moment}-{event.identity.kind}"
    folder, n = root / name, 1
    while os.path.lexists(folder) or os.path.lexists(aside(folder)):
        n += 1
        folder = root / f"{name}-{n}"
    return folder


def aside(folder: Path) -> Path:
    """Where a capture is while it is being written."""
    return folder.with_name(folder.name + INCOMPLETE)


def clear_leftovers(root: Path, units: Container[str | None]) -> list[Path]:
    """Remove what was being written of units when the service was killed: it cannot be read.

    Other processes may be writing captures of other units.
    """
    left = [p for p in _folders(root) if p.name.endswith(INCOMPLETE) and unit_of(p.name) in units]
    for path in left:
        _remove(path)
    return left


def _folders(root: Path) -> Iterator[Path]:
    if not root.is_dir():
        return iter(())
    folders = (path for path in root.iterdir() if path.is_dir() and not path.is_symlink())
    return (path for path in folders if all(file.name in FILES for file in path.iterdir()))


def _remove(folder: Path) -> None:
    for name in FILES:
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()


REMOVED = ".removed"
"""Ending of the name while a recording is being taken away."""

LEFT = ".left"
"""Ending of what is left of one that is gone: files of others, which are none of our business."""

UNFINISHED = (INCOMPLETE, PARTS, REMOVED)


def finished(root: Path) -> Iterator[str]:
    """Names of the recordings in a folder, damaged ones too; nothing else that lies there.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    if not root.is_dir():
        return
    with os.scandir(root) as entries:
        names = [e.name for e in entries if e.is_dir(follow_symlinks=False)]
    others = (*UNFINISHED, LEFT)
    yield from (name for name in names if not name.endswith(others) and name[0] != ".")


def is_recording(folder: Path) -> bool:
    """Whether a folder holds a recording or what is left of one, and nothing else.

    Raises
    ------
    OSError
        If the disk refuses; a folder that has no name of ours may be closed to us.
    """
    try:
        names = {path.name for path in folder.iterdir()}
    except FileNotFoundError:
        return False
    except PermissionError:
        if unit_of(folder.name) is None:
            return False  # such as lost+found
        raise
    return bool(names & {MANIFEST, BLOCKS, SAMPLES}) and names <= set(FILES)


def being_removed(root: Path) -> list[str]:
    """Names of recordings that are being taken away."""
    return sorted(p.name.removesuffix(REMOVED) for p in root.glob(f"*{REMOVED}") if p.is_dir())


def put_out_of_sight(folder: Path) -> None:
    """Begin to take a recording away: from now on there is none of that name."""
    folder.rename(_hidden(folder))


def empty(folder: Path) -> None:
    """Delete the files of a recording that was put out of sight; may be done again.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    for name in FILES:
        (_hidden(folder) / name).unlink(missing_ok=True)


def finish_removal(folder: Path) -> Path | None:
    """Remove what `empty` has left; where it is from now on if it holds what is not ours.

    That gets a name by which nobody takes it for a recording or tries to remove it again.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    hidden = _hidden(folder)
    names = {path.name for path in hidden.iterdir()}
    if names & set(FILES):
        return None  # it was not emptied, which was told
    if not names:
        hidden.rmdir()
        return None
    return _renamed(hidden, folder.name, LEFT)


def set_aside(folder: Path) -> Path:
    """Give what cannot be read a name that says so; return where it is then."""
    if folder.name.endswith(DAMAGED):
        return folder
    return _renamed(folder, folder.name, DAMAGED)


def _hidden(folder: Path) -> Path:
    return folder.with_name(folder.name + REMOVED)


def _renamed(folder: Path, stem: str, ending: str) -> Path:
    """Give a folder a name that is free."""
    wanted, n = folder.with_name(f"{stem}{ending}"), 1
    while os.path.lexists(wanted):
        n += 1
        wanted = folder.with_name(f"{stem}-{n}{ending}")
    folder.rename(wanted)
    return wanted


def n_bytes_of(folder: Path) -> int:
    """Size of all files of a recording that are there."""
    sizes = 0
    for name in FILES:
        try:
            sizes += (folder / name).stat().st_size
        except OSError:
            continue
    return sizes


FILE = "place.txt"


def place_of(data_folder: Path) -> str:
    """A name that the data folder keeps for ever; made when it is asked for first.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    path = data_folder / FILE
    try:
        found = path.read_text(encoding="ascii", errors="replace").strip()
        if re.fullmatch(r"[0-9a-f]{32}", found):
            return found
    except FileNotFoundError:
        data_folder.mkdir(parents=True, exist_ok=True)
    name = uuid.uuid4().hex
    write_whole(path, f"{name}\n".encode("ascii"))
    return name
