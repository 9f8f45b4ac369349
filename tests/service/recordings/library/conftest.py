"""Recordings in folders, and a caretaker over a real store who looks when a test says so."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigs.blocks import cell_block
from rigs.memory_folder import path_in_memory  # noqa: F401 - a fixture
from rigs.standing_clock import StandingClock

from acquisition.recordings.manifest import RecordedChannel, RecordedUnit
from acquisition.recordings.writer import RecordingWriter
from core.machine.channel import Measurand
from service.recordings.index import Index
from service.recordings.keeper import RecordingIndexer, RecordingLock
from service.recordings.retention import RecordingRetention, RetentionRules, SpaceGauge
from service.runtime.disk import DiskSpace
from service.settings.storage import SpaceSettings
from service.store.sqlite import SqliteStore
from service.store.waveforms import WaveformFile, WaveformKind

SPACE = SpaceSettings(alert_free_gb=2e-9, danger_free_gb=1e-9)

T0 = 1_767_225_600_000_000_000
HOUR_NS = 3600 * 10**9
N_SAMPLES, RATE_HZ = 500, 50.0
CONTINUOUS, CAPTURE = WaveformKind.CONTINUOUS, WaveformKind.CAPTURE


class Clock(StandingClock):
    """Time passes when a test says so, or somebody waits."""

    async def sleep(self, duration_s: float) -> None:
        self.s += duration_s


def recording(folder: Path, start_ns: int, unit: str = "U1", step_ns: int = 10**9) -> Path:
    """Ten blocks of a second, one every so often; channel a is the number of the sample."""
    limits = {"full_scale_v": 10.0, "unit_per_v": 1.0, "ok_min_v": -10.0, "ok_max_v": 10.0}
    channels = tuple(
        RecordedChannel(id=id_, measurand=Measurand.DISPLACEMENT_UM, **limits) for id_ in "ab"
    )
    recorded = RecordedUnit(unit=unit, rate_hz=RATE_HZ, channels=channels, slow_channels=())
    index = np.arange(N_SAMPLES, dtype=np.int16)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with RecordingWriter(folder, recorded, "a test") as writer:
        for first in range(0, N_SAMPLES, 50):
            counts = np.array([index, -index])[:, first : first + 50]
            stamp = start_ns + first // 50 * step_ns
            own = {"calibration": recorded.calibration}
            writer.write(cell_block(1, first, stamp, RATE_HZ, counts, (True, True), (), **own))
    return folder


class Rig:
    """Two folders of recordings, and who looks after them."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.roots = {CONTINUOUS: root / "recordings", CAPTURE: root / "captures"}
        for folder in self.roots.values():
            folder.mkdir()
        self.clock, self.store = Clock(), SqliteStore(root / "padwatch.sqlite3")
        self.room: dict[str, Any] = {}
        self.bound = frozenset[str]()
        self.space = DiskSpace(1, 10**12, 10**12)
        self.hire()

    def hire(self) -> RecordingRetention:
        """Begin anew, as after a restart."""
        self.gauge = SpaceGauge(self.roots, SPACE, self.measured)
        custody = RetentionRules(self.roots, self.gauge, lambda: self.bound, **self.room)
        self.caretaker = RecordingRetention(
            custody, Index(self.store.waveforms, "here"), self.clock
        )
        return self.caretaker

    def keeper(self, hire: Callable[[], RecordingRetention] | None = None) -> RecordingIndexer:
        return RecordingIndexer(self.gauge, hire or self.hire, self.clock, RecordingLock(self.root))

    def measured(self, _: Path) -> DiskSpace:
        return self.space

    def make(self, hours: int, kind: WaveformKind = CONTINUOUS, unit: str = "U1") -> Path:
        name = f"{unit}-{hours:03d}-{kind.value}"
        return recording(self.roots[kind] / name, T0 + hours * HOUR_NS, unit)

    def make_day(self, hours: int) -> list[str]:
        """Recordings of an hour each."""
        names = [f"U1-{hour:03d}-continuous" for hour in range(hours, hours + 24)]
        for hour, name in enumerate(names, hours):
            start_ns = T0 + hour * HOUR_NS
            recording(self.roots[CONTINUOUS] / name, start_ns, step_ns=HOUR_NS // 9)
        return names

    def files(self) -> list[WaveformFile]:
        return self.store.waveforms.files("here")

    def names(self, kind: WaveformKind = CONTINUOUS) -> list[str]:
        return sorted(path.name for path in self.roots[kind].iterdir())

    def limit(self, **limits: float) -> None:
        self.room |= limits
        self.hire()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    built = Rig(tmp_path)
    yield built
    built.store.close()


@pytest.fixture
def make_recording() -> Callable[..., Path]:
    return recording
