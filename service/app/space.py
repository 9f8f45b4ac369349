"""Which disks are looked at, and how little room on them is an alarm."""

from pathlib import Path

from acquisition.clock import Clock
from service.app.captures import CAPTURES
from service.app.evidence import EVIDENCE
from service.app.tapes import RECORDINGS, recordings_folder
from service.runtime.disk import SpaceLimits, SpaceWatch
from service.settings.plant import PlantFile
from service.settings.space import SpaceSettings

BYTES_PER_GB = 1e9


def space_watch(plant: PlantFile, clock: Clock) -> SpaceWatch:
    """Looks at whatever the plant's data are on; captures may be on a disk of their own."""
    data = Path(plant.service.data_folder)
    folders = {"data": data, CAPTURES: data / CAPTURES, EVIDENCE: data / EVIDENCE}
    if plant.recording.samples == "kept":
        folders[RECORDINGS] = recordings_folder(plant)
    return SpaceWatch(folders, space_limits(plant.space), clock)


def space_limits(settings: SpaceSettings) -> SpaceLimits:
    """Limits as the plant file has them."""
    return SpaceLimits(
        settings.alert_free_share,
        settings.danger_free_share,
        round(settings.alert_free_gb * BYTES_PER_GB),
        round(settings.danger_free_gb * BYTES_PER_GB),
    )
