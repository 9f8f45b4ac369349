"""`CaptureFile`: one capture on its way to the disk; lives in the thread that writes."""

import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import checksum_of
from acquisition.recordings.writer import RecordingWriter
from core.alarms.alarm import AlarmEvent
from core.samples.blocks import SampleBlock
from service.recordings.capture.folders import ALARM, aside, capture_folder
from service.runtime.times import rfc3339

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
