"""Samples around alarms, as recordings below the data folder."""

from functools import partial
from pathlib import Path

from acquisition.clock import Clock
from acquisition.recording.writer import RecordingWriter
from service.capture.captures import Captures
from service.capture.file import MakeWriter
from service.capture.span import CaptureSettings
from service.origin import Origin
from service.settings.modbus_sources import ModbusVectorSettings
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings
from service.wiring.recordings import recording_writer

CAPTURES = "captures"

BYTES_PER_GB = 1e9


def captures_of(plant: PlantFile, origin: Origin, clock: Clock) -> Captures:
    """Captures of all units of a live plant; what is replayed is a recording already."""
    found = plant.capture
    kept = origin is Origin.LIVE and found.samples == "kept"
    # a rack that gives vectors has no samples to keep
    waveforms = [u for u in plant.unit if not isinstance(u.source, ModbusVectorSettings)]
    units = waveforms if kept else []
    settings = CaptureSettings(
        pre_s=found.pre_s,
        post_s=found.post_s,
        max_s=found.max_s,
        max_bytes=round(found.max_gb * BYTES_PER_GB),
    )
    return Captures(
        Path(plant.service.data_folder) / CAPTURES,
        settings,
        {unit.id: _writer_of(unit) for unit in units},
        {unit.id: unit.rate_hz for unit in units},
        clock,
    )


def _writer_of(unit: UnitSettings) -> MakeWriter:
    make: partial[RecordingWriter] = partial(recording_writer, unit)
    return make
