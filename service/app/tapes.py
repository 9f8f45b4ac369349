"""All samples of units, as recordings in a folder of their own."""

from collections.abc import Callable
from pathlib import Path

from acquisition.clock import Clock
from service.recordings.continuous_recorder import Shed, Tape
from service.recordings.segment import TapeSettings
from service.settings.modbus_sources import ModbusVectorSettings
from service.settings.origin import Origin
from service.settings.plant import PlantFile
from service.settings.recorded_units import recorded_unit

RECORDINGS = "recordings"


def recordings_folder(plant: PlantFile) -> Path:
    """Where continuous recordings of a plant are kept."""
    return Path(plant.recording.folder or Path(plant.service.data_folder) / RECORDINGS)


def tape_of(
    plant: PlantFile, origin: Origin, clock: Clock, press: Callable[[], Shed | None]
) -> Tape:
    """Keeps all samples of those units of a live plant of which they are wanted."""
    found = plant.recording
    units = {
        unit.id: recorded_unit(unit)
        for unit in plant.unit
        # a rack that gives vectors has no samples; what is replayed is a recording already
        if found.keeps(unit.id)
        and origin is Origin.LIVE
        and not isinstance(unit.source, ModbusVectorSettings)
    }
    settings = TapeSettings(60.0 * found.length_min, found.sync_s)
    owned = [unit.id for unit in plant.unit] if origin is Origin.LIVE else []
    return Tape(recordings_folder(plant), units, settings, clock, press, owned)
