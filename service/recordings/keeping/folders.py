"""Recordings as they lie in their folders, and how one is taken away so that no half is left."""

import os
from collections.abc import Iterator
from pathlib import Path

from acquisition.recordings.manifest import BLOCKS, MANIFEST, SAMPLES
from acquisition.recordings.writer import INCOMPLETE
from service.recordings.capture.folders import FILES
from service.recordings.continuous.names import DAMAGED, PARTS, unit_of

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
