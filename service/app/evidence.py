"""Evidence of alarms, below the data folder."""

from importlib.metadata import version
from pathlib import Path

from acquisition.clock import Clock
from service.api.downloads import Downloads
from service.app.captures import BYTES_PER_GB, CAPTURES
from service.live.live_view import LiveView
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmKeeper
from service.recordings.around_alarms import Captures
from service.reports.archive import EvidenceArchive
from service.reports.keeper import EvidenceFolders, EvidenceKeeper
from service.reports.maker import Maker
from service.reports.room import EvidenceLimits, EvidenceRoom
from service.reports.routes import EvidenceDesk
from service.reports.snapshot import Camera
from service.reports.writer import EvidenceWriter
from service.settings.configuration import Configuration, built_from, configuration_of
from service.settings.origin import Origin
from service.settings.plant import PlantFile
from service.store.port import Store

EVIDENCE, CONFIGURATIONS = "evidence", "configurations"


def evidence_folders(plant: PlantFile) -> EvidenceFolders:
    """Where evidence of a plant is kept."""
    root = Path(plant.service.data_folder)
    return EvidenceFolders(root / EVIDENCE, root / CAPTURES, root / CONFIGURATIONS)


def evidence_desk(
    plant: PlantFile, store: Store, keeper: EvidenceKeeper, clock: Clock, downloads: Downloads
) -> EvidenceDesk:
    """Where evidence is asked for."""
    archive = EvidenceArchive(evidence_folders(plant), store)
    return EvidenceDesk(archive, keeper, plant.evidence.trend_days, clock, downloads)


def evidence_of(
    plant: PlantFile,
    origin: Origin,
    live: LiveView,
    films: FilmKeeper,
    store: Store,
    captures: Captures,
    clock: Clock,
) -> EvidenceKeeper:
    """The keeper of all evidence; `watch` lets it see alarms."""
    limits, folders = limits_of(plant), evidence_folders(plant)
    configuration = built_configuration(plant)
    maker = Maker(plant, configuration, f"padwatch {version('padwatch')}", origin)
    writer = EvidenceWriter(folders.evidence, maker, store.films, limits)
    camera = Camera({unit.id: unit for unit in plant.unit}, live, films)
    room = EvidenceRoom(folders.evidence, limits, clock)
    return EvidenceKeeper(folders, camera, writer, room, configuration, captures, clock)


def watch(keeper: EvidenceKeeper, alarms: AlarmEngine, captures: Captures, origin: Origin) -> None:
    """Let a keeper see alarms; what is replayed can be replayed again, and needs no evidence."""
    if origin is Origin.LIVE:
        alarms.show(keeper.see)
        captures.tell(keeper.captured)


def built_configuration(plant: PlantFile) -> Configuration:
    """The plant file as this program was built to read it, without secrets."""
    return configuration_of(plant, version("padwatch"), built_from())


def limits_of(plant: PlantFile) -> EvidenceLimits:
    """How much is kept."""
    found = plant.evidence
    return EvidenceLimits(
        max_bytes=round(found.max_gb * BYTES_PER_GB),
        hard_max_bytes=round(found.hard_max_gb * BYTES_PER_GB),
        keep_days=found.keep_days,
        max_per_alarm=found.max_per_alarm,
        trend_days=found.trend_days,
    )
