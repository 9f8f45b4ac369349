"""Writing of recordings: captures of alarms, and segments of continuous recordings."""

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
"""Function (folder, made_by) that returns a writer of a new recording of a unit."""


class CaptureError(Exception):
    """Error raised if a capture cannot be written; the message states the alarm and the reason."""


class CaptureFile:
    """Files of a capture, that is a recording and its alarms; written atomically.

    Attributes
    ----------
    folder
        Final folder of the capture, which exists when it is finished; None until the first write.
    finished
        Final folder of the capture; None until the capture is finished.
    is_closed
        Whether the capture is finished or abandoned.
    """

    def __init__(self, root: Path, event: AlarmEvent, make_writer: MakeWriter) -> None:
        self._root, self._event, self._make_writer = root, event, make_writer
        self._writer: RecordingWriter | None = None
        self.folder: Path | None = None
        self.finished: Path | None = None
        self.is_closed = False

    def write(self, blocks: Sequence[SampleBlock]) -> None:
        """Append sample blocks; no effect on a closed capture.

        Raises `CaptureError` if writing fails; the capture is then removed and closed.
        """
        if self.is_closed:
            return
        try:
            writer = self._writer or self._open()
            for block in blocks:
                writer.write(block)
        except (OSError, ConfigError) as error:
            raise self.abandon(str(error)) from error

    def finish(self, alarms: Sequence[AlarmEvent]) -> None:
        """Write the alarms, sync the capture to the disk, and rename it to its final name.

        No effect before the first write, and on a closed capture.

        Raises
        ------
        CaptureError
            If writing fails; the capture is then removed and closed.
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
        """Close and remove the capture; return the error that the caller raises."""
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
    """Write alarm events to a JSON file with a checksum, durable on return; may raise `OSError`."""
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
    """Durations of the segments and parts of a continuous recording, in seconds.

    Parameters
    ----------
    segment_s
        Duration of a segment, which finally becomes one recording.
    part_s
        Duration of a part. A finished part is synced to the disk; a crash loses at most the open
        part and the queued blocks.
    """

    segment_s: float = 600.0
    part_s: float = 30.0


MAX_PARTS = 10_000


class Segment:
    """Segment of a continuous recording in progress; for use in one thread.

    A segment consists of parts. Each finished part is a recording, synced to the disk under its
    final name. The newest part is still being written. `join` makes one recording of all parts.

    Parameters
    ----------
    first
        First block of the segment; its time determines the end of the segment.

    Raises
    ------
    OSError
        If the folder of the parts cannot be created.
    """

    def __init__(
        self, root: Path, unit: RecordedUnit, first: SampleBlock, settings: SegmentSettings
    ) -> None:
        self._unit, self._settings = unit, settings
        self._length_ns = ns_from_s(settings.segment_s)
        self._number = first.start_ns // self._length_ns
        # limit in case the time stamps of the device stop
        self._max_samples = 2 * round(settings.segment_s * unit.rate_hz)
        self._n_samples = self._n_parts = 0
        self._writer: RecordingWriter | None = None
        self._opened_s = 0.0
        self.folder = new_folder(root, unit.unit, first.start_ns, CONTINUOUS)
        parts_folder(self.folder).mkdir()
        sync_folder(root)

    def covers(self, block: SampleBlock) -> bool:
        """Return whether a block starts in the segment, which ends at a multiple of its length."""
        return (
            block.start_ns // self._length_ns == self._number
            and self._n_samples < self._max_samples
            and self._n_parts < MAX_PARTS
        )

    @property
    def n_unsynced(self) -> int:
        """Number of samples per channel in the open part, which a crash would lose."""
        return 0 if self._writer is None else self._writer.n_samples

    def write(self, block: SampleBlock, now_s: float) -> None:
        """Append a block to the open part; if none is open, open one at monotonic time `now_s`.

        Raises
        ------
        ConfigError
            If the block does not match the unit, or cannot be written.
        """
        if self._writer is None:
            made_by = f"padwatch {version('padwatch')}, continuous"
            folder = parts_folder(self.folder) / f"{self._n_parts:05d}"
            self._writer = RecordingWriter(folder, self._unit, made_by)
            self._opened_s = now_s
        self._writer.write(block)
        self._n_samples += block.n_samples

    def is_due(self, now_s: float) -> bool:
        """Return whether the open part has samples for ``part_s`` or was opened ``part_s`` ago."""
        if self._writer is None:
            return False
        long_enough = self._writer.n_samples >= self._settings.part_s * self._unit.rate_hz
        return long_enough or now_s - self._opened_s >= self._settings.part_s

    def finish_part(self) -> int:
        """Finish the open part and sync it; return its number of samples per channel, or 0.

        Raises
        ------
        ConfigError
            If the part cannot be written; it is then abandoned.
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
        self._n_parts += 1
        return writer.n_samples


log = structlog.get_logger()


def join(folder: Path) -> bool:
    """Join the parts of a segment to one recording; return False if no part is readable.

    After an interruption the function can be called again. An unreadable part is left out and its
    folder is marked as damaged.

    Raises
    ------
    ConfigError, OSError
        If the recording cannot be written; all parts then still exist.
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
    """Return the folders of the segments that a crash left unjoined, oldest first per unit.

    Segments of other units are omitted: another process may be writing them.
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
                "an unreadable part of a continuous recording was set aside",
                folder=aside.name,
                reason=str(error),
            )


def _write(folder: Path, parts: Sequence[Recording]) -> None:
    first = parts[0].manifest
    unit = RecordedUnit(**{name: getattr(first, name) for name in RecordedUnit.model_fields})
    with RecordingWriter(folder, unit, first.made_by) as writer:
        for part in parts:
            for block in part.blocks():
                writer.write(block)


def _remove_parts(parts: Path) -> None:
    for part in sorted(parts.iterdir()):
        remove_recording(part)
    parts.rmdir()


class WriterThread:
    """Base class of recorders: writer thread, and log entries when writes fail or succeed again.

    Parameters
    ----------
    what
        Recorded data, as the subject of the log messages.

    Attributes
    ----------
    error
        Reason why the last write failed; None after a successful write.
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
