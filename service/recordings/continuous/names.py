"""Names of the folders of a continuous recording, finished or being written."""

import os
import re
from datetime import UTC, datetime
from pathlib import Path

from core.units import NS_PER_S

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
