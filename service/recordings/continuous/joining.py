"""Parts of a stretch made into one recording, now or after a crash."""

from collections.abc import Container, Iterator, Sequence
from pathlib import Path

import structlog

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import BLOCKS, MANIFEST, SAMPLES, RecordedUnit
from acquisition.recordings.reader import Recording, open_recording
from acquisition.recordings.writer import INCOMPLETE, RecordingWriter
from service.recordings.continuous.names import (
    PARTS,
    damaged_folder,
    joined_folder,
    parts_folder,
    unit_of,
)

log = structlog.get_logger()

FILES = (MANIFEST, BLOCKS, SAMPLES)


def join(folder: Path) -> bool:
    """Make one recording of the parts of a stretch; return whether there is one then.

    Whatever happens in between, it can be done again. A part that cannot be read is set aside.

    Raises
    ------
    ConfigError, OSError
        If the disk refuses; the parts are all there still.
    """
    parts = parts_folder(folder)
    _remove_aside(folder)
    if not folder.exists():
        found = list(_readable(parts))
        if found:
            _write(folder, found)
    _remove_parts(parts)
    return folder.exists()


def unjoined(root: Path, units: Container[str | None]) -> list[Path]:
    """Stretches of units that a crash has left in parts, oldest first of each.

    Other processes may be writing those of other units.
    """
    found = sorted(path for path in root.glob(f"*{PARTS}") if unit_of(path.name) in units)
    return [joined_folder(path) for path in found if path.is_dir()]


def clear_unfinished(root: Path, units: Container[str | None]) -> None:
    """Remove what was being joined when the service was killed; its parts are still there.

    Raises
    ------
    OSError
        If the disk refuses.
    """
    for path in sorted(root.glob(f"*{INCOMPLETE}")):
        if unit_of(path.name) in units:
            _remove_folder(path)


def _readable(parts: Path) -> Iterator[Recording]:
    for part in sorted(parts.iterdir()):
        if part.name.endswith(INCOMPLETE):
            continue
        try:
            yield open_recording(part)
        except ConfigError as error:
            aside = damaged_folder(parts, part)
            part.rename(aside)
            log.error(
                "a part of a continuous recording is set aside",
                folder=aside.name,
                reason=str(error),
            )


def _write(folder: Path, parts: Sequence[Recording]) -> None:
    first = parts[0].manifest
    unit = RecordedUnit(**{name: getattr(first, name) for name in RecordedUnit.model_fields})
    with RecordingWriter(folder, unit, first.made_by) as writer:
        for part in parts:
            for raw in part.raw_blocks():
                writer.write(raw)


def _remove_aside(folder: Path) -> None:
    _remove_folder(folder.with_name(folder.name + INCOMPLETE))


def _remove_parts(parts: Path) -> None:
    for part in sorted(parts.iterdir()):
        _remove_folder(part)
    parts.rmdir()


def _remove_folder(folder: Path) -> None:
    """Remove a recording, manifest first: half of one is none."""
    if not folder.is_dir():
        return
    for name in FILES:
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()
