"""Writers of recordings of a plant's units, and sources that replay recordings."""

import threading
from collections.abc import AsyncGenerator, AsyncIterator, Iterable
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition.clock import Clock
from acquisition.errors import ConfigError, LinkError
from acquisition.recordings.manifest import read_manifest
from acquisition.recordings.reader import Recording, open_recording
from acquisition.recordings.source import RecordingSource, Selection, select
from acquisition.recordings.writer import RecordingWriter
from acquisition.source import SampleSource
from core.samples.blocks import SampleBlock
from service.runtime.times import compact
from service.settings.adapter_values import recorded_unit
from service.settings.core_values import calibration_of, machine_of
from service.settings.plant import PlantFile
from service.settings.storage import StoreSettings
from service.settings.units import UnitSettings


def recording_writer(unit: UnitSettings, folder: Path, made_by: str) -> RecordingWriter:
    """Return a writer of a recording of a unit; the first block determines the sample type.

    Raises `ConfigError` if the folder exists or cannot be created.
    """
    return RecordingWriter(folder, recorded_unit(unit), made_by)


def recordings_by_unit(folders: Iterable[Path], plant: PlantFile) -> dict[str, Path]:
    """Return the recording folder of each unit by unit id.

    Raises `ConfigError` if a recording has no readable manifest or an unknown unit, or two have the
    same unit.
    """
    known = [unit.id for unit in plant.unit]
    found: dict[str, Path] = {}
    for folder in folders:
        unit = read_manifest(folder).unit
        if unit not in known:
            raise ConfigError(f"{folder}: unknown unit {unit}; known units: {', '.join(known)}")
        if unit in found:
            raise ConfigError(f"{folder} and {found[unit]} are both of unit {unit}; give one only")
        found[unit] = folder
    return found


def selection_of(recording: Recording, unit: UnitSettings) -> Selection:
    """Return the selection of the channels of a recording that a unit of the plant file has.

    Raises `ConfigError` if a channel is missing, or its rate or measuring unit differs from the
    plant file.
    """
    slow_units = {channel.id: channel.unit for channel in unit.slow_channel}
    machine = replace(machine_of(unit), rate_hz=unit.sampling_hz)
    return select(recording.manifest, machine, slow_units)


def replay_source(
    folder: Path, unit: UnitSettings, clock: Clock, speed: float | None
) -> SampleSource:
    """Return a source that replays a recording, with the calibration of the plant file.

    `speed` is in seconds of the recording per second of replay; None replays as fast as it is read.
    Raises `ConfigError` if the recording is damaged or does not match the unit.
    """
    recording = open_recording(folder)
    selection = replace(selection_of(recording, unit), calibration=calibration_of(unit))
    return RecordingSource(recording, clock, selection, speed)


REPLAYS = "replays"
"""Subfolder of the data folder for replay results, separate from the live database."""


def replayed_plant(plant: PlantFile, units: Iterable[str], folder: Path) -> PlantFile:
    """Return a copy of the plant for a replay of `units`: SQLite in `folder`, on loopback."""
    closed = {"host": "127.0.0.1", "socket": None, "tls": None}
    service = plant.service.model_copy(update={"data_folder": str(folder), **closed})
    chosen = tuple(unit for unit in plant.unit if unit.id in set(units))
    alone = {"unit": chosen, "service": service, "store": StoreSettings()}
    return plant.model_copy(update=alone)


def replay_folder(plant: PlantFile, recordings: Iterable[Path], now_ns: int) -> Path:
    """Return the folder for the results of a replay, named after its recordings and the time."""
    name = "+".join(path.resolve().name for path in recordings)[:80]
    return Path(plant.service.data_folder) / REPLAYS / f"{name}-{compact(now_ns)}"


@dataclass(frozen=True)
class PlayedOut:
    """Source that reads a simulated DAQ, and ends when the recording that the DAQ plays ends.

    After the end, the DAQ still replies like a device whose converter has stopped. The wrapped
    source then raises LinkError, which ends the blocks of this source. `over` is set when the DAQ
    has reported the end of the recording; `gone`, which may be None, when the DAQ process has
    exited, which also ends the blocks.
    """

    source: SampleSource
    over: threading.Event
    gone: threading.Event | None = None

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Yield the blocks of the link, which opens with the first, until recording or DAQ end.

        The blocks raise `LinkError` or `ConfigError` if the wrapped source raises it before the end
        of the recording.
        """
        async with aclosing(self._until_over()) as blocks:
            yield blocks

    async def _until_over(self) -> AsyncGenerator[SampleBlock, None]:
        try:
            async with self.source.connect() as blocks:
                async for block in blocks:
                    yield replace(block, clock=None)  # the device reports times of the recording
        except LinkError:
            if not (self.over.is_set() or (self.gone is not None and self.gone.is_set())):
                raise
