"""What looks after recordings: captures in the data folder, continuous ones wherever they are."""

from functools import partial
from pathlib import Path

from acquisition.clock import Clock
from service.app.captures import BYTES_PER_GB, CAPTURES
from service.app.evidence import EVIDENCE
from service.app.space import space_limits
from service.app.tapes import recordings_folder
from service.recordings.keeping.caretaker import Caretaker, Custody
from service.recordings.keeping.gauge import Gauge
from service.recordings.keeping.index import Index
from service.recordings.keeping.keeper import WaveformKeeper
from service.recordings.keeping.place import place_of
from service.recordings.keeping.room import RoomLimits
from service.recordings.keeping.watch_keeping import WatchKeeping
from service.reports.capture_link import captures_in_use
from service.runtime.disk import measure_disk
from service.settings.plant import PlantFile
from service.store.port import Store
from service.store.waveform_port import WaveformKind


def waveform_keeper(plant: PlantFile, store: Store, clock: Clock) -> WaveformKeeper:
    """Looks after the recordings of a live plant."""
    data, custody = Path(plant.service.data_folder), custody_of(plant)

    def hire() -> Caretaker:
        return Caretaker(custody, Index(store.waveforms, place_of(data)), clock)

    return WaveformKeeper(custody.gauge, hire, clock, WatchKeeping(data))


def custody_of(plant: PlantFile) -> Custody:
    """Which recordings there are, and by which rules they stay."""
    data = Path(plant.service.data_folder)
    room = RoomLimits(
        continuous_bytes=round(plant.recording.max_gb * BYTES_PER_GB),
        capture_bytes=round(plant.capture.max_gb * BYTES_PER_GB),
        continuous_days=plant.recording.max_days,
    )
    roots = {
        WaveformKind.CAPTURE: data / CAPTURES,
        WaveformKind.CONTINUOUS: recordings_folder(plant),
    }
    return Custody(
        roots=roots,
        room=room,
        gauge=Gauge(roots, space_limits(plant.space), measure_disk),
        bound=partial(captures_in_use, data / EVIDENCE),
    )
