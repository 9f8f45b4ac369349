"""Recordings on their way to the disk: captures of alarms, and segments in synced parts."""

import asyncio
import json
from collections.abc import Callable, Container, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import structlog

from acquisition.clock import Clock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import RecordedUnit, checksum_of
from acquisition.recordings.reader import Recording, open_recording
from acquisition.recordings.writer import INCOMPLETE, RecordingWriter
from core.alarms.alarm import AlarmEvent
from core.samples.blocks import SampleBlock
from core.units import ns_from_s
from service.recordings.folders import (
    ALARM,
    CONTINUOUS,
    PARTS,
    damaged_folder,
    incomplete_folder,
    new_folder,
    parts_folder,
    remove_recording,
    unit_of,
)
from service.runtime.files import sync_folder, write_synced
from service.runtime.times import rfc3339

MakeWriter = Callable[[Path, str], RecordingWriter]
"""Opens a recording of a unit, given its folder and the program that makes it."""


class CaptureError(Exception):
    """A capture cannot be written; the message states which and why."""


class CaptureFile:
    """A recording with the alarms that it was made for; it exists whole or not at all.

    Attributes
    ----------
    finished
        Its folder once it is complete.
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
            If that fails; then the capture is removed and closed.
        """
        if self.is_closed:
            return
        try:
            writer = self._writer or self._open()
            for block in blocks:
                writer.write_block(block)
        except (OSError, ConfigError) as error:
            raise self.abandon(str(error)) from error

    def finish(self, alarms: Sequence[AlarmEvent]) -> None:
        """Sync it to the disk with its alarms, and give it its final name.

        Raises
        ------
        CaptureError
            As `write` does.
        """
        writer, folder = self._writer, self.folder
        if writer is None or folder is None or self.is_closed:
            return
        try:
            write_alarms(incomplete_folder(folder) / ALARM, alarms)
            writer.finish()
        except (OSError, ConfigError) as error:
            raise self.abandon(str(error)) from error
        self.is_closed, self.finished = True, folder

    def abandon(self, reason: str) -> CaptureError:
        """Close it and remove what was written; return the error to raise."""
        self.is_closed = True
        if self._writer is not None and self.folder is not None:
            with suppress(OSError):
                (incomplete_folder(self.folder) / ALARM).unlink(missing_ok=True)
            with suppress(ConfigError):
                self._writer.abandon()
        return CaptureError(f"samples around alarm {self._event.identity.id} are lost: {reason}")

    def _open(self) -> RecordingWriter:
        self._root.mkdir(parents=True, exist_ok=True)
        identity = self._event.identity
        self.folder = new_folder(self._root, identity.unit, self._event.time_ns, identity.kind)
        made_by = f"padwatch {version('padwatch')}, alarm {identity.id}"
        made_by = f"{made_by} occurrence {self._event.occurrence}"[:200]
        self._writer = self._make_writer(self.folder, made_by)
        return self._writer


def write_alarms(path: Path, alarms: Sequence[AlarmEvent]) -> None:
    """Write alarms with a checksum, as JSON that is synced to the disk."""
    document: dict[str, object] = {"alarms": [_alarm(event) for event in alarms]}
    text = json.dumps(document | {"checksum": checksum_of(document)}, indent=1) + "\n"
    write_synced(path, text.encode())


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


@dataclass(frozen=True)
class SegmentSettings:
    """Lengths of the pieces of a continuous recording.

    Parameters
    ----------
    segment_s
        Length of a finished recording.
    part_s
        Length of a part that is synced to the disk; a kill costs at most the open part and what
        is queued.
    """

    segment_s: float = 600.0
    part_s: float = 30.0


MAX_PARTS = 10_000


