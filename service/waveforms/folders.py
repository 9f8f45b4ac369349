"""Recordings as they lie in their folders, and how one is taken away so that no half is left."""

import os
from collections.abc import Iterator
from pathlib import Path

from acquisition.recording.manifest import BLOCKS, MANIFEST, SAMPLES
from acquisition.recording.writer import INCOMPLETE
from service.capture.folders import FILES
from service.continuous.names import DAMAGED, PARTS

REMOVED = ".removed"
"""Ending of the name while a recording is being taken away."""

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
    yield from (name for name in names if not name.endswith(UNFINISHED) and name[0] != ".")


def is_recording(folder: Path) -> bool:
    """Whether a folder holds a recording or what is left of one, and nothing else."""
    try:
        names = {path.name for path in folder.iterdir()}
    except FileNotFoundError:
        return False
    return bool(names & {MANIFEST, BLOCKS, SAMPLES}) and names <= set(FILES)


def being_removed(root: Path) -> list[str]:
    """Names of recordings whose removal a crash has interrupted."""
    return sorted(p.name.removesuffix(REMOVED) for p in root.glob(f"*{REMOVED}") if p.is_dir())


def put_out_of_sight(folder: Path) -> None:
    """Begin to take a recording away: from now on there is none of that name."""
    folder.rename(folder.with_name(folder.name + REMOVED))


def take_away(folder: Path) -> None:
    """Finish what `put_out_of_sight` has begun; may be done again.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    hidden = folder.with_name(folder.name + REMOVED)
    if not hidden.is_dir():
        return
    for name in FILES:
        (hidden / name).unlink(missing_ok=True)
    hidden.rmdir()


def set_aside(folder: Path) -> Path:
    """Give what cannot be read a name that says so; return where it is then."""
    if folder.name.endswith(DAMAGED):
        return folder
    aside, n = folder.with_name(folder.name + DAMAGED), 1
    while os.path.lexists(aside):
        n += 1
        aside = folder.with_name(f"{folder.name}-{n}{DAMAGED}")
    folder.rename(aside)
    return aside


def n_bytes_of(folder: Path) -> int:
    """Size of all files of a recording that are there."""
    sizes = 0
    for name in FILES:
        try:
            sizes += (folder / name).stat().st_size
        except OSError:
            continue
    return sizes
