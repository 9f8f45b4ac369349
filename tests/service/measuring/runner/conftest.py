"""A runner over scripted plants, a clock that never waits and a real store."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigs.blocks import given_block
from rigs.database_copy import copy_database
from rigs.standing_clock import StandingClock

from acquisition.recordings.manifest import RecordedChannel, RecordedUnit
from acquisition.recordings.writer import RecordingWriter
from core.alarms.rules import LimitRule, UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.limits import Limits
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD
from core.samples.blocks import SampleBlock
from core.samples.gaps import Reach
from service.measuring.acquirer import Bus
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.analyser import BUS_CAPACITY, Analyser, Runner
from service.measuring.films import FilmMonitor
from service.measuring.live_view import LiveView
from service.measuring.recorder import Recorder
from service.measuring.sources import WatchedUnit
from service.recordings.around_alarms import Captures, CaptureSettings
from service.recordings.segment import MakeWriter
from service.runtime.heartbeats import Heartbeats
from service.settings.films import FilmAlarmSettings
from service.store.sqlite import SqliteStore

RATE_HZ = 100.0
SEGMENT = 1024
BLOCK = 128
T0 = 1_767_225_600_000_000_000

Step = BaseException | SampleBlock
"""What a scripted plant does next: deliver a block or fail."""


class RecordingClock(StandingClock):
    """Time that passes at once when somebody waits, and remembers for how long."""

    def __init__(self) -> None:
        super().__init__()
        self.slept_s: list[float] = []

    async def sleep(self, duration_s: float) -> None:
        self.slept_s.append(duration_s)
        self.s += duration_s
        await asyncio.sleep(0)


class ScriptedPlant:
    """One list of steps for each connection; the last connection stays open, or ends."""

    def __init__(self, *connections: Sequence[Step], ends: bool = True) -> None:
        self._connections = list(connections)
        self._ends = ends
        self.n_connections = 0
        self.n_open = 0
        self.exhausted = asyncio.Event()

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        steps = self._connections[self.n_connections]
        self.n_connections += 1
        if steps and isinstance(steps[0], BaseException):
            raise steps[0]
        self.n_open += 1
        try:
            yield self._blocks(steps, self.n_connections == len(self._connections))
        finally:
            self.n_open -= 1

    async def _blocks(self, steps: Sequence[Step], is_last: bool) -> AsyncIterator[SampleBlock]:
        for step in steps:
            if isinstance(step, BaseException):
                raise step
            yield step
        if is_last:
            self.exhausted.set()
            if not self._ends:
                await asyncio.Event().wait()


def unit_named(name: str) -> Unit:
    """One bearing, four channels, 60 r/min."""
    channels = (
        Channel("sx", Measurand.DISPLACEMENT_UM),
        Channel("sy", Measurand.DISPLACEMENT_UM),
        Channel("bx", Measurand.DISPLACEMENT_UM),
        Channel("by", Measurand.DISPLACEMENT_UM),
    )
    bearing = Bearing("UJB", 1.18e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0))
    return Unit(name, 60.0, RATE_HZ, channels, (bearing,))


def recorded_unit(name: str) -> RecordedUnit:
    """The same unit for a recording."""
    limits = {"full_scale_v": 10.0, "unit_per_v": 100.0, "ok_min_v": -10.0, "ok_max_v": 10.0}
    return RecordedUnit(
        unit=name,
        rate_hz=RATE_HZ,
        channels=tuple(
            RecordedChannel(id=channel.id, measurand=channel.measurand, **limits)
            for channel in unit_named(name).channels
        ),
        slow_channels=(),
        sample_type="float32",
        block_samples=BLOCK,
    )


def writer_of(name: str) -> MakeWriter:
    return lambda folder, made_by: RecordingWriter(folder, recorded_unit(name), made_by)


def block_number(number: int, unit: str = "U1", rate_hz: float = RATE_HZ) -> SampleBlock:
    """Samples of a shaft that turns once a second; block 1 follows block 0, and so on."""
    first = number * BLOCK
    angle = 2 * np.pi * np.arange(first, first + BLOCK) / RATE_HZ
    turning = np.array([50 * np.cos(angle), 50 * np.sin(angle)])
    return given_block(
        unit=unit,
        epoch=1,
        first_index=first,
        start_ns=T0 + round(first / RATE_HZ * 1e9),
        rate_hz=rate_hz,
        samples=np.concatenate([turning, turning / 5]).astype(np.float32),
        channel_quality=(GOOD,) * 4,
        calibration=replace(recorded_unit(unit).calibration, rate_hz=rate_hz),
    )


RULES = UnitRules(
    channel=rule_of(2.0, 4.0),
    bearings={"UJB": {"shaft_order1": LimitRule(Limits(60.0, 90.0, 5.0), rule_of(0.0, 0.0))}},
)
"""A block lasts 1.28 s, a refresh takes 8.96 s; the shaft of :func:`block_number` moves 50 µm."""


class Plant:
    """Everything that a running service has, over some scripted units."""

    def __init__(self, path: Path, capacity: int = 5000) -> None:
        self.path = path
        self.clock = RecordingClock()
        self.store = SqliteStore(path)
        self.live = LiveView(["U1", "U2"], self.clock, 30.0)
        self.recorder = Recorder(self.store, self.live, self.clock, path.parent, capacity)
        self.capture_folder = path.parent / "captures"
        units = {name: unit_named(name) for name in ("U1", "U2")}
        settings = FilmAlarmSettings()
        self.films = FilmMonitor(units, {}, settings, self.store.films, self.clock)
        self.start_alarms()

    def start_alarms(self) -> None:
        """Begin as after a restart, with what the store knows."""
        names = ("U1", "U2")
        self.captures = Captures(
            self.capture_folder,
            CaptureSettings(pre_s=10.0, post_s=20.0, max_s=60.0),
            {name: writer_of(name) for name in names},
            dict.fromkeys(names, RATE_HZ),
            self.clock,
        )
        alarms = {name: UnitAlarms(unit_named(name), RULES) for name in names}
        listener = self.captures.take
        self.alarms = AlarmEngine(alarms, self.recorder.put, self.clock, listener)
        self.alarms.restore(self.store.alarms())

    def runner(self, reach: Reach | None = None, **units: ScriptedPlant) -> Runner:
        settings = AnalysisSettings(segment_samples=SEGMENT, n_segments=4, min_segments=2)
        watched = {name: WatchedUnit(source) for name, source in units.items()}
        monitors = {name: UnitMonitor(unit_named(name), settings) for name in units}
        for monitor in monitors.values():
            monitor.go_on(reach)
        analyser = Analyser(monitors, self.live, self.alarms, self.films)
        bus, beats = Bus(BUS_CAPACITY, self.clock), Heartbeats(self.clock)
        return Runner(watched, self.live, analyser, self.recorder, bus, beats, self.clock)


@pytest.fixture
def scripted() -> Callable[..., ScriptedPlant]:
    return ScriptedPlant


@pytest.fixture
def block() -> Callable[..., SampleBlock]:
    return block_number


@pytest.fixture
def plant(request, database_file: Path, tmp_path: Path) -> Iterator[Plant]:
    """A plant; the parameter is how many findings its recorder keeps at most."""
    built = Plant(copy_database(database_file, tmp_path), getattr(request, "param", 5000))
    yield built
    built.store.close()
