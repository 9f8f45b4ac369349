"""A recording on its way to the disk: written part by part, readable after a crash."""

import json
import os
from collections.abc import Callable, Container, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import structlog

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import BLOCKS, MANIFEST, SAMPLES, RecordedUnit, checksum_of
from acquisition.recordings.reader import Recording, open_recording
from acquisition.recordings.writer import INCOMPLETE, RecordingWriter
from core.alarms.alarm import AlarmEvent
from core.samples.blocks import SampleBlock
from core.units import ns_from_s
from service.recordings.folders import (
    ALARM,
    PARTS,
    aside,
    capture_folder,
    damaged_folder,
    joined_folder,
    part_folder,
    parts_folder,
    stretch_folder,
    unit_of,
)
from service.runtime.times import rfc3339


@dataclass(frozen=True)
class SegmentSettings:
    """How a continuous recording is cut.

    Parameters
    ----------
    stretch_s
        Length of a finished recording.
    part_s
        What is written and synced at once: a kill costs no more than this, and what waits.
    """

    stretch_s: float = 600.0
    part_s: float = 30.0


MakeWriter = Callable[[Path, str], RecordingWriter]
"""Opens a recording of the unit: folder and who made it."""


class CaptureError(Exception):
    """A capture cannot be written; the message says which and why."""


class CaptureFile:
    """A recording with the alarms it was made for; complete with its name, or not there at all.

    Attributes
    ----------
    finished
        Where it is, once it is complete.
    """

    def __init__(self, root: Path, event: AlarmEvent, make_writer: MakeWriter) -> None:
        self._root, self._event, self._make_writer = root, event, make_writer
        self._writer: RecordingWriter | None = None
        self.folder: Path | None = None
        self.finished: Path | None = None
        self.is_closed = False

    def write(self, blocks: Sequence[SampleBlock]) -> None:
        """Append blocks.

        Raises
        ------
        CaptureError
            If that fails; then nothing of the capture is left, and it is closed.
        """
        if self.is_closed:
            return
        try:
            writer = self._writer or self._open()
            for block in blocks:
                writer.write_calibrated(block)
        except (OSError, ConfigError) as error:
            raise self.given_up(str(error)) from error

    def finish(self, alarms: Sequence[AlarmEvent]) -> None:
        """Bring it to the disk, with the alarms, and give it its name.

        Raises
        ------
        CaptureError
            As `write` does.
        """
        writer, folder = self._writer, self.folder
        if writer is None or folder is None or self.is_closed:
            return
        try:
            _write_alarms(aside(folder) / ALARM, alarms)
            writer.finish()
        except (OSError, ConfigError) as error:
            raise self.given_up(str(error)) from error
        self.is_closed, self.finished = True, folder

    def _open(self) -> RecordingWriter:
        self._root.mkdir(parents=True, exist_ok=True)
        self.folder = capture_folder(self._root, self._event)
        made_by = f"padwatch {version('padwatch')}, alarm {self._event.identity.id}"
        self._writer = self._make_writer(
            self.folder, f"{made_by} occurrence {self._event.occurrence}"[:200]
        )
        return self._writer

    def given_up(self, reason: str) -> CaptureError:
        """Remove what there is of it, and say why."""
        self.is_closed = True
        if self._writer is not None and self.folder is not None:
            with suppress(OSError):
                (aside(self.folder) / ALARM).unlink(missing_ok=True)
            with suppress(ConfigError):
                self._writer.abandon()
        return CaptureError(f"samples around alarm {self._event.identity.id} are lost: {reason}")


def _write_alarms(path: Path, alarms: Sequence[AlarmEvent]) -> None:
    document: dict[str, object] = {"alarms": [_alarm(event) for event in alarms]}
    text = json.dumps(document | {"checksum": checksum_of(document)}, indent=1) + "\n"
    with path.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def _alarm(event: AlarmEvent) -> dict[str, Any]:
    return {
        "alarm": event.identity.id,
        "occurrence": event.occurrence,
        "change": event.change.value,
        "level": event.level.name.lower() if event.level else None,
        "time": rfc3339(event.time_ns),
        "time_ns": event.time_ns,
        "value": event.value,
        "limit": event.limit,
        "reason": str(event.reason),
    }


MAX_PARTS = 10_000


class Segment:
    """The stretch of a unit that is being written; lives in the thread that writes.

    Each part is a finished recording, synced and renamed into place; the last one is in memory or
    aside. :func:`service.recordings.continuous.joining.join` makes one recording of them.

    Parameters
    ----------
    first
        Its first block; its time says where the stretch ends.

    Raises
    ------
    OSError
        If the disk refuses.
    """

    def __init__(
        self, root: Path, unit: RecordedUnit, first: SampleBlock, settings: SegmentSettings
    ) -> None:
        self._unit, self._settings = unit, settings
        self._is_decided = False
        self._length_ns = ns_from_s(settings.stretch_s)
        self._number = first.start_ns // self._length_ns
        # should the device's time stand still
        self._max_samples = 2 * round(settings.stretch_s * unit.rate_hz)
        self._n_samples = self._n_parts = 0
        self._writer: RecordingWriter | None = None
        self._opened_s = 0.0
        self.folder = stretch_folder(root, unit.unit, first.start_ns)
        parts = parts_folder(self.folder)
        parts.mkdir()
        _sync(root)

    def goes_on_to(self, block: SampleBlock) -> bool:
        """Whether a block belongs to it: all stretches end at the same moments."""
        return (
            block.start_ns // self._length_ns == self._number
            and self._n_samples < self._max_samples
            and self._n_parts < MAX_PARTS
        )

    @property
    def n_unsynced(self) -> int:
        """Samples per channel that a crash would cost."""
        return 0 if self._writer is None else self._writer.n_samples

    def write(self, block: SampleBlock, now_s: float) -> None:
        """Append a block to the part that is being written.

        Raises
        ------
        ConfigError
            If it does not fit, or the disk refuses.
        """
        if self._writer is None:
            self._writer, self._opened_s = self._open(), now_s
        self._writer.write_calibrated(block)
        self._n_samples += block.n_samples

    def is_due(self, now_s: float) -> bool:
        """Whether the part has become long enough, or old enough."""
        if self._writer is None:
            return False
        long_enough = self._writer.n_samples >= self._settings.part_s * self._unit.rate_hz
        return long_enough or now_s - self._opened_s >= self._settings.part_s

    def finish_part(self) -> int:
        """Bring the part to the disk; return how many samples of each channel could not be.

        Raises
        ------
        ConfigError
            If the disk refuses; then the part is given up.
        """
        writer, self._writer = self._writer, None
        if writer is None or writer.n_samples == 0:
            if writer is not None:
                writer.abandon()
            return 0
        try:
            writer.finish()
        except ConfigError:
            writer.abandon()
            raise
        self._unit, self._is_decided = writer.unit, True
        self._n_parts += 1
        return writer.n_samples

    def _open(self) -> RecordingWriter:
        made_by = f"padwatch {version('padwatch')}, continuous"
        folder = part_folder(self.folder, self._n_parts)
        return RecordingWriter(folder, self._unit, made_by, first_decides=not self._is_decided)


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


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
