"""Recordings of a unit: writers, readers, and recordings as sources."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from acquisition.clock import Clock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import read_manifest
from acquisition.recordings.reader import Recording, open_recording
from acquisition.recordings.source import RecordingSource, Selection, select
from acquisition.recordings.writer import RecordingWriter
from acquisition.simulated.devices.recorded import RecordedFeed
from acquisition.simulated.feed import SampleFeed
from acquisition.source import SampleSource
from service.settings.adapter_values import recorded_unit
from service.settings.core_values import calibration_of, machine_of
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings

ANALYSED_S = 10.0
"""Length of the blocks of a recording that is analysed and raises no alarm."""


def recording_writer(unit: UnitSettings, folder: Path, made_by: str) -> RecordingWriter:
    """Create the writer of a recording of a unit; the first block decides on counts or values.

    Raises
    ------
    ConfigError
        If the folder exists or cannot be created.
    """
    return RecordingWriter(folder, recorded_unit(unit), made_by, first_decides=True)


def recording_of(folder: Path) -> Recording:
    """Open a finished recording and check all of it.

    Raises
    ------
    ConfigError
        If the recording is damaged.
    """
    return open_recording(folder)


def recordings_by_unit(folders: Iterable[Path], plant: PlantFile) -> dict[str, Path]:
    """Return recordings by unit.

    Raises
    ------
    ConfigError
        If one has no readable manifest, an unknown unit, or the same unit as another.
    """
    known = [unit.id for unit in plant.unit]
    found: dict[str, Path] = {}
    for folder in folders:
        unit = read_manifest(folder).unit
        if unit not in known:
            raise ConfigError(f"{folder}: is of unit {unit}, the plant has {', '.join(known)}")
        if unit in found:
            raise ConfigError(f"{folder}: is of unit {unit}, like {found[unit]}; play one of them")
        found[unit] = folder
    return found


def selection_of(recording: Recording, unit: UnitSettings) -> Selection:
    """Return the part of a recording that a unit needs.

    Raises
    ------
    ConfigError
        If a channel is missing, or has another rate or another unit.
    """
    slow_units = {channel.id: channel.unit for channel in unit.slow_channel}
    machine = replace(machine_of(unit), rate_hz=unit.sampling_hz)
    return select(recording.manifest, machine, slow_units)


def recording_source(
    recording: Recording, selection: Selection, unit: UnitSettings | None, clock: Clock
) -> SampleSource:
    """Return a recording as an unpaced source.

    Parameters
    ----------
    unit
        Unit whose calibration replaces the recorded one, if given.
    """
    if unit is not None:
        selection = replace(selection, calibration=calibration_of(unit))
    return RecordingSource(recording, clock, selection, block_s=ANALYSED_S)


def replay_source(
    folder: Path, unit: UnitSettings, clock: Clock, speed: float | None
) -> SampleSource:
    """Return a recording in place of a unit's source, with the unit's calibration.

    Parameters
    ----------
    speed
        Seconds of the recording per second; None to play as fast as the reader reads.

    Raises
    ------
    ConfigError
        If it is damaged or does not fit the unit.
    """
    recording = open_recording(folder)
    selection = replace(selection_of(recording, unit), calibration=calibration_of(unit))
    return RecordingSource(recording, clock, selection, speed)


def recorded_feed(folder: Path, unit: UnitSettings) -> SampleFeed:
    """Return a recording as the feed of a simulated DAQ.

    Raises
    ------
    ConfigError
        If it is damaged or does not fit the unit.
    """
    recording = open_recording(folder)
    return RecordedFeed(recording, selection_of(recording, unit))
