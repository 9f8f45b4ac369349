"""The program's loop: acquire, analyse, record; the only place that retries a link."""

import asyncio
import random
from collections.abc import Mapping
from dataclasses import dataclass

import structlog

from acquisition.clock import Clock
from acquisition.errors import AcquisitionError, ConfigError
from acquisition.source import SampleSource
from core.blocks import SampleBlock
from core.monitor_port import Monitor
from service.alarms.engine import AlarmEngine
from service.bus import Bus
from service.connect_gate import ConnectGate
from service.films.keeper import FilmKeeper
from service.heartbeats import Heartbeats, Pulse
from service.live import LinkState, LiveView
from service.recorder import Findings, Recorder
from service.store.port import UnitGap

log = structlog.get_logger()

BUS_CAPACITY = 512

CONNECTS_PER_S = 50.0
"""Over all units, so that a hundred devices that come back together are not stormed."""

CONFIG_RETRY_S = 15.0
"""A device that cannot fit the settings may be replaced or reconfigured, but not in seconds."""

TURNS = 3
"""Of the event loop between two bearings: what a request takes from its arrival to its answer."""


@dataclass(frozen=True)
class WatchedUnit:
    """A unit's source and the monitor that its blocks go to.

    Parameters
    ----------
    retry_s
        Longest wait before a lost link is tried again: the source's poll period, so that the first
        sample is here within two of them after the device is back.
    """

    source: SampleSource
    monitor: Monitor
    retry_s: float = 0.5


class Runner:
    """Runs all units until it is cancelled. A bug in any of its tasks ends them all."""

    def __init__(
        self,
        units: Mapping[str, WatchedUnit],
        live: LiveView,
        recorder: Recorder,
        clock: Clock,
        alarms: AlarmEngine,
        films: FilmKeeper,
        bus: Bus | None = None,
        beats: Heartbeats | None = None,
    ) -> None:
        self._units, self._live, self._recorder, self._clock = units, live, recorder, clock
        self._alarms, self._films = alarms, films
        self._bus = bus or Bus(BUS_CAPACITY, clock)
        self._beats = beats or Heartbeats(clock)
        self._gate = ConnectGate(CONNECTS_PER_S, clock)

    async def run(self) -> None:
        """Acquire and analyse; ends when every source has come to its end."""
        async with asyncio.TaskGroup() as tasks:
            recording = tasks.create_task(
                self._beats.tend("record", self._recorder.run), name="record"
            )
            analysis = tasks.create_task(self._beats.tend("analyse", self._analyse), name="analyse")
            async with asyncio.TaskGroup() as sources:
                for unit, watched in self._units.items():
                    sources.create_task(self._acquire(unit, watched), name=f"acquire {unit}")
            await self._bus.drained()
            analysis.cancel()
            await self._recorder.settled()
            recording.cancel()
            self._beats.release("analyse", "record")  # there is nothing left for them

    async def _acquire(self, unit: str, watched: WatchedUnit) -> None:
        """Read one unit for ever; a lost link is tried again and again."""
        while True:
            await self._gate.turn()
            try:
                await self._read(unit, watched.source)
            except AcquisitionError as error:
                self._note_failure(unit, error)
                await self._clock.sleep(_retry_s(error, watched.retry_s))
            else:
                self._live.set_link(unit, LinkState.ENDED, "the recording has ended")
                self._alarms.link(unit, False, "the recording has ended")
                return

    async def _read(self, unit: str, source: SampleSource) -> None:
        async with source.connect() as blocks:
            async for block in blocks:
                if self._live.set_link(unit, LinkState.CONNECTED):
                    log.info("connected", unit=unit)
                    self._alarms.link(unit, True)
                await self._bus.publish(block)

    def _note_failure(self, unit: str, error: AcquisitionError) -> None:
        if self._live.set_link(unit, LinkState.NOT_CONNECTED, str(error)):
            log.warning("not connected", unit=unit, reason=str(error))
        self._alarms.link(unit, False, str(error))

    async def _analyse(self, pulse: Pulse) -> None:
        pulse.rest()
        async for block in self._bus.blocks():
            pulse.beat()
            await self._take(block)
            self._bus.done()
            await asyncio.sleep(0)  # more blocks may be waiting, but so may others
            pulse.rest()

    async def _take(self, block: SampleBlock) -> None:
        monitor = self._units[block.unit].monitor
        found = []
        for assessment in monitor.steps(block):
            found.append(assessment)
            await _others()
        assessments, films = self._films.take(block.unit, found)
        gaps = [UnitGap(block.unit, gap) for gap in monitor.drain_gaps()]
        for assessment in assessments:
            self._live.set_assessment(assessment)
        self._live.set_received(block, monitor.account)
        news = self._alarms.take(block, assessments, self._films.conditions(films))
        if assessments or gaps or news:
            self._recorder.put(Findings(assessments, gaps, news, films))


async def _others() -> None:
    """Let all others have their turns: a bearing takes milliseconds, and many may be waiting."""
    for _ in range(TURNS):
        await asyncio.sleep(0)


def _retry_s(error: AcquisitionError, retry_s: float) -> float:
    if isinstance(error, ConfigError):
        return CONFIG_RETRY_S
    # devices that vanish together must not be called back together
    return retry_s * random.uniform(0.5, 1.0)  # noqa: S311  not a secret
