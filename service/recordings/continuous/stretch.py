"""`Stretch`: some minutes of a continuous recording, written part by part."""

import os
from importlib.metadata import version
from pathlib import Path

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import RecordedUnit
from acquisition.recordings.writer import RecordingWriter
from core.samples.blocks import SampleBlock
from core.units import ns_from_s
from service.recordings.continuous.names import part_folder, parts_folder, stretch_folder
from service.recordings.continuous.pieces import TapeSettings

MAX_PARTS = 10_000


class Stretch:
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
        self, root: Path, unit: RecordedUnit, first: SampleBlock, settings: TapeSettings
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
