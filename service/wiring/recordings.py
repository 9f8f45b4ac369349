"""Recordings of a unit: written, opened, and as sources."""

from dataclasses import replace
from pathlib import Path

from acquisition.clock import Clock
from acquisition.recording.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from acquisition.recording.reader import Recording, open_recording
from acquisition.recording.selection import Selection, select
from acquisition.recording.source import RecordingSource
from acquisition.recording.writer import RecordingWriter
from acquisition.source import SampleSource
from service.conversion import calibration_of, machine_of
from service.settings import units as settings


def recording_writer(unit: settings.UnitSettings, folder: Path, made_by: str) -> RecordingWriter:
    """A recording of a unit, about to be written.

    Raises
    ------
    ConfigError
        If the folder exists or cannot be made.
    """
    recorded = RecordedUnit(
        unit=unit.id,
        rate_hz=unit.rate_hz,
        channels=tuple(
            RecordedChannel(
                id=channel.id,
                measurand=channel.measurand,
                full_scale_v=channel.full_scale_v,
                unit_per_v=channel.unit_per_v,
                ok_min_v=channel.ok_min_v,
                ok_max_v=channel.ok_max_v,
            )
            for channel in unit.channel
        ),
        slow_channels=tuple(RecordedSlowChannel(**slow.model_dump()) for slow in unit.slow_channel),
    )
    return RecordingWriter(folder, recorded, made_by)


def recording_of(folder: Path) -> Recording:
    """A finished recording, checked from end to end.

    Raises
    ------
    ConfigError
        If anything about it is wrong.
    """
    return open_recording(folder)


def selection_of(recording: Recording, unit: settings.UnitSettings) -> Selection:
    """What a unit needs of a recording.

    Raises
    ------
    ConfigError
        If it is not there, or at another rate or in another unit.
    """
    slow_units = {channel.id: channel.unit for channel in unit.slow_channel}
    return select(recording.manifest, machine_of(unit), slow_units)


def recording_source(
    recording: Recording, selection: Selection, unit: settings.UnitSettings | None, clock: Clock
) -> SampleSource:
    """A recording as an unpaced source.

    Parameters
    ----------
    unit
        Whose calibration is to replace the recorded one, if any.
    """
    if unit is not None:
        selection = replace(selection, calibration=calibration_of(unit))
    return RecordingSource(recording, clock, selection)
