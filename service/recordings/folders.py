"""Folders of recordings: names, which show the state of the recording, and file operations."""

import os
import re
import uuid
from collections.abc import Container, Iterator
from itertools import count
from pathlib import Path

from acquisition.recordings.manifest import BLOCKS, MANIFEST, SAMPLES
from acquisition.recordings.writer import INCOMPLETE
from service.runtime.files import write_whole
from service.runtime.times import compact

CONTINUOUS = "continuous"
"""Last part of the name of a continuous recording; a capture name ends with the alarm kind."""

PARTS = ".parts"
"""Suffix of the folder that holds the parts of a segment until they are joined."""

REMOVED = ".removed"
"""Suffix of the folder of a recording that is being removed."""

LEFT = ".left"
"""Suffix of the folder of a removed recording that still contains files of other programs."""

DAMAGED = ".damaged"
"""Suffix of the folder of a recording that is damaged."""

UNFINISHED = (INCOMPLETE, PARTS, REMOVED)

ALARM = "alarm.json"

FILES = (ALARM, MANIFEST, BLOCKS, SAMPLES)
"""Names of the files of a recording, in the order of removal; other files are never removed."""

_NAME = re.compile(r"(.+)-\d{8}T\d{6}\.\d{3}Z-")


def new_folder(root: Path, unit: str, time_ns: int, kind: str) -> Path:
    """Return an unused path for a recording's folder; its name has unit, start time and `kind`."""
    return _free(root / f"{unit}-{compact(time_ns)}-{kind}", "", PARTS, INCOMPLETE)


def unit_of(name: str) -> str | None:
    """Return the unit id in the name of a recording; None if it is not the name of a recording."""
    found = _NAME.match(name)
    return found[1] if found else None


def incomplete_folder(folder: Path) -> Path:
    """Return the temporary folder of a recording that is being written."""
    return folder.with_name(folder.name + INCOMPLETE)


def parts_folder(folder: Path) -> Path:
    """Return the folder of the parts of a segment until they are joined."""
    return folder.with_name(folder.name + PARTS)


def damaged_folder(folder: Path, part: Path) -> Path:
    """Return an unused path for the folder of an unreadable part of a segment."""
    return _suffixed(folder.with_name(f"{folder.name}-{part.name}"), DAMAGED)


def remove_incomplete(root: Path, units: Container[str | None]) -> list[Path]:
    """Remove the incomplete recordings of units after a crash of the service; return their folders.

    Recordings of other units are kept: another process may be writing them. If `units` contains
    None, recordings whose names have no unit are removed as well. Raises `OSError` if the disk
    cannot be read or written.
    """
    found = [
        path
        for path in sorted(root.glob(f"*{INCOMPLETE}"))
        if unit_of(path.name) in units
        and path.is_dir()
        and not path.is_symlink()
        and all(file.name in FILES for file in path.iterdir())
    ]
    for path in found:
        remove_recording(path)
    return found


def remove_recording(folder: Path) -> None:
    """Remove a recording if it exists.

    The manifest is removed first, so that an interrupted removal leaves no folder that looks
    complete.
    """
    if folder.is_dir():
        for name in FILES:
            (folder / name).unlink(missing_ok=True)
        folder.rmdir()


def finished(root: Path) -> Iterator[str]:
    """Yield the names of finished recordings in a folder, including damaged recordings.

    Raises `OSError` if the folder cannot be read.
    """
    if not root.is_dir():
        return
    with os.scandir(root) as entries:
        names = [e.name for e in entries if e.is_dir(follow_symlinks=False)]
    yield from (n for n in names if not n.endswith((*UNFINISHED, LEFT)) and n[0] != ".")


def is_recording(folder: Path) -> bool:
    """Return whether a folder contains some or all files of a recording, and no other files.

    Raises
    ------
    OSError
        If the folder cannot be read; folders without a recording's name may be inaccessible.
    """
    try:
        names = {path.name for path in folder.iterdir()}
    except FileNotFoundError:
        return False
    except PermissionError:
        if unit_of(folder.name) is None:
            return False  # for example lost+found
        raise
    return bool(names & {MANIFEST, BLOCKS, SAMPLES}) and names <= set(FILES)


def being_removed(root: Path) -> list[str]:
    """Return the names of recordings whose removal has begun but is not finished."""
    return sorted(p.name.removesuffix(REMOVED) for p in root.glob(f"*{REMOVED}") if p.is_dir())


def begin_removal(folder: Path) -> None:
    """Rename the folder of a recording to mark it as being removed; `finished` then omits it.

    Raises `OSError` if the folder cannot be renamed.
    """
    folder.rename(_removed(folder))


def delete_files(folder: Path) -> None:
    """Delete the files of a recording after `begin_removal`; a repeated call has no effect.

    Raises `OSError` if the disk cannot be read or written.
    """
    for name in FILES:
        (_removed(folder) / name).unlink(missing_ok=True)


def finish_removal(folder: Path) -> Path | None:
    """Remove the folder of a recording after `delete_files`.

    Returns
    -------
    Path or None
        Renamed folder if it contains files of other programs, else None.

    Raises
    ------
    OSError
        If the folder cannot be removed.
    """
    removed = _removed(folder)
    names = {path.name for path in removed.iterdir()}
    if names & set(FILES):
        return None  # the failure was reported when files were deleted
    if not names:
        removed.rmdir()
        return None
    return removed.rename(_suffixed(folder, LEFT))


def set_aside(folder: Path) -> Path:
    """Rename the folder of a recording to mark it as damaged; return the new path.

    A marked folder is not renamed again. Raises `OSError` if the folder cannot be renamed.
    """
    if folder.name.endswith(DAMAGED):
        return folder
    return folder.rename(_suffixed(folder, DAMAGED))


def n_bytes_of(folder: Path) -> int:
    """Return the total size in bytes of the files of a recording, without inaccessible files."""
    sizes = 0
    for name in FILES:
        try:
            sizes += (folder / name).stat().st_size
        except OSError:
            continue
    return sizes


PLACE_FILE = "place.txt"


def place_of(data_folder: Path) -> str:
    """Return the permanent identifier of a data folder; create it if it is missing or invalid.

    Raises `OSError` if the disk cannot be read or written.
    """
    path = data_folder / PLACE_FILE
    try:
        found = path.read_text(encoding="ascii", errors="replace").strip()
        if re.fullmatch(r"[0-9a-f]{32}", found):
            return found
    except FileNotFoundError:
        data_folder.mkdir(parents=True, exist_ok=True)
    name = uuid.uuid4().hex
    write_whole(path, f"{name}\n".encode("ascii"))
    return name


def _removed(folder: Path) -> Path:
    return folder.with_name(folder.name + REMOVED)


def _suffixed(folder: Path, suffix: str) -> Path:
    """Return an unused folder with a suffix; add a number before the suffix if necessary."""
    free = _free(folder, suffix)
    return free.with_name(free.name + suffix)


def _free(folder: Path, *suffixes: str) -> Path:
    """Return a path that does not exist with any of the suffixes; add a number if necessary."""
    names = (folder.name if n == 1 else f"{folder.name}-{n}" for n in count(1))
    return next(
        found
        for found in map(folder.with_name, names)
        if not any(os.path.lexists(f"{found}{suffix}") for suffix in suffixes)
    )