class Segment:
    """A segment of continuous samples that is being written, in one thread.

    Each part is a finished recording, synced and renamed into place. The newest part is in memory
    or incomplete. `join` makes one recording of all parts.

    Parameters
    ----------
    first
        Its first block, whose time determines the end of the segment.

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
        self._length_ns = ns_from_s(settings.segment_s)
        self._number = first.start_ns // self._length_ns
        # a limit in case the time of the device stands still
        self._max_samples = 2 * round(settings.segment_s * unit.rate_hz)
        self._n_samples = self._n_parts = 0
        self._writer: RecordingWriter | None = None
        self._opened_s = 0.0
        self.folder = new_folder(root, unit.unit, first.start_ns, CONTINUOUS)
        parts_folder(self.folder).mkdir()
        sync_folder(root)

    def covers(self, block: SampleBlock) -> bool:
        """Return whether a block belongs to it; all segments end at multiples of their length."""
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
        """Append a block to the open part.

        Raises
        ------
        ConfigError
            If it does not fit, or the disk refuses.
        """
        if self._writer is None:
            made_by = f"padwatch {version('padwatch')}, continuous"
            folder = parts_folder(self.folder) / f"{self._n_parts:05d}"
            self._writer = RecordingWriter(
                folder, self._unit, made_by, first_decides=not self._is_decided
            )
            self._opened_s = now_s
        self._writer.write_block(block)
        self._n_samples += block.n_samples

    def is_due(self, now_s: float) -> bool:
        """Return whether the open part is long enough or old enough."""
        if self._writer is None:
            return False
        long_enough = self._writer.n_samples >= self._settings.part_s * self._unit.rate_hz
        return long_enough or now_s - self._opened_s >= self._settings.part_s

    def finish_part(self) -> int:
        """Sync the open part to the disk; return its number of samples per channel.

        Raises
        ------
        ConfigError
            If the disk refuses; then the part is abandoned.
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


log = structlog.get_logger()


def join(folder: Path) -> bool:
    """Make one recording of the parts of a segment; return whether it exists.

    The function may be repeated after an interruption. An unreadable part is set aside.

    Raises
    ------
    ConfigError, OSError
        If the disk refuses; then all parts still exist.
    """
    parts = parts_folder(folder)
    remove_recording(incomplete_folder(folder))
    if not folder.exists():
        found = list(_readable(folder, parts))
        if found:
            _write(folder, found)
    _remove_parts(parts)
    return folder.exists()


def unjoined(root: Path, units: Container[str | None]) -> list[Path]:
    """Return the segments of units that a crash left in parts, oldest first per unit.

    Segments of other units are left out: another process may be writing them.
    """
    found = sorted(path for path in root.glob(f"*{PARTS}") if unit_of(path.name) in units)
    return [path.with_name(path.name.removesuffix(PARTS)) for path in found if path.is_dir()]


def _readable(folder: Path, parts: Path) -> Iterator[Recording]:
    for part in sorted(parts.iterdir()):
        if part.name.endswith(INCOMPLETE):
            continue
        try:
            yield open_recording(part)
        except ConfigError as error:
            aside = part.rename(damaged_folder(folder, part))
            log.error(
                "an unreadable part of a continuous recording is set aside",
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


def _remove_parts(parts: Path) -> None:
    for part in sorted(parts.iterdir()):
        remove_recording(part)
    parts.rmdir()


class WriterThread:
    """Base of the recorders: one thread for all writes, and a log entry when they fail or recover.

    Parameters
    ----------
    what
        Subject of the log messages.

    Attributes
    ----------
    error
        Why the last write failed; None after a success.
    """

    def __init__(self, name: str, what: str, clock: Clock) -> None:
        self._clock, self._what = clock, what
        self._thread = ThreadPoolExecutor(1, thread_name_prefix=name)
        self._busy_since_s: float | None = None
        self.error: str | None = None

    def _note(self, error: str | None) -> None:
        if error is not None and error != self.error:
            log.error(f"{self._what} are not recorded", reason=error)
        if error is None and self.error is not None:
            log.info(f"{self._what} are recorded again")
        self.error = error

    async def _in_thread(self, do: Callable[..., None], *arguments: object) -> None:
        self._busy_since_s = self._clock.monotonic_s()
        await asyncio.get_running_loop().run_in_executor(self._thread, do, *arguments)
        self._busy_since_s = None
