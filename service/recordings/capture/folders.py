"""The folder of captures: names, and what a crash has left in it."""

import os
from collections.abc import Container, Iterator
from datetime import UTC, datetime
from pathlib import Path

from acquisition.recordings.manifest import BLOCKS, MANIFEST, SAMPLES
from acquisition.recordings.writer import INCOMPLETE
from core.alarms.alarm import AlarmEvent
from core.units import NS_PER_S
from service.recordings.continuous.names import unit_of

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
