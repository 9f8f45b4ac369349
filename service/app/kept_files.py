"""Construction of recorders, evidence collector, retention and disk monitor of a plant."""

from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path

from acquisition.clock import Clock
from service.app.recordings import recording_writer
from service.app.storage import (
    CAPTURES,
    EVIDENCE,
    RECORDINGS,
    built_configuration,
    evidence_folders,
    recordings_folder,
)
from service.measuring.films import FilmMonitor
from service.measuring.live_view import LiveView
from service.recordings.around_alarms import Captures, CaptureSettings
from service.recordings.continuous_recorder import ContinuousRecorder, DropReason
from service.recordings.folders import place_of
from service.recordings.index import Index
from service.recordings.keeper import RecordingIndexer, RecordingLock
from service.recordings.retention import RecordingRetention, RetentionRules, SpaceGauge
from service.recordings.segment import SegmentSettings
from service.reports.collector import EvidenceCollector, SnapshotTaker
from service.reports.document import Maker
from service.reports.folders import captures_in_use
from service.reports.retention import EvidenceRetention
from service.reports.writer import EvidenceWriter
from service.runtime.disk import SpaceWatch, measure_disk
from service.settings.adapter_values import recorded_unit
from service.settings.core_values import analysis_of, film_rules_of
from service.settings.plant import PlantFile
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.storage import BYTES_PER_GB, Origin
from service.settings.units import UnitSettings
from service.store.store import Store
from service.store.waveforms import WaveformKind


def _sampled_units(plant: PlantFile, origin: Origin) -> list[UnitSettings]:
    """Return the units whose samples may be recorded: no vector racks, and none of a replay."""
    units = plant.unit if origin is Origin.LIVE else ()
    return [unit for unit in units if not isinstance(unit.source, ModbusVectorSettings)]


def captures_of(plant: PlantFile, origin: Origin, clock: Clock) -> Captures:
    """Return the recorder of captures (samples around alarms); with a replay it records nothing."""
    found = plant.capture
    units = _sampled_units(plant, origin) if found.samples == "kept" else []
    watched = [u for u in units if not isinstance(film_rules_of(u, plant.films), str)]
    analysis = analysis_of(plant.analysis)
    n_samples = analysis.segment_samples + (analysis.n_segments - 1) * analysis.hop_samples
    window_s = max((n_samples / unit.sampling_hz for unit in watched), default=0.0)
    settings = CaptureSettings(**found.values_for(CaptureSettings), window_s=window_s)
    return Captures(
        Path(plant.service.data_folder) / CAPTURES,
        settings,
        {unit.id: partial(recording_writer, unit) for unit in units},
        {unit.id: unit.sampling_hz for unit in units},
        clock,
    )


def tape_of(
    plant: PlantFile, origin: Origin, clock: Clock, press: Callable[[], DropReason | None]
) -> ContinuousRecorder:
    """Return the continuous recorder of a plant; `press` returns a reason to pause, or None."""
    found = plant.recording
    sampled = _sampled_units(plant, origin)
    units = {unit.id: recorded_unit(unit) for unit in sampled if found.keeps(unit.id)}
    settings = SegmentSettings(60.0 * found.length_min, found.sync_s)
    owned = [unit.id for unit in plant.unit] if origin is Origin.LIVE else []
    return ContinuousRecorder(recordings_folder(plant), units, settings, clock, press, owned)


def evidence_of(
    plant: PlantFile,
    origin: Origin,
    live: LiveView,
    films: FilmMonitor,
    store: Store,
    captures: Captures,
    clock: Clock,
) -> EvidenceCollector:
    """Return the collector of alarm evidence, which must be connected to the alarms."""
    limits, folders = plant.evidence, evidence_folders(plant)
    configuration = built_configuration(plant)
    maker = Maker(plant, configuration, f"padwatch {version('padwatch')}", origin)
    writer = EvidenceWriter(folders.evidence, maker, store.films, limits)
    camera = SnapshotTaker({unit.id: unit for unit in plant.unit}, live, films)
    room = EvidenceRetention(folders.evidence, limits, clock)
    return EvidenceCollector(folders, camera, writer, room, configuration, captures, clock)


def space_watch(plant: PlantFile, clock: Clock) -> SpaceWatch:
    """Return the monitor of free disk space of all data folders, which may be on several disks."""
    data = Path(plant.service.data_folder)
    folders = {"data": data, CAPTURES: data / CAPTURES, EVIDENCE: data / EVIDENCE}
    if plant.recording.samples == "kept":
        folders[RECORDINGS] = recordings_folder(plant)
    return SpaceWatch(folders, plant.space, clock)


def waveform_keeper(plant: PlantFile, store: Store, clock: Clock) -> RecordingIndexer:
    """Return the indexer of the recordings of a live plant, with their retention."""
    data, rules = Path(plant.service.data_folder), retention_rules(plant)

    def open_retention() -> RecordingRetention:
        return RecordingRetention(rules, Index(store.waveforms, place_of(data)), clock)

    return RecordingIndexer(rules.gauge, open_retention, clock, RecordingLock(data))


def retention_rules(plant: PlantFile) -> RetentionRules:
    """Return the retention rules of the recordings of a plant: folders, limits of size and age."""
    data = Path(plant.service.data_folder)
    roots = {
        WaveformKind.CAPTURE: data / CAPTURES,
        WaveformKind.CONTINUOUS: recordings_folder(plant),
    }
    return RetentionRules(
        roots=roots,
        gauge=SpaceGauge(roots, plant.space, measure_disk),
        in_use=partial(captures_in_use, data / EVIDENCE),
        continuous_bytes=round(plant.recording.max_gb * BYTES_PER_GB),
        capture_bytes=round(plant.capture.max_gb * BYTES_PER_GB),
        continuous_days=plant.recording.max_days,
    )
