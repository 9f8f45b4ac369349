"""How far a unit is recorded already, so that the hole of an outage can be told exactly."""

from pathlib import Path

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import read_manifest
from acquisition.recordings.reader import open_recording
from service.recordings.continuous.names import KIND, unit_of

MAX_TRIED = 3
"""Newest recordings that are looked at, should the newest be damaged."""


def last_end(root: Path, unit: str) -> tuple[int, int] | None:
    """Epoch and index after the last sample that is recorded of a unit; None if none is known."""
    # another unit may have a name that begins like that of this one
    of_unit = (path for path in root.glob(f"{unit}-*-{KIND}*") if unit_of(path.name) == unit)
    for folder in sorted(of_unit, reverse=True)[:MAX_TRIED]:
        try:
            if read_manifest(folder).unit == unit:
                return _end_of(folder)
        except ConfigError:
            continue  # the check of recordings tells of it
    return None


def _end_of(folder: Path) -> tuple[int, int] | None:
    end = None
    for head in open_recording(folder).heads():
        end = (head.epoch, head.first_index + head.n_samples)
    return end
