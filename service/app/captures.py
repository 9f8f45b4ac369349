"""Samples around alarms, as recordings below the data folder."""

from functools import partial
from pathlib import Path

from acquisition.clock import Clock
from acquisition.recordings.writer import RecordingWriter
from service.app.recordings import recording_writer
from service.recordings.around_alarms import Captures, CaptureSettings
from service.recordings.segment import MakeWriter
from service.settings.core_values import analysis_of
from service.settings.film_rules import film_rules_of
from service.settings.modbus_sources import ModbusVectorSettings
from service.settings.origin import Origin
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings

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
        window_s=max((_window_s(plant, unit) for unit in units), default=0.0),
    )
    return Captures(
        Path(plant.service.data_folder) / CAPTURES,
        settings,
        {unit.id: _writer_of(unit) for unit in units},
        {unit.id: unit.sampling_hz for unit in units},
        clock,
    )


def _window_s(plant: PlantFile, unit: UnitSettings) -> float:
    """How long the samples are that a film's stiffness stands on; none where none is watched."""
    if isinstance(film_rules_of(unit, plant.films), str):
        return 0.0
    analysis = analysis_of(plant.analysis)
    n_samples = analysis.segment_samples + (analysis.n_segments - 1) * analysis.hop_samples
    return n_samples / unit.sampling_hz


def _writer_of(unit: UnitSettings) -> MakeWriter:
    make: partial[RecordingWriter] = partial(recording_writer, unit)
    return make
